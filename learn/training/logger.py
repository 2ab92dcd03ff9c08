"""The log of a training run: a line of JSON per entry, and TensorBoard's files where it is installed.

Source: the JSON Lines format. The time that a run took is in its checkpoint, not here, so that logs of two
runs can be compared byte by byte.
"""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from echoscape.sim.datasets.files.atomic_write import DatasetError, read_text, write_atomic

LOG_FILE, BOARD_FOLDER = "log.jsonl", "tensorboard"

LogCallback = Callable[[dict[str, Any]], None]
"""Called with every entry of the log."""


class TrainingLog:
    """Log of a run; an entry holds numbers by name, or by two names, and the step."""

    def __init__(self, folder: Path, callback: LogCallback | None = None) -> None:
        """Prepare the log.

        Args:
            folder: Folder of the run.
            callback: Called with every entry that is added.
        """
        self._path, self._callback = folder / LOG_FILE, callback
        self._board_folder, self._board = folder / BOARD_FOLDER, None

    def begin(self, step: int) -> None:
        """Open the log, new or as it was after a step; later entries of a run that was stopped are dropped.

        Args:
            step: The last step whose entries are kept.

        Raises:
            DatasetError: A line but the last, which may have been cut short, is not an entry.
        """
        lines = read_text(self._path).splitlines(keepends=True) if self._path.exists() else []
        complete = [line.rstrip("\n") for line in lines if line.endswith("\n")]
        try:
            kept = [line for line in complete if json.loads(line)["step"] <= step]
        except (ValueError, KeyError, TypeError) as error:
            raise DatasetError(f"{self._path}: a line is not an entry of a log: {error}") from error
        write_atomic(self._path, "".join(f"{line}\n" for line in kept).encode())
        self._board = _board_writer(self._board_folder, step)

    def add(self, entry: dict[str, Any]) -> None:
        """Add an entry.

        Args:
            entry: Numbers by name, in groups where a value is a dictionary; "step" is the step.
        """
        with self._path.open("a") as log:
            log.write(json.dumps(entry) + "\n")
        if self._board is not None:
            for name, value in _flat(entry).items():
                self._board.add_scalar(name, value, entry["step"])
        if self._callback is not None:
            self._callback(entry)

    def end(self) -> None:
        """Write what TensorBoard still buffers."""
        if self._board is not None:
            self._board.close()


def _board_writer(folder: Path, step: int) -> Any:
    """Return TensorBoard's writer, or None where it is not installed."""
    try:
        from torch.utils.tensorboard import SummaryWriter
    except ImportError:
        return None
    return SummaryWriter(str(folder), purge_step=step + 1)


def _flat(entry: dict[str, Any]) -> dict[str, float]:
    """Return the numbers of an entry by name; those of the validation as validation/name."""
    found: dict[str, float] = {}
    for name, value in entry.items():
        if isinstance(value, dict):
            found |= {f"{name}/{inner}": number for inner, number in value.items()}
        elif name != "step":
            found[f"training/{name}"] = value
    return found
