"""A smooth map of the plane that bends straight streets into curved ones.

Streets are laid out as straight lines in the coordinates of the chart and mapped into the world.
"""

import numpy as np

from echoscape.scenes.core import portable_math
from echoscape.scenes.geometry.curves import Line, resampled, smallest_radius


class Chart:
    """A smooth, nearly area-preserving map of the plane: a swirl and three shear waves."""

    def __init__(
        self,
        *,
        half_size_m: tuple[float, float],
        swirl_rad: float,
        shear: float,
        wave_m: float,
        rng: np.random.Generator,
    ) -> None:
        """Draw the direction of the swirl and the waves.

        Args:
            half_size_m: Half the size of the area in x and y [m].
            swirl_rad: Rotation at the centre, relative to the edge [rad].
            shear: Sum of the greatest slopes of the waves.
            wave_m: Typical wavelength of the shear waves [m].
            rng: Random generator.
        """
        self._swirl_rad = swirl_rad * rng.choice([-1.0, 1.0])
        self._reach_m = 0.62 * min(half_size_m)
        angle = rng.uniform(0, np.pi) + np.arange(3) * np.pi / 3 + rng.uniform(-0.3, 0.3, 3)
        wave = wave_m * rng.uniform(0.8, 1.3, 3)
        self._waves = (2 * np.pi / wave)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        height = shear / 3 * wave / (2 * np.pi)
        self._sway_m = height[:, None] * np.stack([-np.sin(angle), np.cos(angle)], axis=-1)
        self._phase = rng.uniform(0, 2 * np.pi, 3)
        self._turn_rad = rng.uniform(0, np.pi)

    def __call__(self, points: Line) -> Line:
        """Map points from the chart into the world.

        Args:
            points: Points on the chart (..., 2) [m].

        Returns:
            Points in the world (..., 2) [m].
        """
        fall = portable_math.exp(-np.sum(points**2, axis=-1) / self._reach_m**2)
        angle = self._turn_rad + self._swirl_rad * fall
        cos, sin = np.cos(angle), np.sin(angle)
        x, y = points[..., 0], points[..., 1]
        places = np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)
        return places + np.sin(points @ self._waves.T + self._phase) @ self._sway_m


def chart_street(chart: Chart, start: Line, end: Line, *, bow: float = 0.0) -> Line:
    """Return a street that is straight on the chart, but for a sideways bow.

    The bow has the shape of sin^2, which keeps the directions at both ends; it is reduced where the radius
    would be below 60 m.

    Args:
        chart: The chart.
        start: Start on the chart (2,) [m].
        end: End on the chart (2,) [m].
        bow: Height of the bow as a share of the length.

    Returns:
        The street in the world (P, 2) [m].
    """
    share = np.linspace(0.0, 1.0, max(int(np.linalg.norm(end - start)), 12) + 1)[:, None]
    along = end - start
    aside = np.array([-along[1], along[0]]) * bow
    for flatter in (1.0, 0.6, 0.3, 0.0):
        line = chart(start + share * along + flatter * np.sin(np.pi * share) ** 2 * aside)
        if smallest_radius(line) > 60.0:
            break
    return resampled(line, 1.0)
