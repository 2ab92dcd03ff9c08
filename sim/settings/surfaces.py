"""Roughness of all surfaces relative to the values of their materials; loads no ray tracer."""

import math
from dataclasses import dataclass, fields

MOST_FACTOR = 10.0
"""Largest allowed factor."""


@dataclass(frozen=True, kw_only=True)
class SurfaceSettings:
    """Factors on the roughness of all materials; 1 keeps the values of `scenes.core.materials`."""

    rms_height: float = 1.0
    """Factor on the small-scale rms height, which turns specular reflection into diffuse."""
    scattering: float = 1.0
    """Factor on the diffuse share of the reflected amplitude S, which stays below 1."""
    rms_slope: float = 1.0
    """Factor on the rms slope, which widens glints."""

    def __post_init__(self) -> None:
        """Refuse factors out of range, naming the factor."""
        for field in fields(self):
            value = getattr(self, field.name)
            if not (math.isfinite(value) and 0 < value <= MOST_FACTOR):
                raise ValueError(f"{field.name} must be above 0 and at most {MOST_FACTOR:g}, got {value}")
