"""Odometry over a folder of scans: every scan described once, every pair in order, failures kept as results.

The run follows KISS-ICP's (Vizzo et al., RA-L 2023): one pass, then figures and files. A pair that fails
counts as no motion in the trajectory and in every figure; none is left out.
"""

import logging
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Generic

import numpy as np
from numpy.typing import NDArray

from echoscape.eval.estimator import Estimator, Features, PairFailed, PairMotion
from echoscape.eval.trajectories import between, chained, planar_of_world
from echoscape.sim.folders import ScanFolder
from echoscape.sim.whole_files import DatasetError

_LOG = logging.getLogger(__name__)
_SHORTEST_S = 1e-9

Progress = Callable[[str, int, int], None]
"""Called with a stage's name, how much of it is done, and how much there is."""


@dataclass(frozen=True, kw_only=True)
class Pair:
    """What became of a pair of successive scans.

    motion: of the later in the earlier one's frame, None where it failed; failure: why; matches: how many
    points it was made from, None where the estimator matches none; seconds: from the later scan in memory to
    the pose [s].
    """

    motion: PairMotion | None
    failure: str | None
    matches: int | None
    seconds: float


@dataclass(frozen=True, kw_only=True)
class Odometry:
    """The odometry of N scans.

    method: name of the estimator; names (N,): numbers that name the scans' files; middle_us (N,) int64:
    mid-scan, the time of a pose [us]; pairs: N - 1; truth (N, 3): true poses at mid-scan, x, y [m], yaw
    [rad] in Oxford axes, NaN where unknown, None where the folder has none.
    """

    method: str
    names: tuple[int, ...]
    middle_us: NDArray[np.int64]
    pairs: tuple[Pair, ...]
    truth: NDArray[np.float64] | None

    @cached_property
    def motions(self) -> NDArray[np.float64]:
        """Motions (N - 1, 3): x, y [m], yaw [rad]; none where a pair failed."""
        found = [
            (0.0, 0.0, 0.0)
            if pair.motion is None
            else (pair.motion.x_m, pair.motion.y_m, pair.motion.yaw_rad)
            for pair in self.pairs
        ]
        return np.array(found).reshape(-1, 3)

    @cached_property
    def poses(self) -> NDArray[np.float64]:
        """Poses (N, 3) in the frame of the first scan."""
        return chained(self.motions)

    @cached_property
    def true_motions(self) -> NDArray[np.float64] | None:
        """True motions (N - 1, 3), NaN where unknown."""
        return None if self.truth is None else between(self.truth[:-1], self.truth[1:])

    @cached_property
    def failed(self) -> NDArray[np.bool_]:
        """Whether each pair (N - 1,) failed."""
        return np.array([pair.motion is None for pair in self.pairs], bool)

    @cached_property
    def known(self) -> NDArray[np.bool_]:
        """Whether the true pose of each scan (N,) is known."""
        if self.truth is None:
            return np.zeros(len(self.names), np.bool_)
        return ~np.isnan(self.truth).any(axis=1).reshape(-1)

    @property
    def hz(self) -> float | None:
        """Pairs a second, from a scan in memory to its pose; None if no pair came to one.

        The first pair, which pays for the start, counts only where it is the only one.
        """
        timed = [pair.seconds for pair in self.pairs if pair.motion is not None]
        timed = timed[1:] or timed
        return len(timed) / max(sum(timed), _SHORTEST_S) if timed else None


def run_odometry(
    folder: ScanFolder, estimator: Estimator[Features], *, progress: Progress | None = None
) -> Odometry:
    """Return the odometry of a folder's scans.

    A scan that cannot be read or described fails the pairs that it belongs to, and the run goes on.

    Raises:
        DatasetError: the folder has fewer than two scans, or its truth cannot be read.
    """
    if len(folder) < 2:
        raise DatasetError(f"{folder.folder}: odometry needs 2 scans or more, found {len(folder)}")
    truth = folder.poses()
    walk = _Walk(folder, estimator)
    report = progress or (lambda stage, done, total: None)
    report("pairs", 0, len(folder) - 1)
    earlier = walk.described(0)
    pairs = []
    for index in range(1, len(folder)):
        later = walk.described(index)
        pairs.append(walk.pair(earlier, later, index))
        report("pairs", index, len(folder) - 1)
        earlier = later
    return Odometry(
        method=estimator.name,
        names=tuple(int(stem) for stem in folder.stems),
        middle_us=_middles_us(folder.timestamps_us, walk.middles_us),
        pairs=tuple(pairs),
        truth=None if truth is None else planar_of_world(truth),
    )


@dataclass(frozen=True, kw_only=True)
class _Described(Generic[Features]):
    """A scan's features, or why there are none; seconds: what they took."""

    features: Features | None
    failure: str | None
    seconds: float


class _Walk(Generic[Features]):
    """One pass over a folder; `middles_us` gathers mid-scan times, None of scans that cannot be read."""

    def __init__(self, folder: ScanFolder, estimator: Estimator[Features]) -> None:
        self._folder, self._estimator = folder, estimator
        self.middles_us: list[int | None] = []

    def described(self, index: int) -> _Described[Features]:
        """Read and describe scan `index`."""
        try:
            scan = self._folder.read(index)
        except DatasetError as error:
            self.middles_us.append(None)
            return _Described(features=None, failure=str(error), seconds=0.0)
        self.middles_us.append((int(scan.timestamp_us[0]) + int(scan.timestamp_us[-1])) // 2)
        start = time.perf_counter()
        try:
            features, failure = self._estimator.features(scan), None
        except PairFailed as error:
            features, failure = None, f"scan {self._folder.paths[index].name}: {error}"
        return _Described(features=features, failure=failure, seconds=time.perf_counter() - start)

    def pair(self, earlier: _Described[Features], later: _Described[Features], index: int) -> Pair:
        """Return what becomes of the scans `index` - 1 and `index`."""
        start = time.perf_counter()
        motion, failure = None, earlier.failure or later.failure
        if earlier.features is not None and later.features is not None:
            motion, failure = self._motion(earlier.features, later.features)
        seconds = later.seconds + time.perf_counter() - start
        if failure is not None:
            _LOG.warning("pair %d failed: %s", index - 1, failure)
        matches = None if motion is None or motion.matches is None else len(motion.matches.weights)
        # Some hundred points a pair would fill the memory of a long drive.
        kept = None if motion is None else replace(motion, matches=None)
        return Pair(motion=kept, failure=failure, matches=matches, seconds=seconds)

    def _motion(self, earlier: Features, later: Features) -> tuple[PairMotion | None, str | None]:
        """Return the motion, or why there is none."""
        try:
            motion = self._estimator.motion(earlier, later)
        except PairFailed as error:
            return None, str(error)
        return (motion, None) if motion.is_finite else (None, "the motion is not finite")


def _middles_us(names_us: NDArray[np.int64], middles_us: list[int | None]) -> NDArray[np.int64]:
    """Return mid-scan times (N,); where a scan could not be read, as far from its name as others' are."""
    known = [
        middle - int(name) for middle, name in zip(middles_us, names_us, strict=True) if middle is not None
    ]
    offset = round(statistics.median(known)) if known else 0
    times = [
        int(name) + offset if middle is None else middle
        for middle, name in zip(middles_us, names_us, strict=True)
    ]
    return np.array(times, np.int64)
