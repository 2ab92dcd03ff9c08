"""Odometry over a folder of scans: every pair in order, failures kept as results.

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

from echoscape.eval.odometry.interface import OdometryMethod, PairFailed, PairMotion, State
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.datasets.scan_folder import ScanFolder
from echoscape.sim.datasets.se2 import chain, from_world, relative

_LOG = logging.getLogger(__name__)
_SHORTEST_S = 1e-9

Progress = Callable[[str, int, int], None]
"""Called with a stage's name, how much of it is done, and how much there is."""


@dataclass(frozen=True, kw_only=True)
class Pair:
    """What became of a pair of successive scans.

    motion: of the later in the earlier one's frame, None where it failed; failure: why; matches: how many
    points it was made from, None where the estimator matches none; seconds: from the later scan in memory to
    the pose [s], a new beginning included where there is none.
    """

    motion: PairMotion | None
    failure: str | None
    matches: int | None
    seconds: float


@dataclass(frozen=True, kw_only=True)
class OdometryResult:
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
        return chain(self.motions)

    @cached_property
    def true_motions(self) -> NDArray[np.float64] | None:
        """True motions (N - 1, 3), NaN where unknown."""
        return None if self.truth is None else relative(self.truth[:-1], self.truth[1:])

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
    folder: ScanFolder, estimator: OdometryMethod[State], *, progress: Progress | None = None
) -> OdometryResult:
    """Return the odometry of a folder's scans.

    A scan that cannot be read or compared fails the pairs that it belongs to, and the run begins again after.

    Raises:
        DatasetError: the folder has fewer than two scans, or its truth cannot be read.
    """
    if len(folder) < 2:
        raise DatasetError(f"{folder.folder}: odometry needs 2 scans or more, found {len(folder)}")
    truth = folder.poses()
    walk = _Walk(folder, estimator)
    report = progress or (lambda stage, done, total: None)
    report("pairs", 0, len(folder) - 1)
    walk.begin(0, walk.read(0))
    pairs = []
    for index in range(1, len(folder)):
        pairs.append(walk.on(index))
        report("pairs", index, len(folder) - 1)
    return OdometryResult(
        method=estimator.name,
        names=tuple(int(stem) for stem in folder.stems),
        middle_us=_middles_us(folder.timestamps_us, walk.middles_us),
        pairs=tuple(pairs),
        truth=None if truth is None else from_world(truth),
    )


class _Walk(Generic[State]):
    """One pass over a folder; `middles_us` gathers mid-scan times, None of scans that cannot be read."""

    def __init__(self, folder: ScanFolder, estimator: OdometryMethod[State]) -> None:
        self._folder, self._estimator = folder, estimator
        self._state: State | None = None
        self._failure: str | None = None
        self.middles_us: list[int | None] = []

    def read(self, index: int) -> PolarScan | None:
        """Return scan `index`, or None and the failure of what it belongs to."""
        try:
            scan = self._folder.read(index)
        except DatasetError as error:
            self.middles_us.append(None)
            self._state, self._failure = None, str(error)
            return None
        self.middles_us.append((int(scan.timestamp_us[0]) + int(scan.timestamp_us[-1])) // 2)
        return scan

    def begin(self, index: int, scan: PolarScan | None) -> None:
        """Begin, or begin again, with scan `index`, if it could be read."""
        if scan is None:
            return
        try:
            self._state, self._failure = self._estimator.start(scan), None
        except PairFailed as error:
            self._state, self._failure = None, f"scan {self._folder.paths[index].name}: {error}"

    def on(self, index: int) -> Pair:
        """Go on to scan `index` and return what becomes of it and the one before."""
        before, failure = self._state, self._failure
        scan = self.read(index)
        start = time.perf_counter()
        motion = None
        if before is not None and scan is not None:
            motion, failure = self._motion(before, scan)
        if motion is None:
            self.begin(index, scan)
            failure = self._failure or failure
            _LOG.warning("pair %d failed: %s", index - 1, failure)
        matches = None if motion is None or motion.matches is None else len(motion.matches.weights)
        # Some hundred points a pair would fill the memory of a long drive.
        kept = None if motion is None else replace(motion, matches=None)
        return Pair(motion=kept, failure=failure, matches=matches, seconds=time.perf_counter() - start)

    def _motion(self, before: State, scan: PolarScan) -> tuple[PairMotion | None, str | None]:
        """Return the motion, or why there is none."""
        try:
            motion, state = self._estimator.follow(before, scan)
        except PairFailed as error:
            return None, str(error)
        if not motion.is_finite:
            return None, "the motion is not finite"
        self._state = state
        return motion, None


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
