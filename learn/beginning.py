"""What a training run begins with: weights that the seed draws, or those of a run before.

Source: numpy's SeedSequence: first weights have a stream of their own, so that no other draw changes them.
"""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch

from echoscape.learn.model import KeypointModel, ModelSettings
from echoscape.learn.weights import read_weights
from echoscape.sim.whole_files import DatasetError


def initial_model(settings: ModelSettings, *, seed: int) -> KeypointModel:
    """Return a model with its first weights, which depend on the seed alone."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(int(np.random.SeedSequence([seed, 2]).generate_state(1)[0]))
        return KeypointModel(settings).to(memory_format=torch.channels_last)  # type: ignore[call-overload]


def begin_with(model: KeypointModel, path: Path) -> dict[str, Any]:
    """Give a model the weights in a file and return the record of their training.

    Raises:
        DatasetError: the file is no model, or one with other heads.
    """
    other, record = read_weights(path)
    try:
        model.load_state_dict(other.state_dict())
    except RuntimeError as error:
        raise DatasetError(f"{path}: has other heads than the model to be trained") from error
    return {**record, "image": asdict(other.settings.image)}
