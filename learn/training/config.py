"""How a model is trained: numbers of steps and pairs, the loss's weights, the rate, what is checked when.

Source: Barnes & Posner 2020, section IV (Adam, 1e-3, alpha = 10); gradients are clipped at a norm of 10.
"""

import math
from dataclasses import dataclass, field
from typing import Literal

import torch

from echoscape.learn.data.augmentation import TurnSettings
from echoscape.learn.model.keypoint_model import Matching
from echoscape.learn.training.losses import ALPHA_M

DTYPES = {"float32": torch.float32, "bfloat16": torch.bfloat16}
"""Number formats by the names that settings have for them."""


@dataclass(frozen=True, kw_only=True)
class TrainSettings:
    """How a model is trained."""

    seed: int = 0
    """Seed of everything that is drawn: first weights, pairs, turns."""
    steps: int = 30_000
    """Steps of Adam."""
    pairs: int = 1
    """Pairs of scans of a step, for each process."""
    learning_rate: float = 1e-3
    """Adam's learning rate at the start."""
    hold_steps: int = 0
    """Steps before the rate begins to fall."""
    halve_steps: int = 0
    """Steps in which the rate then halves, evenly; 0: never."""
    alpha_m: float = ALPHA_M
    """Weight of the rotation's error in the loss [m]."""
    robust_pose: bool = False
    """Solve the pose as inference does, matches that disagree weighed down; else by least squares of all."""
    match_weight: float = 0.0
    """Weight of the matches' own error in the loss [m/m]; 0: without."""
    likelihood_weight: float = 0.0
    """Weight of the surprisal of the keypoints' true places in the loss [m/nat]; 0: without."""
    score_weight: float = 0.0
    """Weight of the cross entropy between matches' weights and how right they are [m/nat]; 0: without."""
    score_scale_m: float = 1.0
    """How far off a match may be to count as right, as a standard deviation [m]."""
    clip: float = 10.0
    """Largest norm of the gradients; longer ones are shortened to it."""
    match_stride: Literal[1, 2] = 2
    """1 searches every pixel for matches in training, 2 every second a side."""
    network: Literal["float32", "bfloat16"] = "bfloat16"
    """Number format of the convolutions."""
    products: Literal["float32", "bfloat16"] = "float32"
    """Number format of the matching's products."""
    turns: TurnSettings = field(default_factory=TurnSettings)
    """How pictures are turned."""
    gap_power: float = 0.0
    """Pairs g scans apart are drawn in proportion to g^-gap_power; 0: all gaps alike."""
    compensate: bool = False
    """Move points to mid-scan and undo their Doppler shifts, by the true velocities, before poses are solved
    and errors are told."""
    validate_every: int = 500
    """Steps between validations."""
    validate_pairs: int = 64
    """Pairs of a validation."""
    log_every: int = 20
    """Steps whose mean makes a line of the log."""
    save_every: int = 500
    """Steps between checkpoints."""
    save_minutes: float = 10.0
    """Time after which a checkpoint is written sooner, single process only [min]."""
    patience: int = 0
    """Validations without a better one after which training ends; 0: never."""

    def __post_init__(self) -> None:
        for name in ("steps", "pairs", "validate_every", "validate_pairs", "log_every", "save_every"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be 1 or more, got {getattr(self, name)}")
        for name in ("learning_rate", "alpha_m", "score_scale_m", "clip", "save_minutes"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"{name} must be finite and above 0, got {value}")
        free = ("seed", "patience", "hold_steps", "halve_steps")
        for name in (*free, "match_weight", "likelihood_weight", "score_weight", "gap_power"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) >= 0):
                raise ValueError(f"{name} must be finite and 0 or more, got {getattr(self, name)}")

    def rate(self, step: int) -> float:
        """Return the learning rate at a step."""
        if self.halve_steps == 0:
            return self.learning_rate
        return self.learning_rate * 0.5 ** (max(step - self.hold_steps, 0) / self.halve_steps)

    @property
    def matching(self) -> Matching:
        """How matches are computed in training."""
        return Matching(stride=self.match_stride, dtype=DTYPES[self.products])
