"""Folders that a command writes: checked before any work is done, and removed again where the work fails."""

import os
import shutil
from pathlib import Path

from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.files.metadata import FILE_NAME


def check_output_folder(out: Path, *, empty: bool = False, hint: str = "") -> None:
    """Refuse a place that cannot become, or is not, a folder to write to.

    Args:
        out: The folder, which need not exist yet.
        empty: Whether an existing folder must be empty.
        hint: What to say beside an error for a folder that is not empty.

    Raises:
        DatasetError: `out` or what it would lie in is a file, cannot be written to, or is not empty; the
            message names the place.
    """
    out = Path(out)
    place = next(folder for folder in (out, *out.absolute().parents) if folder.exists())
    if not place.is_dir():
        raise DatasetError(f"OUT must be a folder, {place} is a file")
    if not os.access(place, os.W_OK | os.X_OK):
        raise DatasetError(f"OUT cannot be made: {place} cannot be written to")
    if empty and out.is_dir() and any(out.iterdir()):
        raise DatasetError(f"OUT must be empty or new, {out} is not{f' ({hint})' if hint else ''}")


def check_no_dataset(out: Path, data: Path) -> None:
    """Refuse to write results into a data set.

    Args:
        out: The folder to write to, which need not exist yet.
        data: The data set that the results are of.

    Raises:
        DatasetError: `out` is `data`, or holds another data set of echoscape.
    """
    if out.resolve() == data.resolve() or (out / FILE_NAME).exists():
        raise DatasetError(f"OUT must not be a data set, {out} is one")


def make_output_folder(out: Path) -> list[Path]:
    """Make a folder and those that it lies in.

    Args:
        out: The folder.

    Returns:
        The folders that did not exist before, innermost first.

    Raises:
        OSError: A folder cannot be made.
    """
    made = [folder for folder in (out, *out.absolute().parents) if not folder.exists()]
    out.mkdir(parents=True, exist_ok=True)
    return made


def remove_output_folder(out: Path, made: list[Path]) -> None:
    """Undo `make_output_folder`: empty the folder, and remove those that were made for it.

    Args:
        out: The folder, which was empty or new; whatever it holds is removed.
        made: What `make_output_folder` returned; folders that others use by now stay.
    """
    for path in out.iterdir():
        shutil.rmtree(path) if path.is_dir() else path.unlink()
    for folder in made:
        try:
            folder.rmdir()
        except OSError:
            return
