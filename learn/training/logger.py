"""The log of a training run: a line of JSON whenever there is news, and TensorBoard's where it is installed.

Source: the JSON Lines format. The time that a run took stands in its checkpoint, not here, so that logs of
two runs can be compared byte by byte.
"""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from echoscape.sim.datasets.files.atomic_write import DatasetError, read_text, write_whole

LOG_FILE, BOARD_FOLDER = "log.jsonl", "tensorboard"

Report = Callable[[dict[str, Any]], None]
"""Told of every line of the log."""


class TrainingLog:
    """Takes the lines of a run: numbers by name, or by name and name, and the step."""

    def __init__(self, folder: Path, report: Report | None = None) -> None:
        """Log into `folder`, and tell `report`."""
        self._path, self._report = folder / LOG_FILE, report
        self._board_folder, self._board = folder / BOARD_FOLDER, None

    def begin(self, step: int) -> None:
        """Open the log, new or as it was after `step`; what a stopped run logged later is dropped.

        Raises:
            DatasetError: a line but the last, which may have been cut short, is none of a log.
        """
        lines = read_text(self._path).splitlines(keepends=True) if self._path.exists() else []
        whole = [line.rstrip("\n") for line in lines if line.endswith("\n")]
        try:
            kept = [line for line in whole if json.loads(line)["step"] <= step]
        except (ValueError, KeyError, TypeError) as error:
            raise DatasetError(f"{self._path}: holds a line that is none of a log: {error}") from error
        write_whole(self._path, "".join(f"{line}\n" for line in kept).encode())
        self._board = _writer(self._board_folder, step)

    def add(self, line: dict[str, Any]) -> None:
        """Add a line."""
        with self._path.open("a") as log:
            log.write(json.dumps(line) + "\n")
        if self._board is not None:
            for name, value in _flat(line).items():
                self._board.add_scalar(name, value, line["step"])
        if self._report is not None:
            self._report(line)

    def end(self) -> None:
        """Write what TensorBoard still holds back."""
        if self._board is not None:
            self._board.close()


def _writer(folder: Path, step: int) -> Any:
    """Return TensorBoard's writer, or None where it is not installed."""
    try:
        from torch.utils.tensorboard import SummaryWriter
    except ImportError:
        return None
    return SummaryWriter(str(folder), purge_step=step + 1)


def _flat(line: dict[str, Any]) -> dict[str, float]:
    """Return the numbers of a line by name; those of the validation as validation/name."""
    found: dict[str, float] = {}
    for name, value in line.items():
        if isinstance(value, dict):
            found |= {f"{name}/{inner}": number for inner, number in value.items()}
        elif name != "step":
            found[f"training/{name}"] = value
    return found
