"""Counts of what a method detected, summed over blocks of successive scans: any drive fits in memory."""

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from echoscape.eval.detections.interface import ScoredScan
from echoscape.eval.detections.precision_recall import (
    LEVELS,
    PrecisionRecall,
    levels_of,
    precision_recall,
)
from echoscape.eval.detections.targets import LABELS, OUTSIDE, TARGET, ScanTargets

BAND_M = 10.0
"""Width of the range bands of recall [m]."""


@dataclass(frozen=True, kw_only=True)
class Tally:
    """Counts of one scan, of a block of scans or of several blocks; sums are over all axes but those named.

    Attributes:
        scans: Number of scans (...).
        labels: Judged detections by what they fell on and by level (..., labels, levels).
        found: Echoes by the level of their best detection (..., levels).
        found_by: Echoes that were found, by range band and class (..., bands, classes).
        echoes_by: All echoes, likewise.
        objects_found_by: Objects of which an echo was found, by class (..., classes); an object counts once
            in each scan.
        objects_by: All objects with an echo, likewise.
        map_true: Scored places at a target by level (..., levels); 0 of a detector without a map of scores.
        map_all: All scored places within the judged ranges by level (..., levels).
    """

    scans: NDArray[np.int64]
    labels: NDArray[np.int64]
    found: NDArray[np.int64]
    found_by: NDArray[np.int64]
    echoes_by: NDArray[np.int64]
    objects_found_by: NDArray[np.int64]
    objects_by: NDArray[np.int64]
    map_true: NDArray[np.int64]
    map_all: NDArray[np.int64]

    @classmethod
    def empty(cls, blocks: int, *, bands: int, classes: int) -> "Tally":
        """Make counts of 0.

        Args:
            blocks: Number of blocks.
            bands: Number of range bands.
            classes: Number of object classes.

        Returns:
            The counts, with blocks as the first axis.
        """
        shapes = {
            "scans": (),
            "labels": (len(LABELS), LEVELS),
            "found": (LEVELS,),
            "found_by": (bands, classes),
            "echoes_by": (bands, classes),
            "objects_found_by": (classes,),
            "objects_by": (classes,),
            "map_true": (LEVELS,),
            "map_all": (LEVELS,),
        }
        return cls(**{name: np.zeros((blocks, *shape), np.int64) for name, shape in shapes.items()})

    def add(self, block: int, scan: "Tally") -> None:
        """Add the counts of a scan to those of a block, in place.

        Args:
            block: Number of the block.
            scan: Counts of one scan.
        """
        for field in fields(self):
            getattr(self, field.name)[block] += getattr(scan, field.name)

    def weighted(self, weights: NDArray) -> "Tally":
        """Return sums of the blocks.

        Args:
            weights: How often each block counts in each of several sums (..., blocks).

        Returns:
            The sums, one for each set of weights.
        """
        weights = np.asarray(weights, np.float64)  # products of float64 are fast, and exact up to 2^53
        return Tally(
            **{
                field.name: np.tensordot(weights, getattr(self, field.name).astype(np.float64), axes=1)
                for field in fields(self)
            }
        )

    @property
    def total(self) -> "Tally":
        """The sum of all blocks."""
        return Tally(**{field.name: getattr(self, field.name).sum(axis=0) for field in fields(self)})

    @property
    def echoes(self) -> NDArray[np.int64]:
        """Number of echoes (...)."""
        return self.echoes_by.sum(axis=(-2, -1))

    @property
    def true(self) -> NDArray[np.int64]:
        """True detections by level (..., levels)."""
        return self.labels[..., TARGET, :]

    @property
    def false(self) -> NDArray[np.int64]:
        """False detections by level (..., levels)."""
        return self.labels.sum(axis=-2) - self.true

    @cached_property
    def curve(self) -> PrecisionRecall:
        """Precision of detections and recall of echoes by threshold."""
        return precision_recall(self.true, self.false, self.found, self.echoes)

    @cached_property
    def ranking(self) -> PrecisionRecall:
        """Precision of detections and recall of the true ones among them: how well scores rank them."""
        return precision_recall(self.true, self.false, self.true, self.true.sum(axis=-1))

    @cached_property
    def map_curve(self) -> PrecisionRecall:
        """Precision and recall of the scored places by threshold."""
        false = self.map_all - self.map_true
        return precision_recall(self.map_true, false, self.map_true, self.map_true.sum(axis=-1))

    @property
    def base_rate(self) -> NDArray[np.float64]:
        """Share of the scored places at a target (...): the precision of choosing among them at random."""
        with np.errstate(invalid="ignore"):
            return self.map_true.sum(axis=-1) / self.map_all.sum(axis=-1)


def tally_scan(
    targets: ScanTargets, scored: ScoredScan, limits: tuple[float, float], *, bands: int, classes: int
) -> Tally:
    """Count what a method made of one scan.

    Args:
        targets: The targets of the scan.
        scored: Detections and scores of a method.
        limits: Limits of its scores.
        bands: Number of range bands.
        classes: Number of object classes.

    Returns:
        The counts.
    """
    level = levels_of(scored.detections.score, limits)
    labels = targets.label(scored.detections)
    best = targets.best_levels(scored.detections, level)
    echoes, found = targets.echoes, best >= 0
    band = np.minimum((targets.echo_range_m // BAND_M).astype(np.int64), bands - 1)
    return Tally(
        scans=np.array(1),
        labels=_counts((labels.astype(np.int64), level), (len(LABELS), LEVELS), labels != OUTSIDE),
        found=_counts((best,), (LEVELS,), found),
        found_by=_counts((band, echoes.class_id), (bands, classes), found),
        echoes_by=_counts((band, echoes.class_id), (bands, classes), np.ones_like(found)),
        objects_found_by=_objects(echoes.instance[found], echoes.class_id[found], classes),
        objects_by=_objects(echoes.instance, echoes.class_id, classes),
        **_map_counts(targets, scored, limits),
    )


def _map_counts(
    targets: ScanTargets, scored: ScoredScan, limits: tuple[float, float]
) -> dict[str, NDArray[np.int64]]:
    """Return the counts of the scored places."""
    places = scored.score_map
    if places is None:
        return {name: np.zeros(LEVELS, np.int64) for name in ("map_true", "map_all")}
    bins, judged = targets.places(places)
    level = levels_of(places.score, limits)
    at_target = judged & targets.near_target[places.azimuth, bins]
    return {
        "map_true": _counts((level,), (LEVELS,), at_target),
        "map_all": _counts((level,), (LEVELS,), judged),
    }


def _counts(
    numbers: tuple[NDArray, ...], shape: tuple[int, ...], counted: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """Count combinations of numbers (N,) where `counted`."""
    flat = np.ravel_multi_index(tuple(each[counted].astype(np.int64) for each in numbers), shape)
    return np.bincount(flat, minlength=int(np.prod(shape))).reshape(shape)


def _objects(instance: NDArray[np.uint32], class_id: NDArray[np.uint8], classes: int) -> NDArray[np.int64]:
    """Count different objects by class."""
    _, first = np.unique(instance, return_index=True)
    return np.bincount(class_id[first], minlength=classes)
