"""A training run's state on disk, so that a run that was stopped goes on to the same result.

Draws depend on the step alone, so the state is the model's, the optimiser's and the step: nothing else.
"""

import io
import pickle
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch

from echoscape.learn.model.keypoint_model import KeypointModel, ModelSettings
from echoscape.learn.model.weights import read_weights
from echoscape.sim.datasets.files.atomic_write import DatasetError, write_whole

FILE_NAME = "checkpoint.pt"


@dataclass(kw_only=True)
class Progress:
    """How far a run has come.

    step: steps done; best_m, best_step: lowest validation loss [m] and when; seconds: taken so far; recent:
    loss and errors of the steps since the last line of the log.
    """

    step: int = 0
    best_m: float = float("inf")
    best_step: int = 0
    seconds: float = 0.0
    recent: list[tuple[float, float, float]] = field(default_factory=list)


@dataclass(frozen=True, kw_only=True)
class Checkpoint:
    """What goes on: settings (told as a dictionary), progress, and the states that torch keeps."""

    settings: dict[str, Any]
    progress: Progress
    model: dict[str, Any]
    optimiser: dict[str, Any]


def write_checkpoint(folder: Path, checkpoint: Checkpoint) -> None:
    """Write a checkpoint into `folder`, whole or not at all."""
    buffer = io.BytesIO()
    torch.save({**vars(checkpoint), "progress": vars(checkpoint.progress)}, buffer)
    write_whole(folder / FILE_NAME, buffer.getvalue())


def read_checkpoint(folder: Path) -> Checkpoint:
    """Read the checkpoint in `folder`; no code in it is run.

    Raises:
        DatasetError: it is absent or damaged; the message names it.
    """
    path = folder / FILE_NAME
    try:
        content = torch.load(path, weights_only=True)
        return Checkpoint(**{**content, "progress": Progress(**content["progress"])})
    except (OSError, RuntimeError, EOFError, KeyError, TypeError, pickle.UnpicklingError) as error:
        reason = (str(error) or type(error).__name__).splitlines()[0]
        raise DatasetError(f"{path}: cannot be read ({reason})") from error


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
