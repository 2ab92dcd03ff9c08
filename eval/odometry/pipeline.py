"""Learned odometry for scans one after the other, simulated or real, without a folder.

    odometry = Odometry()
    for motion in odometry.run(scans):
        print(motion.x_m, motion.y_m, motion.yaw_rad)

`echoscape odometry` runs the same method on folders.
"""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from echoscape.eval.odometry.interface import PairMotion
from echoscape.eval.odometry.learned import Solver, learned_odometry
from echoscape.learn.model.device import Device
from echoscape.learn.model.weights import chosen_weights
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.sensor.sensor import Sensor


class Odometry:
    """Estimates the motion between successive scans by learned keypoints."""

    def __init__(
        self,
        weights: Path | None = None,
        *,
        resolution_m: float | None = None,
        solver: Solver = "keyframe",
        device: Device = "auto",
        sensor: Sensor = CTS350X,
        range_offset_m: float = 0.0,
        compensate: bool = True,
    ) -> None:
        """Load the network.

        Args:
            weights: File of weights; None takes bundled ones.
            resolution_m: Pixel width of the bundled weights [m]; None takes the coarsest, the fastest.
            solver: keyframe matches each scan with the one before and with a keyframe; robust solves each
                pair by itself; paper does so by least squares without compensation, as published.
            device: Where to compute; auto takes a GPU where PyTorch finds one.
            sensor: The radar, which gives the Doppler shift of ranges.
            range_offset_m: Offset to the ranges of bins [m], as in `ScanFolder`.
            compensate: Whether keypoints are moved to mid-scan and their Doppler shifts undone.

        Raises:
            DatasetError: The file holds no weights, or none are bundled for that pixel width.
            ValueError: The device is absent.
        """
        # Mean over azimuths: alternating chirps shift every other azimuth the other way, on average by 0.
        shift_s = -float(sensor.doppler_shift_s.mean()) if compensate else None
        self._method = learned_odometry(
            weights or chosen_weights(resolution_m),
            solver=solver,
            device=device,
            range_offset_m=range_offset_m,
            doppler_beta_s=shift_s,
        )

    def start(self, scan: PolarScan) -> Any:
        """Begin a drive.

        Args:
            scan: The first scan.

        Returns:
            What is kept of it for the next scan.
        """
        return self._method.start(scan)

    def follow(self, state: Any, scan: PolarScan) -> tuple[PairMotion, Any]:
        """Estimate the motion since the scan before.

        Args:
            state: What was kept of the scans before.
            scan: The next scan.

        Returns:
            The pose of the scan in the frame of the one before it (x forward, y right [m], yaw clockwise
            [rad], at mid-scan), and what is kept for the next one.

        Raises:
            PairFailed: The matches do not determine the motion.
        """
        return self._method.follow(state, scan)

    def run(self, scans: Iterable[PolarScan]) -> Iterator[PairMotion]:
        """Estimate the motions of a drive as its scans arrive.

        Args:
            scans: The scans in order of time, such as an opened folder.

        Yields:
            The motion of each scan but the first, as from `follow`.

        Raises:
            PairFailed: The matches of a pair do not determine its motion.
        """
        scans = iter(scans)
        first = next(scans, None)
        if first is None:
            return
        state = self.start(first)
        for scan in scans:
            motion, state = self.follow(state, scan)
            yield motion
