"""Runs an odometry over a folder of scans: every pair in order; failed pairs are kept as results.

As in KISS-ICP (Vizzo et al., RA-L 2023) there is one pass, then metrics and files. A pair that fails counts
as no motion in the trajectory and in every metric; none is left out.
"""

import logging
import math
import statistics
import time
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Generic

import numpy as np
from numpy.typing import NDArray

from echoscape.eval.odometry.interface import OdometryMethod, PairFailed, PairMotion, State
from echoscape.scenes.core.progress import Progress
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.datasets.scan_folder import ScanFolder
from echoscape.sim.datasets.se2 import chain, from_world, relative

_LOG = logging.getLogger(__name__)
_MIN_SECONDS = 1e-9


@dataclass(frozen=True, kw_only=True)
class PairResult:
    """The result of a pair of successive scans.

    Attributes:
        motion: Pose of the later scan in the frame of the earlier one, None if the pair failed.
        failure: Why it failed, None if it did not.
        matches: Number of matched points, None if the method matches no points.
        seconds: Time from the later scan in memory to the pose, that of a new start included [s].
    """

    motion: PairMotion | None
    failure: str | None
    matches: int | None
    seconds: float


@dataclass(frozen=True, kw_only=True)
class WorstPair:
    """The worst pair of a run, by the largest translation error where the truth is known.

    Attributes:
        index: Number of the pair, from 0.
        motion: Its motion, with its matched points.
        criterion: Why it counts as the worst.
    """

    index: int
    motion: PairMotion
    criterion: str


@dataclass(frozen=True, kw_only=True)
class OdometryResult:
    """The odometry of N scans.

    Attributes:
        method: Name of the method.
        names: Numbers that name the scans' files (N,).
        middle_us: Time at mid-scan, to which poses refer (N,) int64 [us].
        pairs: Results of the N - 1 pairs.
        truth: True poses at mid-scan (N, 3): x, y [m], yaw [rad] in Oxford axes; NaN where unknown, None if
            the folder has none.
        worst: The worst pair that did not fail, None if all failed.
    """

    method: str
    names: tuple[int, ...]
    middle_us: NDArray[np.int64]
    pairs: tuple[PairResult, ...]
    truth: NDArray[np.float64] | None
    worst: WorstPair | None = None

    @cached_property
    def motions(self) -> NDArray[np.float64]:
        """Motions (N - 1, 3): x, y [m], yaw [rad]; 0 where a pair failed."""
        found = [
            (0.0, 0.0, 0.0)
            if pair.motion is None
            else (pair.motion.x_m, pair.motion.y_m, pair.motion.yaw_rad)
            for pair in self.pairs
        ]
        return np.array(found).reshape(-1, 3)

    @cached_property
    def poses(self) -> NDArray[np.float64]:
        """Poses (N, 3) in the frame of the first scan: x, y [m], yaw [rad]."""
        return chain(self.motions)

    @cached_property
    def true_motions(self) -> NDArray[np.float64] | None:
        """True motions (N - 1, 3): x, y [m], yaw [rad]; NaN where unknown."""
        return None if self.truth is None else relative(self.truth[:-1], self.truth[1:])

    @cached_property
    def failed(self) -> NDArray[np.bool_]:
        """Whether each pair failed (N - 1,)."""
        return np.array([pair.motion is None for pair in self.pairs], bool)

    @cached_property
    def known(self) -> NDArray[np.bool_]:
        """Whether the true pose of each scan is known (N,)."""
        if self.truth is None:
            return np.zeros(len(self.names), np.bool_)
        return ~np.isnan(self.truth).any(axis=1).reshape(-1)

    @property
    def pairs_per_s(self) -> float | None:
        """Pairs per second, from a scan in memory to its pose [1/s]; None if every pair failed.

        The first pair, which includes the start-up, counts only if it is the only one.
        """
        timed = [pair.seconds for pair in self.pairs if pair.motion is not None]
        timed = timed[1:] or timed
        return len(timed) / max(sum(timed), _MIN_SECONDS) if timed else None


def run_odometry(
    folder: ScanFolder, method: OdometryMethod[State], *, progress: Progress | None = None
) -> OdometryResult:
    """Run an odometry over the scans of a folder.

    A scan that cannot be read or compared fails the pairs that it belongs to, and the run starts again after
    it.

    Args:
        folder: The folder, with truth or without.
        method: The odometry.
        progress: Called as the work proceeds; its stage: pairs.

    Returns:
        The result of every pair.

    Raises:
        DatasetError: The folder has fewer than two scans, or its truth cannot be read.
    """
    if len(folder) < 2:
        raise DatasetError(f"{folder.folder}: odometry needs 2 scans or more, found {len(folder)}")
    world = folder.poses()
    truth = None if world is None else from_world(world)
    drive, worst = _Drive(folder, method), _WorstSoFar(truth)
    report = progress or (lambda stage, done, total: None)
    report("pairs", 0, len(folder) - 1)
    drive.start(0, drive.read(0))
    pairs = []
    for index in range(1, len(folder)):
        pair, motion = drive.step(index)
        pairs.append(pair)
        worst.update(index - 1, motion)
        report("pairs", index, len(folder) - 1)
    return OdometryResult(
        method=method.name,
        names=tuple(int(stem) for stem in folder.stems),
        middle_us=_middle_times_us(folder.timestamps_us, drive.middle_us),
        pairs=tuple(pairs),
        truth=truth,
        worst=worst.found,
    )


