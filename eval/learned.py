"""The learned keypoint odometry as an estimator for judges and commands: weights from a file, then two calls.

Source: learn/inference.py; this page only turns its results into those of eval/estimator.py.
"""

from pathlib import Path

from echoscape import learn
from echoscape.eval.estimator import Matches, PairFailed, PairMotion
from echoscape.learn.inference import Estimator, ScanFeatures
from echoscape.learn.weights import read_weights
from echoscape.sim.polar_scan import PolarScan
from echoscape.sim.whole_files import DatasetError


def shipped_weights() -> Path | None:
    """Return the weights that came with the package, None where it came without."""
    found = sorted((Path(next(iter(learn.__path__))) / "weights_files").glob("*.safetensors"))
    return found[0] if found else None


class LearnedOdometry:
    """Keypoints once a scan, matched by descriptors, weighted least squares for the motion."""

    def __init__(self, estimator: Estimator, *, range_offset_m: float = 0.0) -> None:
        """Take a model; `range_offset_m` is what to add to the ranges of bins [m], as in `ScanFolder`."""
        self._estimator = estimator
        self._range_offset_m = range_offset_m

    @property
    def name(self) -> str:
        """What results are labelled with."""
        return "learned"

    def features(self, scan: PolarScan) -> ScanFeatures:
        """Return the scan's keypoints and maps."""
        return self._estimator.features(scan.codes, scan.bin_m, range_offset_m=self._range_offset_m)

    def motion(self, earlier: ScanFeatures, later: ScanFeatures) -> PairMotion:
        """Match the later scan's keypoints in the earlier one and return the motion.

        Raises:
            PairFailed: the matches do not determine the rotation.
        """
        found = self._estimator.estimate(later, earlier)
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


def learned_odometry(weights: Path | None = None, *, range_offset_m: float = 0.0) -> LearnedOdometry:
    """Return the odometry with the weights in a file, or with those that came with the package.

    Raises:
        DatasetError: the file is no weights, or none was named and none came along.
    """
    path = weights or shipped_weights()
    if path is None:
        raise DatasetError(
            "no weights came with this package: name a file with --weights, or take --method fourier"
        )
    model, _ = read_weights(path)
    return LearnedOdometry(Estimator(model), range_offset_m=range_offset_m)
