"""Learned keypoint odometry as an `OdometryMethod`, with weights from a file.

Source: learn/odometry; this module chooses the solver and converts its results to eval/odometry/interface.py.
"""

from pathlib import Path
from typing import Any, Literal

from echoscape.eval.odometry.interface import MatchedPoints, PairFailed, PairMotion
from echoscape.learn.model.device import Device, resolve_device
from echoscape.learn.model.weights import load_weights
from echoscape.learn.odometry.keyframe_odometry import ROBUST_PAIRS, KeyframeOdometry, OdometryConfig
from echoscape.learn.odometry.paper_odometry import PaperOdometry
from echoscape.learn.odometry.scan_matcher import ScanMatcher, fast_config
from echoscape.sim.datasets.polar_scan import PolarScan

Solver = Literal["paper", "robust", "keyframe"]
"""How poses are solved, see `learned_odometry`."""


class LearnedOdometry:
    """Keypoints matched by descriptors, and the motion that fits the matches."""

    def __init__(self, odometry: KeyframeOdometry | PaperOdometry) -> None:
        """Wrap an odometry.

        Args:
            odometry: Finds motions; its state is the state of this method.
        """
        self.odometry = odometry

    @property
    def name(self) -> str:
        """Name of the method in results."""
        if isinstance(self.odometry, PaperOdometry):
            return "learned, paper"
        solver = ["robust"] if self.odometry.config == ROBUST_PAIRS else []
        compensation = [] if self.odometry.compensates else ["not compensated"]
        return ", ".join(["learned", *solver, *compensation])

    @property
    def matcher(self) -> ScanMatcher:
        """The matcher of any two scans.

        Raises:
            ValueError: The solver is that of the paper, which has none.
        """
        if isinstance(self.odometry, PaperOdometry):
            raise ValueError("solver must be robust or keyframe to match single pairs, got 'paper'")
        return self.odometry.matcher

    def start(self, scan: PolarScan) -> Any:
        """Begin a drive.

        Args:
            scan: The first scan.

        Returns:
            The state after it.
        """
        return self.odometry.start(scan)

    def follow(self, state: Any, scan: PolarScan) -> tuple[PairMotion, Any]:
        """Estimate the motion since the scan before.

        Args:
            state: The state after the scan before.
            scan: The next scan.

        Returns:
            The motion with its matches, and the state after the scan.

        Raises:
            PairFailed: The matches do not determine the motion.
        """
        found, after = self.odometry.follow(state, scan)
        if not found.certain:
            raise PairFailed("the matches do not determine the rotation: no weight, or all in one place")
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
        return motion, after


def learned_odometry(
    weights: Path,
    *,
    solver: Solver = "keyframe",
    device: Device = "auto",
    range_offset_m: float = 0.0,
    doppler_beta_s: float | None = None,
) -> LearnedOdometry:
    """Build the odometry with the weights in a file.

    Args:
        weights: File of weights.
        solver: paper: least squares of each pair by itself, every pixel searched, in float32, without
            compensation, as published. robust: each pair by itself, outliers weighted down. keyframe: robust,
            with the scan before and a keyframe together.
        device: Where to compute.
        range_offset_m: Added to the ranges of all bins [m], as in `ScanFolder`.
        doppler_beta_s: Range by which an approaching point appears too near, by its closing speed
            [m per m/s]; None takes points as measured. The solver of the paper always does.

    Returns:
        The odometry.

    Raises:
        DatasetError: The file is not a model.
        ValueError: The device is absent.
    """
    where = resolve_device(device)
    model, _ = load_weights(weights)
    if solver == "paper":
        return LearnedOdometry(PaperOdometry(model, device=where, range_offset_m=range_offset_m))
    matcher = ScanMatcher(model, fast_config(where), device=where, range_offset_m=range_offset_m)
    config = ROBUST_PAIRS if solver == "robust" else OdometryConfig()
    return LearnedOdometry(KeyframeOdometry(matcher, config, doppler_beta_s=doppler_beta_s))
