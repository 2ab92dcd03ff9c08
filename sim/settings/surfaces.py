"""How rough the world is against the materials' own figures; apart, so that settings load no ray tracer."""

import math
from dataclasses import dataclass, fields

MOST_FACTOR = 10.0
"""The largest factor that makes a surface."""


@dataclass(frozen=True, kw_only=True)
class SurfaceSettings:
    """Factors on the roughness of all materials; 1 is what `scenes.core.materials` says."""

    rms_height: float = 1.0
    """Factor on the small-scale rms height, which turns mirror reflection into diffuse."""
    scattering: float = 1.0
    """Factor on the diffuse share of the reflected amplitude S, which stays below 1."""
    rms_slope: float = 1.0
    """Factor on the rms slope, which widens glints."""

    def __post_init__(self) -> None:
        """Refuse factors that make no surface, naming the factor."""
        for field in fields(self):
            value = getattr(self, field.name)
            if not (math.isfinite(value) and 0 < value <= MOST_FACTOR):
                raise ValueError(f"{field.name} must be above 0 and at most {MOST_FACTOR:g}, got {value}")
