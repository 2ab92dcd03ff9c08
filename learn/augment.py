"""Turns for training, so that motions are found at any heading: both pictures together, then one by itself.

Source: loop closure in Barnes & Posner 2020, section V, meets places in any direction. Pictures are turned
when they are made (`image.Projector`), which costs no sharpness; the motion changes exactly.
"""

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, kw_only=True)
class PlaneMotion:
    """A pose T_destination_source, Oxford axes: x forward, y right [m], yaw clockwise [rad]."""

    x_m: float
    y_m: float
    yaw_rad: float


@dataclass(frozen=True, kw_only=True)
class TurnSettings:
    """How pairs are turned."""

    common: bool = True
    """Turn both pictures by a random heading."""
    largest_rad: float = math.pi
    """Largest turn of one picture against the other, either way [rad, 0 to pi]."""
    first_step: int = 2000
    """Step of training up to which neither picture is turned against the other."""
    full_step: int = 20_000
    """Step of training from which turns are up to the largest, after an even growth."""

    def __post_init__(self) -> None:
        if not 0 <= self.largest_rad <= math.pi:
            raise ValueError(f"largest_rad must be between 0 and pi, got {self.largest_rad}")
        if not 0 <= self.first_step < self.full_step:
            steps = f"{self.first_step} and {self.full_step}"
            raise ValueError(f"first_step must be 0 or more and below full_step, got {steps}")

    def bound_rad(self, step: int) -> float:
        """Return the largest relative turn at a step of training [rad]."""
        part = (step - self.first_step) / (self.full_step - self.first_step)
        return self.largest_rad * min(max(part, 0.0), 1.0)


@dataclass(frozen=True, kw_only=True)
class Turns:
    """What to turn pictures by, clockwise [rad]."""

    source_rad: float = 0.0
    destination_rad: float = 0.0


def drawn_turns(settings: TurnSettings, step: int, *, rng: np.random.Generator) -> Turns:
    """Draw the turns of a pair: a heading for both, uniform, and a turn of the source up to the bound."""
    common, relative = rng.uniform(-math.pi, math.pi), rng.uniform(-1, 1)
    common = common if settings.common else 0.0
    return Turns(source_rad=common + relative * settings.bound_rad(step), destination_rad=common)


def turned(motion: PlaneMotion, turns: Turns) -> PlaneMotion:
    """Return the motion between the turned pictures.

    With p_d = R p_s + t, and p_s, p_d turned by A and B: R becomes B R A^-1 and t becomes B t.
    """
    cosine, sine = math.cos(turns.destination_rad), math.sin(turns.destination_rad)
    yaw = motion.yaw_rad + turns.destination_rad - turns.source_rad
    return PlaneMotion(
        x_m=cosine * motion.x_m - sine * motion.y_m,
        y_m=sine * motion.x_m + cosine * motion.y_m,
        yaw_rad=math.remainder(yaw, 2 * math.pi),
    )
