"""Keypoints of Cen & Newman 2018: where the power of an azimuth is unlikely to be noise.

Source: Cen & Newman, "Precise Ego-Motion Estimation with Millimeter-Wave Radar Under Diverse and Challenging
Conditions", ICRA 2018, landmark extraction, as simplified by Burnett et al., "Do We Need to Compensate for
Motion Distortion and Doppler Effects in Spinning Radar Navigation?", RA-L 2021, with their settings: the
bias is the mean of the azimuth, the low-pass is Gaussian, and multipath is not removed.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from echoscape.eval.methods.keypoints import Keypoints, first_bin, keypoints_at
from echoscape.eval.methods.runs import Runs
from echoscape.sim.datasets.polar_scan import PolarScan

_HIGHEST_SCORE = 32.0
"""Scores above it count as it; those of a real scan reach 13."""


@dataclass(frozen=True, kw_only=True)
class Cen2018Settings:
    """How the signal of an azimuth is separated from its noise."""

    threshold: float = 3.0
    """z_q: least level of a keypoint, in standard deviations of the noise."""
    noise_factor: float = math.sqrt(2)
    """Standard deviation that is taken for the noise, over the root mean square of the values below the mean.
    For symmetric noise without echoes it would be 1."""
    smoothing_m: float = 0.7344
    """Standard deviation of the Gaussian low-pass along range [m]: 17 bins of 0.0432 m."""
    near_m: float = 2.5
    """Range below which there are no keypoints [m]: leakage and the car itself are there."""

    def __post_init__(self) -> None:
        if not 0 < self.threshold < _HIGHEST_SCORE:
            raise ValueError(f"threshold must be above 0 and below 32, got {self.threshold}")
        for name in ("noise_factor", "smoothing_m"):
            if not 0 < getattr(self, name) < math.inf:
                raise ValueError(f"{name} must be finite and above 0, got {getattr(self, name)}")
        if not 0 <= self.near_m < math.inf:
            raise ValueError(f"near_m must be finite and 0 or more, got {self.near_m}")


class Cen2018:
    """One keypoint in the middle of each run of bins whose signal exceeds the threshold."""

    name = "cen2018"
    score_name = "signal in standard deviations of the noise"
    score_limits = (0.0, _HIGHEST_SCORE)

    def __init__(self, settings: Cen2018Settings | None = None) -> None:
        """Take the settings.

        Args:
            settings: Thresholds and filters; None takes the published ones.
        """
        self.settings = settings or Cen2018Settings()

    def scores(self, scan: PolarScan) -> NDArray[np.float64]:
        """Score every cell.

        Args:
            scan: A scan.

        Returns:
            The signal of the cells in standard deviations of the noise, 0 to 32 (azimuths, bins); 0 nearer
            than `near_m`, and in azimuths that are all the same.
        """
        settings = self.settings
        level = signal_to_noise(
            scan.codes, smoothing_bins=settings.smoothing_m / scan.bin_m, noise_factor=settings.noise_factor
        )
        level[:, : first_bin(settings.near_m, scan.bin_m)] = 0
        return np.clip(level, *self.score_limits)

    def extract(self, scan: PolarScan, *, range_offset_m: float = 0.0) -> Keypoints:
        """Find the keypoints.

        Args:
            scan: A scan.
            range_offset_m: Offset to the ranges of bins [m], as in `ScanFolder`.

        Returns:
            The keypoints by azimuth, nearest first, with the highest score of their run.
        """
        scores = self.scores(scan)
        runs = Runs.of(scores > self.settings.threshold)
        highest = runs.reduce(np.maximum, scores)
        return keypoints_at(scan, runs.azimuth, runs.middle, highest, range_offset_m=range_offset_m)


def signal_to_noise(
    codes: NDArray[np.number], *, smoothing_bins: float, noise_factor: float
) -> NDArray[np.float64]:
    """Estimate the signal of every cell in standard deviations of the noise of its azimuth.

    The unbiased signal q is split into its low-pass p and the rest q - p. Each is weighted by the probability
    that it is not noise: y = (q - p) (1 - n(q - p)) + p (1 - n(p)), with n(v) = exp(-v^2 / 2 sigma^2).

    Args:
        codes: Power codes (azimuths, bins), in decibels or any other unit.
        smoothing_bins: Standard deviation of the low-pass [bins].
        noise_factor: sigma over the root mean square of the negative values of q.

    Returns:
        y / sigma (azimuths, bins); 0 in azimuths that are all the same.
    """
    power = codes.astype(np.float64)
    unbiased = power - power.mean(axis=1, keepdims=True)
    smooth = gaussian_filter1d(unbiased, smoothing_bins, axis=1, mode="mirror")
    sigma = noise_factor * noise_deviation(unbiased)[:, None]
    scale = np.divide(1.0, sigma, out=np.zeros_like(sigma), where=sigma > 0)
    return _unlike_noise((unbiased - smooth) * scale) + _unlike_noise(smooth * scale)


def noise_deviation(unbiased: NDArray[np.float64]) -> NDArray[np.float64]:
    """Estimate the noise of every azimuth from the values below its mean, where there are no echoes.

    Args:
        unbiased: Values about 0 (azimuths, bins).

    Returns:
        Root mean squares of the negative values (azimuths,), 0 where there are none.
    """
    negative = np.minimum(unbiased, 0.0)
    count = np.maximum((negative < 0).sum(axis=1), 1)
    return np.sqrt((negative**2).sum(axis=1) / count)


def _unlike_noise(deviations: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weight values in units of sigma by the probability that they are not noise."""
    return deviations * -np.expm1(-0.5 * deviations**2)
