"""How a scan is traced; apart from the tracer, so that reading settings loads no ray tracer."""

import math
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class TraceSettings:
    """How finely and how far a scan is traced."""

    rays: int = 256
    """Rays of a row, a square number."""
    max_bounces: int = 3
    """Surfaces that a path may meet, out and back; 1 leaves direct echoes only."""
    floor_db: float = -8.0
    """Echoes weaker than this against the mean thermal noise are left out [dB]."""

    def __post_init__(self) -> None:
        """Refuse settings that trace nothing."""
        side = math.isqrt(max(self.rays, 0))
        if side * side != self.rays or side < 4:
            raise ValueError(f"rays must be a square number of 16 or more, got {self.rays}")
        if not 1 <= self.max_bounces <= 9:
            raise ValueError(f"max_bounces must be between 1 and 9, got {self.max_bounces}")
        if not math.isfinite(self.floor_db):
            raise ValueError(f"floor_db must be finite, got {self.floor_db}")