class _Drive(Generic[State]):
    """One pass over a folder; `middle_us` gathers mid-scan times, None for scans that cannot be read."""

    def __init__(self, folder: ScanFolder, method: OdometryMethod[State]) -> None:
        self._folder, self._method = folder, method
        self._state: State | None = None
        self._failure: str | None = None
        self.middle_us: list[int | None] = []

    def read(self, index: int) -> PolarScan | None:
        """Return scan `index`; if it cannot be read, None, and keep the error for the pairs that it fails."""
        try:
            scan = self._folder.read(index)
        except DatasetError as error:
            self.middle_us.append(None)
            self._state, self._failure = None, str(error)
            return None
        self.middle_us.append((int(scan.timestamp_us[0]) + int(scan.timestamp_us[-1])) // 2)
        return scan

    def start(self, index: int, scan: PolarScan | None) -> None:
        """Start, or start again, with scan `index`, if it could be read."""
        if scan is None:
            return
        try:
            self._state, self._failure = self._method.start(scan), None
        except PairFailed as error:
            self._state, self._failure = None, f"scan {self._folder.paths[index].name}: {error}"

    def step(self, index: int) -> tuple[PairResult, PairMotion | None]:
        """Process scan `index`; return the result of its pair, and the motion with its matched points."""
        before, failure = self._state, self._failure
        scan = self.read(index)
        begun = time.perf_counter()
        motion = None
        if before is not None and scan is not None:
            motion, failure = self._motion(before, scan)
        if motion is None:
            self.start(index, scan)
            failure = self._failure or failure
            _LOG.warning("pair %d failed: %s", index - 1, failure)
        pair = PairResult(
            # Without the matched points: some hundred a pair would fill the memory of a long drive.
            motion=None if motion is None else replace(motion, matches=None),
            failure=failure,
            matches=None if motion is None or motion.matches is None else len(motion.matches.weights),
            seconds=time.perf_counter() - begun,
        )
        return pair, motion

    def _motion(self, before: State, scan: PolarScan) -> tuple[PairMotion | None, str | None]:
        """Return the motion, or None and why there is none."""
        try:
            motion, state = self._method.follow(before, scan)
        except PairFailed as error:
            return None, str(error)
        if not motion.is_finite:
            return None, "the motion is not finite"
        self._state = state
        return motion, None


class _WorstSoFar:
    """Finds the worst pair of a run: by error with truth, else by match weight, else by motion."""

    def __init__(self, truth: NDArray[np.float64] | None) -> None:
        self._truth = truth
        self._rank: tuple[int, float] | None = None
        self.found: WorstPair | None = None

    def update(self, index: int, motion: PairMotion | None) -> None:
        """Consider pair `index`; failed pairs (None) have nothing to show."""
        if motion is None:
            return
        priority, value, criterion = self._ranked(index, motion)
        if self._rank is None or (priority, value) > self._rank:
            self._rank = (priority, value)
            self.found = WorstPair(index=index, motion=motion, criterion=criterion)

    def _ranked(self, index: int, motion: PairMotion) -> tuple[int, float, str]:
        """Return how bad a pair is: priority of the criterion, its value, and its name."""
        if self._truth is not None and np.isfinite(self._truth[index : index + 2]).all():
            true_x, true_y, _ = relative(self._truth[index], self._truth[index + 1]).tolist()
            return 2, math.hypot(motion.x_m - true_x, motion.y_m - true_y), "largest translation error"
        if motion.matches is not None:
            return 1, -float(motion.matches.weights.sum()), "lowest sum of match weights"
        return 0, math.hypot(motion.x_m, motion.y_m), "largest motion"


def _middle_times_us(names_us: NDArray[np.int64], middle_us: list[int | None]) -> NDArray[np.int64]:
    """Return mid-scan times (N,); where a scan could not be read, its name plus the others' median offset."""
    known = [
        middle - int(name) for middle, name in zip(middle_us, names_us, strict=True) if middle is not None
    ]
    offset = round(statistics.median(known)) if known else 0
    times = [
        int(name) + offset if middle is None else middle
        for middle, name in zip(middle_us, names_us, strict=True)
    ]
    return np.array(times, np.int64)
