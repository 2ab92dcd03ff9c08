"""Scans with a truth that is made by hand, and the definition of a match written out cell by cell."""

import math

import numpy as np
from numpy.typing import NDArray

from echoscape.eval.detections.interface import Detections, ScoredScan
from echoscape.sim.datasets.polar_scan import CellTruth, Component, PolarScan

BIN_M = 0.1
START_US = 1_700_000_000_000_000


def made_scan(codes: NDArray) -> PolarScan:
    """A scan with these codes (azimuths, bins), the first azimuth straight ahead."""
    azimuths = len(codes)
    return PolarScan(
        codes=codes.astype(np.uint8),
        timestamp_us=START_US + 625 * np.arange(azimuths),
        encoder=np.rint(5600 / azimuths * np.arange(azimuths)).astype(np.uint16),
        valid=np.ones(azimuths, bool),
        bin_m=BIN_M,
    )


def made_truth(component: NDArray, **cells: NDArray) -> CellTruth:
    """Truth with these components (azimuths, bins); what is not given is 0, every direct cell object 1."""
    shape = component.shape
    direct = component == Component.DIRECT
    found = {
        "component": component.astype(np.uint8),
        "instance": direct.astype(np.uint32),
        "class_id": direct.astype(np.uint8) * 6,
        "bounces": direct.astype(np.uint8),
        "moving": np.zeros(shape, bool),
        "displaced": component == Component.GHOST,
    }
    return CellTruth(**{**found, **cells})


def at(azimuth: list[int] | NDArray, bins: list[int] | NDArray, score: list[float] | NDArray) -> Detections:
    """Detections at the centres of bins."""
    return Detections(
        azimuth=np.asarray(azimuth, np.int64),
        range_m=(np.asarray(bins, float) + 0.5) * BIN_M,
        score=np.asarray(score, float),
    )


def scored(found: Detections) -> ScoredScan:
    """Detections that are also all the places that were scored."""
    return ScoredScan(detections=found, score_map=found)


def map_of(found: ScoredScan) -> Detections:
    """The map of scores of a detector that has one."""
    assert found.score_map is not None
    return found.score_map


def within(cell: tuple[int, int], place: tuple[int, int], *, azimuths: int, tolerance_m: float) -> bool:
    """Whether a place (azimuth, bin) is within the tolerance of a cell, from the definition."""
    across = abs(cell[0] - place[0])
    across = min(across, azimuths - across)
    step_m = (cell[1] + 0.5) * BIN_M * 2 * math.pi / azimuths
    widest = max(1, math.floor(tolerance_m / step_m + 1e-9))
    return across <= widest and abs(cell[1] - place[1]) * BIN_M <= tolerance_m + 1e-9
