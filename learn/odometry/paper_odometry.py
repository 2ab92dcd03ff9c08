"""The published odometry: each pair of successive scans by `KeypointModel`, and nothing else.

Source: Barnes & Posner 2020: every pixel is searched, in float32, and the pose is least squares of all
matches. Points are taken as measured, without compensation of motion or Doppler shifts; no match is
weighted down. The bundled weights were trained otherwise: with blurred pooling and true correspondences.
"""

import copy

import torch
from torch import Tensor

from echoscape.learn.data.image import image_of_codes
from echoscape.learn.model.keypoint_model import KeypointModel
from echoscape.learn.odometry.pair_estimate import PairEstimate, pair_estimate
from echoscape.sim.datasets.polar_scan import PolarScan


class PaperOdometry:
    """Odometry whose state is the image of the scan before."""

    def __init__(
        self, model: KeypointModel, *, device: torch.device | None = None, range_offset_m: float = 0.0
    ) -> None:
        """Take a copy of a model.

        Args:
            model: The model.
            device: Where to compute; None for where the model is.
            range_offset_m: Added to the ranges of all bins [m].
        """
        self.device = device or next(model.parameters()).device
        self.model = copy.deepcopy(model).eval().requires_grad_(False).to(self.device)
        self._range_offset_m = range_offset_m

    def image(self, scan: PolarScan) -> Tensor:
        """Make the image of a scan.

        Args:
            scan: The scan.

        Returns:
            The image (1, 1, size, size), on the device.

        Raises:
            ValueError: The scan has no azimuths or bins.
        """
        settings = self.model.settings.image
        image = image_of_codes(
            scan.codes,
            scan.bin_m,
            settings,
            first_rad=scan.first_azimuth_rad,
            range_offset_m=self._range_offset_m,
        )
        return image[None].to(self.device)

    def start(self, scan: PolarScan) -> Tensor:
        """Begin a drive.

        Args:
            scan: The first scan.

        Returns:
            Its image, the state of the drive.

        Raises:
            ValueError: The scan has no azimuths or bins.
        """
        return self.image(scan)

    @torch.inference_mode()
    def follow(self, state: Tensor, scan: PolarScan) -> tuple[PairEstimate, Tensor]:
        """Estimate the motion since the scan before.

        Args:
            state: Image of the scan before.
            scan: The next scan.

        Returns:
            The motion T_previous_scan with its matches, and the image of the scan.

        Raises:
            ValueError: The scan has no azimuths or bins.
        """
        image = self.image(scan)
        motion, matches = self.model(image, state)
        return pair_estimate(motion, matches, agreement=float(matches.weights.sum())), image
