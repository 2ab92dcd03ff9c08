"""Turns and shifts for training, so that motions are found at any heading, and none is likelier than others.

Source: loop closure in Barnes & Posner 2020, section V, meets places in any direction. Pictures are turned
when they are made (`image.Projector`), which costs no sharpness; the motion changes exactly. Shifts are ours:
a car moves little between scans, so that a network learns to look where things have been, and finds motions
too short; once pictures are shifted at random, it has nothing to go by but what it sees.
"""

import math
from dataclasses import dataclass

import numpy as np

from echoscape.sim.datasets.se2 import SE2


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
    largest_shift_m: float = 0.0
    """Largest shift of one picture against the other, forward and right, either way [m]."""

    def __post_init__(self) -> None:
        if not 0 <= self.largest_shift_m < math.inf:
            raise ValueError(f"largest_shift_m must be finite and 0 or more, got {self.largest_shift_m}")
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
    """What to turn pictures by, clockwise [rad], and to shift the source's by then, forward and right [m]."""

    source_rad: float = 0.0
    destination_rad: float = 0.0
    shift_m: tuple[float, float] = (0.0, 0.0)

    @property
    def source_shown_at(self) -> SE2:
        """The pose of the source in the frame of its picture."""
        return SE2(x_m=self.shift_m[0], y_m=self.shift_m[1], yaw_rad=self.source_rad)

    @property
    def destination_shown_at(self) -> SE2:
        """The same of the destination."""
        return SE2(x_m=0.0, y_m=0.0, yaw_rad=self.destination_rad)


def drawn_turns(settings: TurnSettings, step: int, *, rng: np.random.Generator) -> Turns:
    """Draw the turns of a pair: a heading for both, a turn and a shift of the source; all are uniform."""
    common, relative = rng.uniform(-math.pi, math.pi), rng.uniform(-1, 1)
    common = common if settings.common else 0.0
    shift = (0.0, 0.0)
    if settings.largest_shift_m > 0:
        forward, right = rng.uniform(-settings.largest_shift_m, settings.largest_shift_m, 2).tolist()
        shift = (forward, right)
    turn = common + relative * settings.bound_rad(step)
    return Turns(source_rad=turn, destination_rad=common, shift_m=shift)


def turned(motion: SE2, turns: Turns) -> SE2:
    """Compute the motion between turned and shifted images of a pair.

    Args:
        motion: T_destination_source of the scans.
        turns: How their images are turned and shifted.

    Returns:
        T_a_d T_d_s T_s_b of the images a of the destination and b of the source.
    """
    return turns.destination_shown_at @ motion @ turns.source_shown_at.inverse()
