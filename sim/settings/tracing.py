"""Settings of the ray tracer, apart from it, so that reading settings loads no ray tracer."""

from dataclasses import dataclass

MOST_RAYS = 4096
"""Most rays an azimuth: with these a scan of a suburb takes 3.4 GB of memory."""
FLOOR_DB = (-60.0, 60.0)
"""Limits of the floor [dB]: below nothing more is found, above nothing is left."""


@dataclass(frozen=True, kw_only=True)
class TraceSettings:
    """Number of rays and bounces, and the weakest echo that is kept."""

    rays: int = 512
    """Rays an azimuth, a power of two from 16 to 4096."""
    max_bounces: int = 3
    """Most surfaces that a path meets, out and back; 1 leaves direct echoes only."""
    floor_db: float = -6.0
    """Echoes weaker than this relative to the mean thermal noise are left out [dB, -60 to 60]."""
    draw: int = 0
    """Number of the draw of ray directions; world, speckle and receiver noise do not depend on it."""

    def __post_init__(self) -> None:
        """Refuse settings that trace nothing, or need more memory than machines have."""
        power_of_two = self.rays > 0 and self.rays & (self.rays - 1) == 0
        if not power_of_two or not 16 <= self.rays <= MOST_RAYS:
            raise ValueError(f"rays must be a power of two from 16 to {MOST_RAYS}, got {self.rays}")
        if not 1 <= self.max_bounces <= 9:
            raise ValueError(f"max_bounces must be between 1 and 9, got {self.max_bounces}")
        if self.draw < 0:
            raise ValueError(f"draw must be 0 or more, got {self.draw}")
        if not FLOOR_DB[0] <= self.floor_db <= FLOOR_DB[1]:
            raise ValueError(
                f"floor_db must be between {FLOOR_DB[0]:g} and {FLOOR_DB[1]:g}, got {self.floor_db}"
            )
