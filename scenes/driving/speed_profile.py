"""Speed along a path: limits, bends, driver behaviour and stops, with smooth acceleration and braking.

The profile is the fastest below every cap within the available acceleration (forward and backward pass over
v^2, exact for constant acceleration); a Gaussian over time then bounds the jerk.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline
from scipy.ndimage import minimum_filter1d

from echoscape.scenes.core.checks import check_ascending, check_between
from echoscape.scenes.core.gaussian import gaussian_filter1d
from echoscape.scenes.driving.lane_path import slow_noise

_CRAWL_MPS = 0.3
_BEND_MARGIN_M = 1.0
_TRUNCATE = 4.0


@dataclass(frozen=True, kw_only=True)
class SpeedSettings:
    """Behaviour of the driver; the defaults give long town drives the speeds measured on the real car."""

    town_cruise_mps: tuple[float, float, float] = (2.6, 7.9, 11.0)
    """Triangular distribution (low, mode, high) of the speed in towns, drawn per stretch [m/s]."""
    stretch_m: float = 90.0
    """Mean length of a stretch, along which the driver behaves in the same manner [m]."""
    open_limit_mps: float = 17.0
    """Speed limit above which a road counts as outside towns [m/s]."""
    open_share: tuple[float, float] = (0.8, 1.0)
    """Speed outside towns relative to the limit (low, high), drawn per stretch [1]."""
    bend_mps2: tuple[float, float] = (0.9, 2.0)
    """Lateral acceleration in bends (low, high), drawn per stretch [m/s^2]."""
    yaw_rate_rps: tuple[float, float] = (0.26, 0.58)
    """Highest yaw rate in bends (low, high), drawn per stretch [rad/s]."""
    stop_chance: float = 0.42
    """Probability of a stop at the end of a street lane with right of way [0 to 1]."""
    yield_chance: float = 0.62
    """Probability of a stop at the end of a street lane that gives way [0 to 1]."""
    stop_s: float = 12.0
    """Mean duration of a stop, before it is clipped to its range [s]."""
    stop_range_s: tuple[float, float] = (2.0, 40.0)
    """Shortest and longest stop [s]."""
    speed_up_mps2: tuple[float, float] = (0.9, 2.7)
    """Acceleration (low, high), drawn per stretch [m/s^2]."""
    brake_mps2: tuple[float, float] = (0.9, 2.4)
    """Deceleration (low, high), drawn per stretch [m/s^2]."""
    smoothing_s: float = 0.35
    """Standard deviation of the Gaussian over time that bounds the jerk [s]."""
    unrest: float = 0.03
    """Slow variation of the desired speed, rms relative to that speed [1]."""
    unrest_length_m: float = 8.0
    """Correlation length of that variation, standard deviation of its Gaussian [m]."""

    def __post_init__(self) -> None:
        """Check the ranges of the fields.

        Raises:
            ValueError: A field is out of range or its values decrease; the message names it.
        """
        check_between(
            self,
            stretch_m=(1, 10_000),
            open_share=(0, 1),
            stop_chance=(0, 1),
            yield_chance=(0, 1),
            stop_range_s=(0, 3600),
            smoothing_s=(0.01, 10),
            unrest=(0, 0.3),
            unrest_length_m=(0.1, 1000),
        )
        check_ascending(
            self, "town_cruise_mps", "open_share", "bend_mps2", "yaw_rate_rps", "speed_up_mps2", "brake_mps2"
        )
        check_ascending(self, "stop_range_s", above_zero=False)


@dataclass(frozen=True, kw_only=True)
class Stops:
    """Where the car stops.

    Attributes:
        arc_m: Increasing arc lengths of the stops (N,) [m].
        dwell_s: Durations of the stops (N,) [s].
    """

    arc_m: NDArray[np.float64]
    dwell_s: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Timing:
    """Progress along a path at equal time steps.

    Attributes:
        time_s: Times (K,) [s].
        arc_m: Arc length (K,) [m].
        speed_mps: Speed (K,) [m/s].
    """

    time_s: NDArray[np.float64]
    arc_m: NDArray[np.float64]
    speed_mps: NDArray[np.float64]


def stretches(
    length_m: float, *, mean_m: float, rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Cut a length into random stretches.

    Args:
        length_m: Length [m].
        mean_m: Mean length of a stretch [m].
        rng: Random generator.

    Returns:
        Beginnings of the N stretches (N,) [m], and for each a random number in [0, 1) (N,).
    """
    count = int(2 * length_m / mean_m) + 16
    lengths = mean_m * (0.3 + 0.7 * rng.exponential(size=count))
    begins = np.concatenate([[0.0], np.cumsum(lengths)[:-1]])
    return begins, rng.random(count)


