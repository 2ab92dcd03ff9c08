"""How often a method finds the motion between scans of one place, whatever their headings: loop closure.

Source: the loop closures of Barnes & Posner 2020, section V, which meet a place from any direction. Scans are
up to 5 m apart, and the one to be found is turned to a drawn heading, by whole rows, which is exact.
"""

import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from echoscape.learn.data.augmentation import PairAugmentation, augmented_motion
from echoscape.learn.odometry.scan_matcher import PairEstimate, ScanFeatures, ScanMatcher
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.scan_folder import ScanFolder
from echoscape.sim.datasets.se2 import SE2, from_world, relative

_LOG = logging.getLogger(__name__)

APART_M = 5.0
WITHIN_M, WITHIN_DEG = 0.5, 1.0
_STAGE = 410
_BANDS = 5

Progress = Callable[[str, int, int], None]
"""Called with a stage's name, how much of it is done, and how much there is."""


@dataclass(frozen=True, kw_only=True)
class TurnedPair:
    """Scans by number, and the rows by which the source is turned clockwise."""

    source: int
    destination: int
    rows: int


def turned_pairs(poses: NDArray[np.float64], rows: int, count: int, *, seed: int = 0) -> list[TurnedPair]:
    """Draw pairs of scans up to `APART_M` apart: distances of every metre alike, any heading, either order.

    poses: (N, 3) x, y [m], yaw [rad], NaN where unknown; rows: of a scan.

    Raises:
        DatasetError: no two scans are so near each other.
    """
    known = np.flatnonzero(np.isfinite(poses).all(axis=1))
    near = known[KDTree(poses[known, :2]).query_pairs(APART_M, output_type="ndarray")]
    if len(near) == 0:
        raise DatasetError(f"any heading: no two scans with known poses are within {APART_M:g} m")
    near = near[np.lexsort(near.T)]  # in an order that does not hang on how the tree was searched
    away_m = np.hypot(*(poses[near[:, 0], :2] - poses[near[:, 1], :2]).T)
    band = np.minimum((away_m * _BANDS / APART_M).astype(int), _BANDS - 1)
    bands = np.unique(band)
    rng = np.random.default_rng(np.random.SeedSequence([seed, _STAGE]))
    found = []
    for _ in range(count):
        of_band = np.flatnonzero(band == bands[rng.integers(len(bands))])
        pair = of_band[rng.integers(len(of_band))]
        source, destination = rng.permutation(near[pair]).tolist()
        found.append(TurnedPair(source=source, destination=destination, rows=int(rng.integers(rows))))
    return found


@dataclass(frozen=True, kw_only=True)
class Places:
    """Pairs of scans of one place, and the poses (N, 3) x, y [m], yaw [rad] that they are judged by."""

    pairs: list[TurnedPair]
    poses: NDArray[np.float64]


def places_of(folder: ScanFolder, pairs: int, *, seed: int = 0) -> Places:
    """Draw pairs of a folder's scans.

    Raises:
        DatasetError: the folder tells no poses, or has no scans of one place.
    """
    world = folder.poses()
    if world is None:
        raise DatasetError(f"{folder.folder}: any heading: tells no poses to judge by")
    poses = from_world(world)
    return Places(pairs=turned_pairs(poses, folder.sensor.azimuths, pairs, seed=seed), poses=poses)


def loop_closure_recall(
    folder: ScanFolder,
    estimator: ScanMatcher,
    places: Places,
    *,
    headings: int = 16,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Return the figures of pairs with any headings: with hypotheses of the heading, and without.

    Shares are of pairs found within 0.5 m and 1 deg; pairs of scans that cannot be read are not.
    """
    report = progress or (lambda stage, done, total: None)
    errors: dict[str, list[tuple[float, float]]] = {"": [], "plain_": []}
    count = len(places.pairs)
    report("any heading", 0, count)
    for number, pair in enumerate(places.pairs, 1):
        report("any heading", number, count)
        try:
            source, destination = _features(folder, estimator, pair)
        except DatasetError as error:
            _LOG.warning("any heading, pair %d failed: %s", number - 1, error)
            continue
        truth = _truth(places.poses, pair, folder.sensor.azimuths)
        found = estimator.estimate_any_heading(source, destination, headings=headings)
        errors[""].append(error_of(found, truth))
        errors["plain_"].append(error_of(estimator.estimate(source, destination), truth))
    figures: dict[str, Any] = {"pairs": count, "failed": count - len(errors[""]), "headings": headings}
    for name, each in errors.items():
        figures |= {f"{name}{key}": value for key, value in _figures(each, count).items()}
    return figures


def error_of(found: PairEstimate, truth: SE2) -> tuple[float, float]:
    """Return the errors of a motion: translation [m] and rotation, 0 or more [rad]."""
    turn = math.remainder(found.motion.yaw_rad - truth.yaw_rad, 2 * math.pi)
    return math.hypot(found.motion.x_m - truth.x_m, found.motion.y_m - truth.y_m), abs(turn)


def _features(
    folder: ScanFolder, estimator: ScanMatcher, pair: TurnedPair
) -> tuple[ScanFeatures, ScanFeatures]:
    source, destination = folder.read(pair.source), folder.read(pair.destination)
    rolled = np.roll(source.codes, pair.rows, axis=0)
    offset_m = folder.range_offset_m
    return (
        estimator.features(rolled, source.bin_m, range_offset_m=offset_m),
        estimator.features(destination.codes, destination.bin_m, range_offset_m=offset_m),
    )


def _truth(poses: NDArray[np.float64], pair: TurnedPair, rows: int) -> SE2:
    motion = SE2.from_array(relative(poses[pair.destination], poses[pair.source]))
    turn_rad = 2 * math.pi * pair.rows / rows
    return augmented_motion(motion, PairAugmentation(source_rotation_rad=turn_rad))


def _figures(errors: Sequence[tuple[float, float]], count: int) -> dict[str, float | None]:
    """Return the share of `count` pairs within bounds, and the medians of errors [m], [rad]."""
    off_m, off_deg = np.array(errors).reshape(-1, 2).T * [[1.0], [math.degrees(1)]]
    return {
        "within": float(((off_m <= WITHIN_M) & (off_deg <= WITHIN_DEG)).sum() / count),
        "translation_m_median": float(np.median(off_m)) if errors else None,
        "rotation_deg_median": float(np.median(off_deg)) if errors else None,
    }
