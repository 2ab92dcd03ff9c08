"""How a scan is traced; apart from the tracer, so that reading settings loads no ray tracer."""

import math
from dataclasses import dataclass

MOST_RAYS = 4096
"""The most rays of a row: a scan of a suburb takes 3.4 GB of memory with as many."""
FLOOR_DB = (-60.0, 60.0)
"""Where the floor may lie [dB]: further down nothing more would be found, further up nothing is left."""


@dataclass(frozen=True, kw_only=True)
class TraceSettings:
    """How finely and how far a scan is traced."""

    rays: int = 225
    """Rays of a row, a square number from 16 to 4096."""
    max_bounces: int = 3
    """Surfaces that a path may meet, out and back; 1 leaves direct echoes only."""
    floor_db: float = -6.0
    """Echoes weaker than this against the mean thermal noise are left out [dB, -60 to 60]."""

    def __post_init__(self) -> None:
        """Refuse settings that trace nothing, or more than memory holds."""
        side = math.isqrt(max(self.rays, 0))
        if side * side != self.rays or not 16 <= self.rays <= MOST_RAYS:
            raise ValueError(f"rays must be a square number from 16 to {MOST_RAYS}, got {self.rays}")
        if not 1 <= self.max_bounces <= 9:
            raise ValueError(f"max_bounces must be between 1 and 9, got {self.max_bounces}")
        if not FLOOR_DB[0] <= self.floor_db <= FLOOR_DB[1]:
            raise ValueError(
                f"floor_db must be between {FLOOR_DB[0]:g} and {FLOOR_DB[1]:g}, got {self.floor_db}"
            )
