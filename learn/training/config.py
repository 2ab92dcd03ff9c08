"""Settings of a training run: steps and pairs, weights of the losses, learning rate, validation and logging.

Source: Barnes & Posner 2020, section IV (Adam, 1e-3, alpha = 10); gradients are clipped at a norm of 10.
Imports no PyTorch, so that the command line can list the settings without it.
"""

import math
from dataclasses import dataclass, field
from typing import Literal

from echoscape.learn.data.augmentation import AugmentationConfig

ALPHA_M = 10.0
"""Weight of the rotation's error in the loss [m]."""

DTypeName = Literal["float32", "bfloat16"]
"""A number format by name."""


@dataclass(frozen=True, kw_only=True)
class TrainingConfig:
    """How a model is trained."""

    seed: int = 0
    """Seed of all random draws: first weights, pairs, augmentation."""
    steps: int = 30_000
    """Steps of Adam."""
    pairs: int = 1
    """Pairs of scans per step and process."""
    learning_rate: float = 1e-3
    """Adam's learning rate at the start."""
    lr_hold_steps: int = 0
    """Steps before the learning rate begins to fall."""
    lr_half_life: int = 0
    """Steps in which the learning rate then halves, exponentially; 0: it stays."""
    alpha_m: float = ALPHA_M
    """Weight of the rotation's error in the loss [m]."""
    robust_pose: bool = False
    """Solve the pose as inference does, outliers weighted down; without, by least squares of all matches."""
    match_weight: float = 0.0
    """Weight of the loss of the matches' distances [m/m]; 0: without."""
    likelihood_weight: float = 0.0
    """Weight of the negative log-likelihood of the keypoints' true places [m/nat]; 0: without."""
    score_weight: float = 0.0
    """Weight of the cross entropy between matches' weights and their correctness [m/nat]; 0: without."""
    score_scale_m: float = 1.0
    """Distance within which a match counts as correct, as a standard deviation [m]."""
    clip: float = 10.0
    """Largest norm of the gradients; longer ones are scaled down to it."""
    match_stride: Literal[1, 2] = 2
    """1 searches every pixel for matches in training, 2 the centre of each 2 x 2 block."""
    network_dtype: DTypeName = "bfloat16"
    """Number format of the convolutions."""
    matching_dtype: DTypeName = "float32"
    """Number format of the products of descriptors in matching."""
    augmentation: AugmentationConfig = field(default_factory=AugmentationConfig)
    """How images are rotated and shifted."""
    gap_power: float = 0.0
    """Pairs g scans apart are drawn in proportion to g^-gap_power; 0: all gaps alike."""
    compensate: bool = False
    """Move points to mid-scan and undo their Doppler shifts, by the true velocities, before the pose and the
    losses of matches."""
    validate_every: int = 500
    """Steps between validations."""
    validate_pairs: int = 64
    """Pairs of a validation."""
    log_every: int = 20
    """Steps whose mean makes a line of the log."""
    save_every: int = 500
    """Steps between checkpoints."""
    save_minutes: float = 10.0
    """Time after which a checkpoint is written earlier, single process only [min]."""
    patience: int = 0
    """Validations without improvement after which training ends; 0: never."""

    def __post_init__(self) -> None:
        for name in ("steps", "pairs", "validate_every", "validate_pairs", "log_every", "save_every"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be 1 or more, got {getattr(self, name)}")
        for name in ("learning_rate", "alpha_m", "score_scale_m", "clip", "save_minutes"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"{name} must be finite and above 0, got {value}")
        counts = ("seed", "patience", "lr_hold_steps", "lr_half_life")
        for name in (*counts, "match_weight", "likelihood_weight", "score_weight", "gap_power"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) >= 0):
                raise ValueError(f"{name} must be finite and 0 or more, got {getattr(self, name)}")

    def learning_rate_at(self, step: int) -> float:
        """Return the learning rate at a step: learning_rate 2^(-max(step - lr_hold_steps, 0) / lr_half_life).

        Args:
            step: Number of the step, from 0.

        Returns:
            The learning rate.
        """
        if self.lr_half_life == 0:
            return self.learning_rate
        return self.learning_rate * 0.5 ** (max(step - self.lr_hold_steps, 0) / self.lr_half_life)
