"""Files that are whole or absent: each is written under a temporary name beside its place, then moved there.

A run that is killed at any moment leaves whole files and temporary ones, which the next run removes.
"""

import os
from pathlib import Path

_SUFFIX = ".part"


class DatasetError(ValueError):
    """A file or folder of a data set is not valid; the message names it."""


def write_atomic(path: Path, data: bytes) -> None:
    """Write a file so that it is never seen in part.

    Args:
        path: File to write.
        data: Its content.

    Raises:
        OSError: The folder cannot be written to.
    """
    temporary = temporary_beside(path)
    try:
        temporary.write_bytes(data)
        os.replace(temporary, path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def read_text(path: Path) -> str:
    """Read a text file.

    Args:
        path: The file.

    Returns:
        Its text.

    Raises:
        DatasetError: It is absent or no UTF-8 text; the message names it.
    """
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise DatasetError(f"{path}: cannot be read ({error})") from error


def temporary_beside(path: Path) -> Path:
    """Name the temporary file of this process for a file.

    Args:
        path: The file to be written.

    Returns:
        A path in the same folder.
    """
    return path.with_name(f".{path.name}.{os.getpid()}{_SUFFIX}")


def remove_temporaries(folder: Path) -> None:
    """Remove the temporary files that killed runs left.

    Args:
        folder: Searched with all its folders.
    """
    for path in folder.rglob(f".*{_SUFFIX}"):
        path.unlink(missing_ok=True)
