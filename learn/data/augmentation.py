"""Rotations and shifts of the images of training pairs, so that no motion is likelier than another.

Source: loop closure in Barnes & Posner 2020, section V, meets places from any direction. Images are rotated
as they are made (`image.Projector`), which costs no sharpness; the motion between them changes exactly.
Shifts are ours: a car moves little between scans, so that a network learns to search where objects were in
the last image, and underestimates motions; randomly shifted images can only be matched by their content.
"""

import math
from dataclasses import dataclass

import numpy as np

from echoscape.sim.datasets.se2 import SE2


@dataclass(frozen=True, kw_only=True)
class AugmentationConfig:
    """Ranges of the random rotations and shifts of training pairs."""

    shared_rotation: bool = True
    """Rotate both images of a pair to one random heading."""
    max_rotation_rad: float = math.pi
    """Largest rotation of one image against the other, either way [rad, 0 to pi]."""
    ramp_start_step: int = 2000
    """Training step up to which no image is rotated against the other."""
    ramp_end_step: int = 20_000
    """Training step from which rotations reach their largest value, after a linear increase."""
    max_shift_m: float = 0.0
    """Largest shift of one image against the other, forward and right, either way [m]."""

    def __post_init__(self) -> None:
        if not 0 <= self.max_shift_m < math.inf:
            raise ValueError(f"max_shift_m must be finite and 0 or more, got {self.max_shift_m}")
        if not 0 <= self.max_rotation_rad <= math.pi:
            raise ValueError(f"max_rotation_rad must be between 0 and pi, got {self.max_rotation_rad}")
        if not 0 <= self.ramp_start_step < self.ramp_end_step:
            steps = f"{self.ramp_start_step} and {self.ramp_end_step}"
            raise ValueError(f"ramp_start_step must be 0 or more and below ramp_end_step, got {steps}")

    def rotation_limit_rad(self, step: int) -> float:
        """Return the largest relative rotation at a training step.

        Args:
            step: Number of the step, from 0.

        Returns:
            The limit [rad].
        """
        part = (step - self.ramp_start_step) / (self.ramp_end_step - self.ramp_start_step)
        return self.max_rotation_rad * min(max(part, 0.0), 1.0)


@dataclass(frozen=True, kw_only=True)
class PairAugmentation:
    """How the images of one pair are rotated and shifted.

    Attributes:
        source_rotation_rad: Clockwise rotation of the source's image about the radar [rad].
        destination_rotation_rad: The same for the destination's.
        source_shift_m: Shift of the source's image after its rotation: forward, right [m].
    """

    source_rotation_rad: float = 0.0
    destination_rotation_rad: float = 0.0
    source_shift_m: tuple[float, float] = (0.0, 0.0)

    @property
    def source_in_image(self) -> SE2:
        """Pose of the source scan in the frame of its image."""
        x_m, y_m = self.source_shift_m
        return SE2(x_m=x_m, y_m=y_m, yaw_rad=self.source_rotation_rad)

    @property
    def destination_in_image(self) -> SE2:
        """Pose of the destination scan in the frame of its image."""
        return SE2(x_m=0.0, y_m=0.0, yaw_rad=self.destination_rotation_rad)


def draw_augmentation(config: AugmentationConfig, step: int, *, rng: np.random.Generator) -> PairAugmentation:
    """Draw rotations and shift of a pair, each uniform in its range.

    Args:
        config: The ranges.
        step: Number of the training step, which limits the relative rotation.
        rng: Source of the draws.

    Returns:
        The augmentation.
    """
    shared, relative = rng.uniform(-math.pi, math.pi), rng.uniform(-1, 1)
    shared = shared if config.shared_rotation else 0.0
    shift = (0.0, 0.0)
    if config.max_shift_m > 0:
        forward, right = rng.uniform(-config.max_shift_m, config.max_shift_m, 2).tolist()
        shift = (forward, right)
    rotation = shared + relative * config.rotation_limit_rad(step)
    return PairAugmentation(
        source_rotation_rad=rotation, destination_rotation_rad=shared, source_shift_m=shift
    )


def augmented_motion(motion: SE2, augmentation: PairAugmentation) -> SE2:
    """Compute the motion between the augmented images of a pair.

    Args:
        motion: T_destination_source of the scans.
        augmentation: How their images are rotated and shifted.

    Returns:
        T_a_b = T_a_destination T_destination_source T_source_b of the images a of the destination and b of
        the source.
    """
    return augmentation.destination_in_image @ motion @ augmentation.source_in_image.inverse()
