"""Loop closure: how often the motion between scans of one place is found, whatever their headings.

Source: the loop closures of Barnes & Posner 2020, section V, which meet a place from any direction. Scans are
up to 5 m apart, and the source is rotated to a random heading by whole azimuths, which is exact.
"""

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from echoscape.learn.data.augmentation import PairAugmentation, augmented_motion
from echoscape.learn.odometry.pair_estimate import PairEstimate
from echoscape.learn.odometry.scan_matcher import ScanFeatures, ScanMatcher
from echoscape.scenes.core.progress import Progress
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.scan_folder import ScanFolder
from echoscape.sim.datasets.se2 import SE2, from_world, relative

_LOG = logging.getLogger(__name__)

MAX_DISTANCE_M = 5.0
"""Largest distance between the scans of a pair [m]."""
WITHIN_M, WITHIN_DEG = 0.5, 1.0
"""Errors up to which a motion counts as found [m], [deg]."""
_STAGE = 410
_BANDS = 5


@dataclass(frozen=True, kw_only=True)
class RotatedPair:
    """A pair of scans, the source rotated.

    Attributes:
        source: Index of the source.
        destination: Index of the destination.
        azimuths: Azimuths by which the source is rotated clockwise.
    """

    source: int
    destination: int
    azimuths: int


def rotated_pairs(
    poses: NDArray[np.float64], azimuths: int, count: int, *, seed: int = 0
) -> list[RotatedPair]:
    """Draw pairs of scans up to `MAX_DISTANCE_M` apart, evenly over distances and headings, in either order.

    Args:
        poses: Poses of the scans (N, 3): x, y [m], yaw [rad]; NaN where one is unknown.
        azimuths: Azimuths of a scan.
        count: Number of pairs.
        seed: Seed of the draw.

    Returns:
        The pairs.

    Raises:
        DatasetError: No two scans are that close.
    """
    known = np.flatnonzero(np.isfinite(poses).all(axis=1))
    near = known[KDTree(poses[known, :2]).query_pairs(MAX_DISTANCE_M, output_type="ndarray")]
    if len(near) == 0:
        raise DatasetError(f"loop closure: no two scans with known poses are within {MAX_DISTANCE_M:g} m")
    near = near[np.lexsort(near.T)]  # an order independent of how the tree was searched
    distance_m = np.hypot(*(poses[near[:, 0], :2] - poses[near[:, 1], :2]).T)
    band = np.minimum((distance_m * _BANDS / MAX_DISTANCE_M).astype(int), _BANDS - 1)
    bands = np.unique(band)
    rng = np.random.default_rng(np.random.SeedSequence([seed, _STAGE]))
    found = []
    for _ in range(count):
        of_band = np.flatnonzero(band == bands[rng.integers(len(bands))])
        pair = of_band[rng.integers(len(of_band))]
        source, destination = rng.permutation(near[pair]).tolist()
        rotation = int(rng.integers(azimuths))
        found.append(RotatedPair(source=source, destination=destination, azimuths=rotation))
    return found


@dataclass(frozen=True, kw_only=True)
class Places:
    """Pairs of scans of one place, and the true poses.

    Attributes:
        pairs: The pairs.
        poses: True poses of all scans (N, 3): x, y [m], yaw [rad].
    """

    pairs: list[RotatedPair]
    poses: NDArray[np.float64]


def places_of(folder: ScanFolder, pairs: int, *, seed: int = 0) -> Places:
    """Draw pairs of a folder's scans.

    Args:
        folder: The scans.
        pairs: Number of pairs.
        seed: Seed of the draw.

    Returns:
        The pairs and the true poses.

    Raises:
        DatasetError: The folder has no poses, or no two scans of one place.
    """
    world = folder.poses()
    if world is None:
        raise DatasetError(f"{folder.folder}: loop closure needs true poses, the folder has none")
    poses = from_world(world)
    return Places(pairs=rotated_pairs(poses, folder.sensor.azimuths, pairs, seed=seed), poses=poses)


def loop_closure_recall(
    folder: ScanFolder,
    matcher: ScanMatcher,
    places: Places,
    *,
    headings: int = 16,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Evaluate a matcher on pairs at random headings, with hypotheses of the heading and without.

    Args:
        folder: The scans.
        matcher: Estimates the motion of a pair.
        places: The pairs.
        headings: Number of heading hypotheses.
        progress: Called before every pair.

    Returns:
        Figures by name: numbers of pairs, of pairs that could not be read, and of headings; the share of
        pairs found within 0.5 m and 1 deg, and median errors [m], [deg]; under "plain_..." without
        hypotheses.
    """
    report = progress or (lambda stage, done, total: None)
    errors: dict[str, list[tuple[float, float]]] = {"": [], "plain_": []}
    count = len(places.pairs)
    report("any heading", 0, count)
    for number, pair in enumerate(places.pairs, 1):
        report("any heading", number, count)
        try:
            source, destination = _features(folder, matcher, pair)
        except DatasetError as error:
            _LOG.warning("loop closure, pair %d failed: %s", number - 1, error)
            continue
        truth = _truth(places.poses, pair, folder.sensor.azimuths)
        found = matcher.estimate_any_heading(source, destination, headings=headings)
        errors[""].append(error_of(found, truth))
        errors["plain_"].append(error_of(matcher.estimate(source, destination), truth))
    figures: dict[str, Any] = {"pairs": count, "failed": count - len(errors[""]), "headings": headings}
    for name, each in errors.items():
        figures |= {f"{name}{key}": value for key, value in _figures(each, count).items()}
    return figures


def error_of(found: PairEstimate, truth: SE2) -> tuple[float, float]:
    """Compute the error of a motion.

    Args:
        found: The estimate.
        truth: The true motion.

    Returns:
        Errors of the translation [m] and of the rotation [rad], 0 or more.
    """
    rotation_rad = math.remainder(found.motion.yaw_rad - truth.yaw_rad, 2 * math.pi)
    return math.hypot(found.motion.x_m - truth.x_m, found.motion.y_m - truth.y_m), abs(rotation_rad)


def _features(
    folder: ScanFolder, matcher: ScanMatcher, pair: RotatedPair
) -> tuple[ScanFeatures, ScanFeatures]:
    source, destination = folder.read(pair.source), folder.read(pair.destination)
    rotated = replace(source, codes=np.roll(source.codes, pair.azimuths, axis=0))
    return matcher.features(rotated), matcher.features(destination)


def _truth(poses: NDArray[np.float64], pair: RotatedPair, azimuths: int) -> SE2:
    motion = SE2.from_array(relative(poses[pair.destination], poses[pair.source]))
    rotation_rad = 2 * math.pi * pair.azimuths / azimuths
    return augmented_motion(motion, PairAugmentation(source_rotation_rad=rotation_rad))


def _figures(errors: Sequence[tuple[float, float]], count: int) -> dict[str, float | None]:
    """Return the share of `count` pairs within bounds, and the medians of errors [m], [deg]."""
    off_m, off_deg = np.array(errors).reshape(-1, 2).T * [[1.0], [math.degrees(1)]]
    return {
        "within": float(((off_m <= WITHIN_M) & (off_deg <= WITHIN_DEG)).sum() / count),
        "translation_m_median": float(np.median(off_m)) if errors else None,
        "rotation_deg_median": float(np.median(off_deg)) if errors else None,
    }
