"""Files that are whole or absent: each is written under a temporary name beside its place, then moved there.

A run that is killed at any moment leaves whole files and temporaries, which the next run removes.
"""

import os
from pathlib import Path

_SUFFIX = ".part"


class DatasetError(ValueError):
    """A file or folder of a dataset is not what it should be; the message names it."""


def write_whole(path: Path, data: bytes) -> None:
    """Write `data` to `path`, so that the file is never seen in part.

    Raises:
        OSError: the folder cannot be written to.
    """
    temporary = temporary_beside(path)
    try:
        temporary.write_bytes(data)
        os.replace(temporary, path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def read_text(path: Path) -> str:
    """Return the text of a file.

    Raises:
        DatasetError: it is absent or no text; the message names it.
    """
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise DatasetError(f"{path}: cannot be read ({error})") from error


def temporary_beside(path: Path) -> Path:
    """Return the name under which this process prepares `path`."""
    return path.with_name(f".{path.name}.{os.getpid()}{_SUFFIX}")


def remove_temporaries(folder: Path) -> None:
    """Remove what killed runs left in `folder` and the folders in it."""
    for path in folder.rglob(f".*{_SUFFIX}"):
        path.unlink(missing_ok=True)
