"""Keypoints of single scans in metres, with scores and descriptors, from a trained model.

Source: Barnes & Posner 2020, section III-B: one keypoint in each cell of the image, at the mean of the cell
by a spatial softmax, with the score and the descriptor of that location.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray

from echoscape.learn.model.device import Device, resolve_device
from echoscape.learn.model.fast_keypoint_model import FastKeypointModel
from echoscape.learn.model.keypoint_model import KeypointModel
from echoscape.learn.model.weights import chosen_weights, load_weights
from echoscape.learn.odometry.scan_matcher import ScanFeatures, ScanMatcher
from echoscape.sim.datasets.array_record import ArrayRecord
from echoscape.sim.datasets.motion_compensation import to_mid_scan
from echoscape.sim.datasets.polar_scan import PolarScan


@dataclass(frozen=True, kw_only=True, eq=False)
class ScanKeypoints(ArrayRecord):
    """The N keypoints of a scan, one per cell of the image, row by row from the front left.

    Attributes:
        x_m: Forward of the radar (N,) float32 [m].
        y_m: To the right of the radar (N,) float32 [m].
        range_m: Range as measured (N,) float32 [m].
        azimuth_rad: Azimuth as measured, clockwise from ahead, 0 to 2 pi (N,) float32 [rad].
        score: Scores from 0 to 1 (N,) float32; 1 throughout without a score head.
        descriptor: Descriptors of unit length (N, D) float32; D is 248.
        score_map: Scores of every pixel of the image (size, size) float32, forward up (docs/conventions.md);
            None where it was not asked for.
        pixel_m: Width of a pixel of the image [m].
    """

    x_m: NDArray[np.float32]
    y_m: NDArray[np.float32]
    range_m: NDArray[np.float32]
    azimuth_rad: NDArray[np.float32]
    score: NDArray[np.float32]
    descriptor: NDArray[np.float32]
    score_map: NDArray[np.float32] | None
    pixel_m: float

    def __len__(self) -> int:
        """Return the number of keypoints."""
        return len(self.x_m)


class KeypointDetector:
    """Detects the keypoints of scans. Networks run in float32: the same scan gives the same keypoints."""

    def __init__(
        self,
        weights: Path | str | KeypointModel | FastKeypointModel | None = None,
        *,
        resolution_m: float | None = None,
        device: Device = "auto",
        range_offset_m: float = 0.0,
    ) -> None:
        """Load the network.

        Args:
            weights: File of weights, or a model; None takes bundled weights.
            resolution_m: Pixel width of the bundled weights [m]; None takes the coarsest, the fastest.
            device: Where to compute; auto takes a GPU where PyTorch finds one.
            range_offset_m: Offset to the ranges of bins [m], as in `open_folder(...).range_offset_m`.

        Raises:
            DatasetError: The file holds no weights, or none are bundled for that pixel width.
            ValueError: The device is absent, or `resolution_m` is given beside `weights`.
        """
        if weights is not None and resolution_m is not None:
            raise ValueError(f"resolution_m must be None beside weights, got {resolution_m}")
        if isinstance(weights, KeypointModel | FastKeypointModel):
            model = weights
        else:
            model, _ = load_weights(chosen_weights(resolution_m) if weights is None else Path(weights))
        self._matcher = ScanMatcher(model, device=resolve_device(device), range_offset_m=range_offset_m)

    @property
    def pixel_m(self) -> float:
        """Width of a pixel of the image [m]."""
        return self._matcher.model.settings.image.pixel_m

    def detect(
        self,
        scan: PolarScan,
        *,
        twist: ArrayLike | None = None,
        doppler_beta_s: float = 0.0,
        score_map: bool = False,
    ) -> ScanKeypoints:
        """Detect the keypoints of a scan.

        Without a twist, `x_m` and `y_m` are as measured: each in the frame of the car at the time of its
        azimuth. With one, all are in the frame of the car at mid-scan, where static objects are concerned.

        Args:
            scan: The scan.
            twist: Velocities of the car in its own frame: forward, right [m/s], clockwise [rad/s].
            doppler_beta_s: Range by which an approaching point appears too near, by its closing speed
                [m per m/s]; used with a twist only.
            score_map: Whether to return the scores of all pixels too.

        Returns:
            The keypoints.

        Raises:
            ValueError: The scan has no azimuths or bins, `twist` is not three finite numbers, or is given for
                a scan whose times are all the same.
        """
        features = self._matcher.features(scan)
        points_m = self._matcher.model.metres(features.keypoints.points_px)[0].cpu().numpy()
        x_m, y_m = points_m.T if twist is None else _at_mid_scan(points_m, scan, twist, doppler_beta_s).T
        return ScanKeypoints(
            x_m=x_m.astype(np.float32),
            y_m=y_m.astype(np.float32),
            range_m=np.hypot(*points_m.T),
            azimuth_rad=_azimuths(points_m),
            score=features.keypoints.scores[0].cpu().numpy(),
            descriptor=features.keypoints.descriptors[0].cpu().numpy(),
            score_map=self._score_map(features) if score_map else None,
            pixel_m=self.pixel_m,
        )

    def _score_map(self, features: ScanFeatures) -> NDArray[np.float32]:
        """Return the scores (size, size) without the margin that pads the image."""
        settings, scores = self._matcher.model.settings, features.destination.scores
        size = settings.image.size
        if scores is None:
            return np.ones((size, size), np.float32)
        margin = (settings.side - size) // 2
        inner = slice(margin, margin + size)
        return scores[0, 0, inner, inner].to(torch.float32).cpu().numpy()


def _azimuths(points_m: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return azimuths (N,) of points (N, 2) in [0, 2 pi) [rad]."""
    azimuth_rad = np.arctan2(points_m[:, 1], points_m[:, 0])
    full = np.float32(2 * np.pi)
    turned = np.where(azimuth_rad < 0, azimuth_rad + full, azimuth_rad)
    return np.where(turned < full, turned, np.float32(0)).astype(np.float32)


def _at_mid_scan(
    points_m: NDArray[np.float32], scan: PolarScan, twist: ArrayLike, doppler_beta_s: float
) -> NDArray[np.float64]:
    """Return points (N, 2) in the frame of the car at mid-scan [m]."""
    velocities = np.asarray(twist, np.float64)
    if velocities.shape != (3,) or not np.isfinite(velocities).all():
        raise ValueError(f"twist must be three finite numbers: forward, right, clockwise; got {twist!r}")
    if scan.revolution_s <= 0:
        raise ValueError(f"timestamp_us must increase over the scan for a twist, got {scan.revolution_s} s")
    return to_mid_scan(
        points_m.astype(np.float64),
        velocities,
        revolution_s=np.float64(scan.revolution_s),
        seam_rad=np.float64(scan.seam_rad),
        doppler_beta_s=np.float64(doppler_beta_s),
    )
