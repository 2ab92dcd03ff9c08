"""One smooth path along successive lanes: uniform arc length, continuous heading and curvature.

Centre lines are joined, resampled and smoothed by a Gaussian over travelled distance, which moves a bend of
curvature k inwards by k sigma^2 / 2 and leaves straight lines unchanged.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from echoscape.scenes.core.gaussian import gaussian_filter1d
from echoscape.scenes.core.headings import unwrapped_headings
from echoscape.scenes.core.lane_graph import Lane

CORNER_SIGMA_M = 1.0
"""Standard deviation of the Gaussian that smooths the corners of a vehicle's path [m]."""

_TRUNCATE = 4.0


@dataclass(frozen=True, kw_only=True)
class LanePath:
    """A smooth path as S samples at equal spacing.

    Attributes:
        step_m: Arc length between samples [m].
        xy: Positions (S, 2) [m].
        heading: Unwrapped heading (S,) [rad].
        curvature: Curvature (S,) [1/m], positive to the left.
        travel_m: Distance along the centre lines of the lanes, from the beginning of the first (S,) [m].
    """

    step_m: float
    xy: NDArray[np.float64]
    heading: NDArray[np.float64]
    curvature: NDArray[np.float64]
    travel_m: NDArray[np.float64]

    @property
    def length_m(self) -> float:
        """Arc length from first to last sample [m]."""
        return self.step_m * (len(self.xy) - 1)


def joined_line(lanes: Sequence[Lane], *, step_m: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Join the centre lines of successive lanes and resample them.

    Args:
        lanes: The lanes.
        step_m: Largest spacing of the samples [m].

    Returns:
        Distance along the lanes, at equal spacing (S,) [m], and points (S, 2) [m].
    """
    points = np.concatenate([lane.centre for lane in lanes])
    stretch = np.concatenate([[0.0], np.hypot(*np.diff(points, axis=0).T)])
    # The end of a lane is the beginning of the next; a gap between them adds no distance.
    firsts = np.cumsum([0] + [len(lane.centre) for lane in lanes[:-1]])
    stretch[firsts] = 0.0
    travel = np.cumsum(stretch)
    keep = np.concatenate([[True], np.diff(travel) > 1e-9])
    count = max(int(np.ceil(travel[-1] / step_m)), 4)
    uniform = np.linspace(0.0, travel[-1], count + 1)
    return uniform, np.stack(
        [np.interp(uniform, travel[keep], points[keep, axis]) for axis in (0, 1)], axis=-1
    )


def smoothed_line(points: NDArray[np.float64], *, sigma: float) -> NDArray[np.float64]:
    """Smooth a line by a Gaussian; its ends stay where they are.

    Args:
        points: Line (S, 2) [m].
        sigma: Standard deviation of the Gaussian [samples].

    Returns:
        The smoothed line (S, 2) [m].
    """
    pad = min(int(np.ceil(_TRUNCATE * sigma)), len(points) - 1)
    before = 2 * points[0] - points[pad:0:-1]
    after = 2 * points[-1] - points[-2 : -pad - 2 : -1]
    padded = np.concatenate([before, points, after])
    return gaussian_filter1d(padded, sigma, axis=0, mode="nearest", truncate=_TRUNCATE)[
        pad : pad + len(points)
    ]


def smooth_path(
    lanes: Sequence[Lane],
    *,
    from_m: float,
    step_m: float,
    sigma_m: float,
    wander_m: float,
    wander_length_m: float,
    rng: np.random.Generator,
) -> LanePath:
    """Return a smooth path along lanes with a slow lateral deviation.

    Args:
        lanes: The lanes.
        from_m: Distance into the first lane at which the path starts [m].
        step_m: Spacing of the samples [m].
        sigma_m: Standard deviation of the Gaussian that smooths corners [m].
        wander_m: Lateral deviation within the lane, rms [m].
        wander_length_m: Standard deviation of the Gaussian that correlates the lateral deviation [m].
        rng: Random generator.

    Returns:
        The path.
    """
    travel, line = joined_line(lanes, step_m=step_m)
    step = travel[1]
    smooth = smoothed_line(line, sigma=sigma_m / step)
    tangent = np.gradient(smooth, axis=0)
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=-1) / np.linalg.norm(tangent, axis=-1)[:, None]
    wander = slow_noise(len(travel), sigma=wander_length_m / step, rng=rng)
    return _uniform(travel, smooth + wander_m * wander[:, None] * normal, from_m=from_m, step_m=step_m)


def slow_noise(count: int, *, sigma: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return Gaussian noise of unit variance, correlated by a Gaussian kernel.

    Args:
        count: Number of samples.
        sigma: Standard deviation of the kernel [samples].
        rng: Random generator.

    Returns:
        Noise (count,).
    """
    pad = int(np.ceil(_TRUNCATE * sigma))
    white = rng.standard_normal(count + 2 * pad)
    smooth = gaussian_filter1d(white, sigma, truncate=_TRUNCATE)[pad : pad + count]
    # The kernel reduces the variance of white noise to 1 / (2 sqrt(pi) sigma).
    return smooth * np.sqrt(2 * np.sqrt(np.pi) * sigma)


def _uniform(
    travel: NDArray[np.float64], points: NDArray[np.float64], *, from_m: float, step_m: float
) -> LanePath:
    """Resample a line at equal arc length, with heading and curvature from a cubic spline."""
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    start = np.interp(from_m, travel, arc)
    at = np.arange(start, arc[-1], step_m)
    xy = CubicSpline(arc, points)
    first, second = xy(at, nu=1), xy(at, nu=2)
    speed2 = np.sum(first**2, axis=-1)
    return LanePath(
        step_m=step_m,
        xy=xy(at),
        heading=unwrapped_headings(first),
        curvature=(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / speed2**1.5,
        travel_m=np.interp(at, arc, travel),
    )
