"""A training run's state on disk, so that a run that was stopped goes on to the same result.

Draws depend on the step alone, so the state is the model's, the optimiser's and the step: nothing else.
"""

import io
import pickle
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch

from echoscape.sim.whole_files import DatasetError, write_whole

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
