"""The file of a golden scan: a grey PNG image of its codes, with its axes and the versions that made it."""

import hashlib
import io
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError
from PIL.PngImagePlugin import PngInfo

from echoscape.sim.datasets.files.atomic_write import write_atomic

_ENTRY = "echoscape"
_PACKAGES = ("echoscape", "numpy", "scipy", "mitsuba", "drjit")
"""Packages on which the last bits of a simulated scan depend."""


class GoldenError(ValueError):
    """A file holds no golden scan; the message says why and can follow the name of the file."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Golden:
    """What is stored of a scan.

    Attributes:
        codes: Codes (azimuths, bins) uint8; of a mask 0 and 1.
        axes: What its rows and columns mean, as JSON takes it; empty for an array that is no scan.
        versions: Versions of the packages that made it.
        mask: Whether it is an array of bool, which is stored in black and white.
    """

    codes: NDArray[np.uint8]
    axes: Mapping[str, Any]
    versions: Mapping[str, str]
    mask: bool = False

    @property
    def digest(self) -> str:
        """SHA-256 of codes and axes, equal where `same` holds."""
        meaning = json.dumps([self.codes.shape, self.mask, self.axes], sort_keys=True)
        return hashlib.sha256(meaning.encode() + np.ascontiguousarray(self.codes).tobytes()).hexdigest()

    def same(self, other: "Golden") -> bool:
        """Return whether codes and axes are equal, whatever made them."""
        alike = self.axes == other.axes and self.mask == other.mask
        return alike and np.array_equal(self.codes, other.codes)


@cache
def versions() -> dict[str, str]:
    """Return the versions of the packages on which simulated scans depend, as far as they are installed."""
    found = {}
    for name in _PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found


def write_golden(path: Path, golden: Golden) -> None:
    """Write a golden scan.

    Args:
        path: PNG file to write; its folder is made.
        golden: The scan.

    Raises:
        OSError: The file cannot be written.
    """
    info = PngInfo()
    text = json.dumps({"axes": golden.axes, "versions": golden.versions}, sort_keys=True)
    info.add_text(_ENTRY, text, zip=True)
    data = io.BytesIO()
    pixels = np.ascontiguousarray(golden.codes, np.bool_ if golden.mask else np.uint8)
    Image.fromarray(pixels).save(data, "png", optimize=True, pnginfo=info)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomic(path, data.getvalue())


def read_golden(path: Path) -> Golden:
    """Read a golden scan.

    Args:
        path: The PNG file.

    Returns:
        The scan.

    Raises:
        FileNotFoundError: There is no such file.
        GoldenError: The file cannot be read or holds no golden scan.
    """
    try:
        with Image.open(path) as image:
            image.load()
            mode, codes, text = image.mode, np.array(image), image.info.get(_ENTRY)
    except FileNotFoundError:
        raise
    except (OSError, SyntaxError, UnidentifiedImageError, ValueError) as error:
        raise GoldenError(f"cannot be read ({error})") from error
    try:
        content = json.loads(text or "")
        axes, made_by = dict(content["axes"]), dict(content["versions"])
    except (KeyError, TypeError, ValueError) as error:
        raise GoldenError("was not written by radar_golden") from error
    if mode not in ("L", "1"):
        raise GoldenError(f"must be a grey image of 8 bits or one of 1 bit, its mode is {mode}")
    return Golden(codes=codes.astype(np.uint8), axes=axes, versions=made_by, mask=mode == "1")
