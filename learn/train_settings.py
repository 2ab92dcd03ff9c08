"""How a model is trained: numbers of steps and pairs, the loss's weights, the rate, what is checked when.

Source: Barnes & Posner 2020, section IV (Adam, 1e-3, alpha = 10); gradients are clipped at a norm of 10.
"""

import math
from dataclasses import dataclass, field
from typing import Literal

import torch

from echoscape.learn.augment import TurnSettings
from echoscape.learn.loss import ALPHA_M
from echoscape.learn.model import Matching

DTYPES = {"float32": torch.float32, "bfloat16": torch.bfloat16}
"""Number formats by the names that settings have for them."""


@dataclass(frozen=True, kw_only=True)
class TrainSettings:
    """How a model is trained.

    seed: of all draws; steps: of Adam; pairs: a step and process; learning_rate: up to hold_steps, from there
    on halved every halve_steps (0: never), evenly; alpha_m: weight of rotation in the loss; match_weight: of
    the matches' own error in it (0: poses alone supervise), match_reach_m: beyond which an error teaches the
    weights no more; clip: largest norm of the gradients; match_stride: 2 searches every second pixel in
    training; network, products: number formats of the convolutions and of the matching's products; turns: of
    the pictures; gap_power: pairs g scans apart are drawn in proportion to g^-gap_power; validate_every,
    validate_pairs: steps between validations and pairs of one; log_every: steps averaged in a line of the
    log; save_every, save_minutes: between checkpoints; patience: validations without a better one after which
    training ends, 0 for never.
    """

    seed: int = 0
    steps: int = 30_000
    pairs: int = 1
    learning_rate: float = 1e-3
    hold_steps: int = 0
    halve_steps: int = 0
    alpha_m: float = ALPHA_M
    match_weight: float = 0.0
    match_reach_m: float = 5.0
    clip: float = 10.0
    match_stride: Literal[1, 2] = 2
    network: Literal["float32", "bfloat16"] = "bfloat16"
    products: Literal["float32", "bfloat16"] = "float32"
    turns: TurnSettings = field(default_factory=TurnSettings)
    gap_power: float = 0.0
    validate_every: int = 500
    validate_pairs: int = 64
    log_every: int = 20
    save_every: int = 500
    save_minutes: float = 10.0
    patience: int = 0

    def __post_init__(self) -> None:
        for name in ("steps", "pairs", "validate_every", "validate_pairs", "log_every", "save_every"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be 1 or more, got {getattr(self, name)}")
        for name in ("learning_rate", "alpha_m", "match_reach_m", "clip", "save_minutes"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"{name} must be finite and above 0, got {value}")
        for name in ("seed", "patience", "hold_steps", "halve_steps", "match_weight", "gap_power"):
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
