"""The state of a training run on disk, so that a run that was stopped is resumed to the same result.

Random draws depend on the step alone, so the state is that of the model, the optimiser and the step.
"""

import io
import pickle
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch

from echoscape.learn.model.fast_keypoint_model import FastKeypointModel
from echoscape.learn.model.model_settings import ModelSettings
from echoscape.learn.model.weights import load_weights
from echoscape.sim.datasets.files.atomic_write import DatasetError, write_atomic

FILE_NAME = "checkpoint.pt"


@dataclass(kw_only=True)
class RunState:
    """How far a run has come.

    Attributes:
        step: Steps done.
        best_m: Lowest validation loss so far [m].
        best_step: Step at which it was reached.
        seconds: Time taken so far [s].
        recent: Loss [m], errors of translation [m] and rotation [rad] of the steps since the last log entry.
    """

    step: int = 0
    best_m: float = float("inf")
    best_step: int = 0
    seconds: float = 0.0
    recent: list[tuple[float, float, float]] = field(default_factory=list)


@dataclass(frozen=True, kw_only=True)
class Checkpoint:
    """All that a run needs to be resumed.

    Attributes:
        settings: Settings of the run, as in its settings.json.
        state: How far it has come.
        model: State dictionary of the model.
        optimiser: State dictionary of the optimiser.
    """

    settings: dict[str, Any]
    state: RunState
    model: dict[str, Any]
    optimiser: dict[str, Any]


def write_checkpoint(folder: Path, checkpoint: Checkpoint) -> None:
    """Write a checkpoint, whole or not at all.

    Args:
        folder: Folder of the run.
        checkpoint: Its state, on any device.
    """
    buffer = io.BytesIO()
    torch.save({**vars(checkpoint), "state": vars(checkpoint.state)}, buffer)
    write_atomic(folder / FILE_NAME, buffer.getvalue())


def read_checkpoint(folder: Path) -> Checkpoint:
    """Read the checkpoint of a run; no code in the file is executed.

    Args:
        folder: Folder of the run.

    Returns:
        Its state, on the CPU whatever device wrote it; `load_state_dict` copies it to the device of a model.

    Raises:
        DatasetError: The file is absent or damaged; the message names it.
    """
    path = folder / FILE_NAME
    try:
        content = torch.load(path, map_location="cpu", weights_only=True)
        return Checkpoint(**{**content, "state": RunState(**content["state"])})
    except (OSError, RuntimeError, EOFError, KeyError, TypeError, pickle.UnpicklingError) as error:
        reason = (str(error) or type(error).__name__).splitlines()[0]
        raise DatasetError(f"{path}: cannot be read ({reason})") from error


def initial_model(settings: ModelSettings, *, seed: int) -> FastKeypointModel:
    """Make a model with random weights.

    Args:
        settings: Settings of the model.
        seed: Seed of the weights, which depend on nothing else: drawn on the CPU, they suit every device.

    Returns:
        The model, on the CPU.
    """
    with torch.random.fork_rng(devices=[]):
        torch.default_generator.manual_seed(int(np.random.SeedSequence([seed, 2]).generate_state(1)[0]))
        return FastKeypointModel(settings).to(memory_format=torch.channels_last)  # type: ignore[call-overload]


def load_initial_weights(model: FastKeypointModel, path: Path) -> dict[str, Any]:
    """Load the weights in a file into a model, whose images may have another resolution.

    Args:
        model: The model to be trained.
        path: File of weights.

    Returns:
        The record of their training, with the image settings under "image".

    Raises:
        DatasetError: The file is not a model, or one with other heads.
    """
    other, record = load_weights(path)
    try:
        model.load_state_dict(other.state_dict())
    except RuntimeError as error:
        raise DatasetError(f"{path}: has other heads than the model to be trained") from error
    return {**record, "image": asdict(other.settings.image)}
