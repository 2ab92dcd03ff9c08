"""The learned keypoint odometry as an estimator for judges and commands: weights from a file, then a drive.

Source: learn/odometry/keyframe_odometry.py; this page only turns its results into those of eval/odometry/interface.py.
"""

from pathlib import Path

from echoscape.eval.odometry.interface import MatchedPoints, PairFailed, PairMotion
from echoscape.learn import model
from echoscape.learn.model.weights import read_weights
from echoscape.learn.odometry.keyframe_odometry import (
    PAIRS_ALONE,
    KeyframeOdometry,
    OdometryConfig,
    OdometryState,
    Scan,
)
from echoscape.learn.odometry.scan_matcher import ScanMatcher, quick_solving
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.polar_scan import PolarScan

_PREFIX = "keypoints_"


def shipped_weights() -> dict[float, Path]:
    """Return the files of weights that came with the package by their pixels' width [m], coarsest first."""
    folder = Path(next(iter(model.__path__))) / "weights_files"
    found = {float(path.stem.removeprefix(_PREFIX)): path for path in folder.glob(f"{_PREFIX}*.safetensors")}
    return dict(sorted(found.items(), reverse=True))


def chosen_weights(resolution_m: float | None = None) -> Path:
    """Return the shipped weights for pixels of a width [m], by default the coarsest, which are the fastest.

    Raises:
        DatasetError: none came along, or none for that width.
    """
    found = shipped_weights()
    if not found:
        raise DatasetError(
            "no weights came with this package: name a file with --weights, or take --method fourier"
        )
    if resolution_m is None:
        return next(iter(found.values()))
    if resolution_m not in found:
        raise DatasetError(f"resolution must be one of {', '.join(map(str, found))}, got {resolution_m}")
    return found[resolution_m]


class LearnedOdometry:
    """Keypoints matched by descriptors, weighted least squares for the motion: `KeyframeOdometry` on polar scans."""

    def __init__(self, follower: KeyframeOdometry, *, range_offset_m: float = 0.0) -> None:
        """Take a follower; range_offset_m: what to add to the ranges of bins [m], as in `ScanFolder`."""
        self.follower = follower
        self._range_offset_m = range_offset_m

    @property
    def name(self) -> str:
        """What results are labelled with."""
        alone = ["pairs alone"] if self.follower.settings == PAIRS_ALONE else []
        plain = [] if self.follower.compensates else ["not compensated"]
        return ", ".join(["learned", *alone, *plain])

    @property
    def estimator(self) -> ScanMatcher:
        """What finds the motion between any two scans."""
        return self.follower.estimator

    def start(self, scan: PolarScan) -> OdometryState:
        """Return the track of a drive that begins with a scan."""
        return self.follower.start(self._scan(scan))

    def follow(self, state: OdometryState, scan: PolarScan) -> tuple[PairMotion, OdometryState]:
        """Match the scan's keypoints in the scan before and in the keyframe, and return the motion.

        Raises:
            PairFailed: the matches do not determine the motion.
        """
        found, track = self.follower.follow(state, self._scan(scan))
        if not found.certain:
            raise PairFailed("the matches leave the rotation open: no weight, or all in one place")
        motion = PairMotion(
            x_m=found.motion.x_m,
            y_m=found.motion.y_m,
            yaw_rad=found.motion.yaw_rad,
            matches=MatchedPoints(
                earlier_m=found.destination_m.astype(float),
                later_m=found.source_m.astype(float),
                weights=found.weights.astype(float),
            ),
        )
        return motion, track

    def _scan(self, scan: PolarScan) -> Scan:
        first, last = (int(scan.timestamp_us[row]) for row in (0, -1))
        rows = len(scan.timestamp_us)
        return Scan(
            codes=scan.codes,
            bin_m=scan.bin_m,
            range_offset_m=self._range_offset_m,
            middle_s=(first + last) / 2e6,
            turn_s=(last - first) / 1e6 * rows / max(rows - 1, 1),
        )


def learned_odometry(
    weights: Path,
    *,
    range_offset_m: float = 0.0,
    doppler_beta_s: float | None = None,
    settings: OdometryConfig | None = None,
) -> LearnedOdometry:
    """Return the odometry with the weights in a file; for the other arguments see `KeyframeOdometry`.

    Raises:
        DatasetError: the file is no weights.
    """
    model, _ = read_weights(weights)
    follower = KeyframeOdometry(ScanMatcher(model, quick_solving()), settings, doppler_beta_s=doppler_beta_s)
    return LearnedOdometry(follower, range_offset_m=range_offset_m)