def speed_caps(
    curvature: NDArray[np.float64],
    limit_mps: NDArray[np.float64],
    *,
    step_m: float,
    settings: SpeedSettings,
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """Return the highest speed that the driver wants at each sample of a path.

    Args:
        curvature: Curvature of the path (S,) [1/m].
        limit_mps: Speed limit (S,) [m/s].
        step_m: Spacing of the samples [m].
        settings: Behaviour of the driver.
        rng: Random generator.

    Returns:
        Speeds (S,) [m/s].
    """
    arc = step_m * np.arange(len(curvature))
    begins, draw = stretches(arc[-1], mean_m=settings.stretch_m, rng=rng)
    place = np.searchsorted(begins, arc, side="right") - 1
    low, mode, high = settings.town_cruise_mps
    town = triangular_quantile(draw, low, mode, high)[place]
    share = np.interp(draw, [0.0, 1.0], settings.open_share)[place]
    cruise = np.where(limit_mps > settings.open_limit_mps, share * limit_mps, np.minimum(town, limit_mps))
    unrest = slow_noise(len(arc), sigma=settings.unrest_length_m / step_m, rng=rng)
    cruise = np.minimum(cruise * (1 + settings.unrest * unrest), limit_mps)
    bend = np.interp(rng.random(len(draw)), [0.0, 1.0], settings.bend_mps2)[place]
    yaw_rate = np.interp(rng.random(len(draw)), [0.0, 1.0], settings.yaw_rate_rps)[place]
    sharpness = np.maximum(np.abs(curvature), 1e-6)
    caps = np.minimum.reduce([cruise, np.sqrt(bend / sharpness), yaw_rate / sharpness])
    return minimum_filter1d(caps, 2 * int(_BEND_MARGIN_M / step_m) + 1)


def triangular_quantile(
    share: NDArray[np.float64], low: float, mode: float, high: float
) -> NDArray[np.float64]:
    """Return quantiles of the triangular distribution.

    Args:
        share: Probabilities (...) in [0, 1].
        low: Lower end of the distribution.
        mode: Its mode.
        high: Its upper end.

    Returns:
        Quantiles (...).
    """
    knee = (mode - low) / (high - low) if high > low else 0.0
    rising = low + np.sqrt(share * (high - low) * (mode - low))
    falling = high - np.sqrt((1 - share) * (high - low) * (high - mode))
    return np.where(share < knee, rising, falling)


def speed_profile(
    caps_mps: NDArray[np.float64],
    stops: Stops,
    *,
    step_m: float,
    settings: SpeedSettings,
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """Return the fastest speed below the caps that the accelerations allow; it is 0 at the stops.

    Args:
        caps_mps: Highest speed (S,) [m/s].
        stops: Stops along the path.
        step_m: Spacing of the samples [m].
        settings: Behaviour of the driver.
        rng: Random generator.

    Returns:
        Speeds (S,) [m/s].
    """
    arc = step_m * np.arange(len(caps_mps))
    square = caps_mps**2
    square[np.rint(stops.arc_m / step_m).astype(np.intp)] = 0.0
    begins, draw = stretches(arc[-1], mean_m=settings.stretch_m, rng=rng)
    draw = draw[np.searchsorted(begins, arc, side="right") - 1]
    for bounds, order in ((settings.speed_up_mps2, 1), (settings.brake_mps2, -1)):
        rise = np.cumsum(2 * step_m * np.interp(draw, [0.0, 1.0], bounds))
        rise = rise if order == 1 else -rise
        square = rise + np.minimum.accumulate((square - rise)[::order])[::order]
    return np.sqrt(np.maximum(square, 0.0))


def timing(
    speed_mps: NDArray[np.float64], stops: Stops, *, step_m: float, settings: SpeedSettings, clock_s: float
) -> Timing:
    """Convert a speed profile over arc length to progress over time, stops included.

    Args:
        speed_mps: Speed profile (S,) [m/s].
        stops: Stops along the path.
        step_m: Spacing of its samples [m].
        settings: Behaviour of the driver.
        clock_s: Time step [s].

    Returns:
        The progress at equal time steps.
    """
    arc = step_m * np.arange(len(speed_mps))
    pace = np.maximum(speed_mps[1:] + speed_mps[:-1], _CRAWL_MPS)
    clock = np.concatenate([[0.0], np.cumsum(2 * step_m / pace)])
    at = np.rint(stops.arc_m / step_m).astype(np.intp)
    wait = np.zeros(len(arc))
    wait[at] = stops.dwell_s
    arrive = clock + np.cumsum(wait) - wait
    knots = np.concatenate([arrive, arrive[at] + stops.dwell_s])
    order = np.argsort(knots, kind="stable")
    raw = CubicHermiteSpline(
        knots[order],
        np.concatenate([arc, arc[at]])[order],
        np.concatenate([speed_mps, speed_mps[at]])[order],
    )
    time = np.arange(0.0, knots.max(), clock_s)
    return _smoothed(time, raw(time), np.maximum(raw(time, nu=1), 0.0), sigma=settings.smoothing_s / clock_s)


def _smoothed(
    time: NDArray[np.float64], arc: NDArray[np.float64], speed: NDArray[np.float64], *, sigma: float
) -> Timing:
    """Smooth progress over time by a Gaussian of `sigma` samples."""
    # Before its first sample the car is taken to drive at its first speed; the caller cuts off the tail.
    pad = int(np.ceil(_TRUNCATE * sigma))
    lead = arc[0] - speed[0] * time[1] * np.arange(pad, 0, -1)
    arc = gaussian_filter1d(np.concatenate([lead, arc]), sigma, mode="nearest", truncate=_TRUNCATE)[pad:]
    speed = gaussian_filter1d(
        np.concatenate([np.full(pad, speed[0]), speed]), sigma, mode="nearest", truncate=_TRUNCATE
    )[pad:]
    return Timing(time_s=time, arc_m=arc - arc[0], speed_mps=speed)
