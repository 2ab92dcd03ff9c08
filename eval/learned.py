"""The learned keypoint odometry as an estimator for judges and commands: weights from a file, then two calls.

Source: learn/inference.py; this page only turns its results into those of eval/estimator.py.
"""

from dataclasses import dataclass
from pathlib import Path

from echoscape import learn
from echoscape.eval.estimator import Matches, PairFailed, PairMotion
from echoscape.learn.inference import Estimator, ScanFeatures, quick_solving
from echoscape.learn.rolling import Rolling
from echoscape.learn.weights import read_weights
from echoscape.sim.polar_scan import PolarScan
from echoscape.sim.whole_files import DatasetError

_PREFIX = "keypoints_"


def shipped_weights() -> dict[float, Path]:
    """Return the files of weights that came with the package by their pixels' width [m], coarsest first."""
    folder = Path(next(iter(learn.__path__))) / "weights_files"
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


@dataclass(frozen=True, kw_only=True)
class TimedFeatures:
    """What is kept of a scan, and when it was taken: its middle and how long a turn took [s]."""

    features: ScanFeatures
    middle_s: float
    turn_s: float


class LearnedOdometry:
    """Keypoints once a scan, matched by descriptors, weighted least squares for the motion."""

    def __init__(
        self, estimator: Estimator, *, range_offset_m: float = 0.0, doppler_beta_s: float | None = None
    ) -> None:
        """Take a model.

        range_offset_m: what to add to the ranges of bins [m], as in `ScanFolder`; doppler_beta_s: range by
        which what approaches appears too near, by its speed [m per m/s], to move points to mid-scan and rid
        them of Doppler shifts before the pose is solved (`learn.rolling`); None takes points as they are.
        """
        self.estimator = estimator
        self._range_offset_m, self._doppler_beta_s = range_offset_m, doppler_beta_s

    @property
    def name(self) -> str:
        """What results are labelled with."""
        return "learned" if self._doppler_beta_s is None else "learned, compensated"

    def features(self, scan: PolarScan) -> TimedFeatures:
        """Return the scan's keypoints and maps."""
        found = self.estimator.features(scan.codes, scan.bin_m, range_offset_m=self._range_offset_m)
        first, last = (int(scan.timestamp_us[row]) for row in (0, -1))
        rows = len(scan.timestamp_us)
        return TimedFeatures(
            features=found,
            middle_s=(first + last) / 2e6,
            turn_s=(last - first) / 1e6 * rows / max(rows - 1, 1),
        )

    def motion(self, earlier: TimedFeatures, later: TimedFeatures) -> PairMotion:
        """Match the later scan's keypoints in the earlier one and return the motion.

        Raises:
            PairFailed: the matches do not determine the rotation, or the times are none to compensate by.
        """
        found = self.estimator.estimate(later.features, earlier.features, self._rolling(earlier, later))
        if not found.certain:
            raise PairFailed("the matches leave the rotation open: no weight, or all in one place")
        return PairMotion(
            x_m=found.motion.x_m,
            y_m=found.motion.y_m,
            yaw_rad=found.motion.yaw_rad,
            matches=Matches(
                earlier_m=found.destination_m.astype(float),
                later_m=found.source_m.astype(float),
                weights=found.weights.astype(float),
            ),
        )

    def _rolling(self, earlier: TimedFeatures, later: TimedFeatures) -> Rolling | None:
        if self._doppler_beta_s is None:
            return None
        try:
            return Rolling(
                turn_s=later.turn_s,
                doppler_beta_s=self._doppler_beta_s,
                gap_s=later.middle_s - earlier.middle_s,
            )
        except ValueError as error:
            raise PairFailed(f"the scans' times leave nothing to compensate by: {error}") from error


def learned_odometry(
    weights: Path, *, range_offset_m: float = 0.0, doppler_beta_s: float | None = None
) -> LearnedOdometry:
    """Return the odometry with the weights in a file; for the other arguments see `LearnedOdometry`.

    Raises:
        DatasetError: the file is no weights.
    """
    model, _ = read_weights(weights)
    return LearnedOdometry(
        Estimator(model, quick_solving()), range_offset_m=range_offset_m, doppler_beta_s=doppler_beta_s
    )
