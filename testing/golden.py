"""Golden scans: what a test makes is compared with what it made when somebody looked at it and stored it.

A stored scan is a grey PNG file of its codes, an azimuth a row, which any viewer shows. Comparison is exact
unless a tolerance is given. A scan that differs leaves a figure of the difference beside the stored one.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.checks import check_kind, check_number, check_whole
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.testing.golden_file import Golden, GoldenError, read_golden, versions, write_golden

OTHER_VERSIONS: Mapping[str, float] = {"max_share": 1e-4, "max_codes": 6}
"""Tolerance for scans of other versions of NumPy and SciPy, which move 3e-5 of the cells by up to 6 codes."""

_NAME = re.compile(r"[\w][\w.-]*")
_LONGEST_NAME = 200
"""Length of a name for which files may still be named with ".difference.png" and a process [bytes]."""
_MORE = 3
"""Number of cells that a message shows."""


class GoldenScans:
    """Compares scans with the stored ones of a folder."""

    def __init__(
        self,
        folder: Path,
        *,
        test: str = "",
        update: bool = False,
        writers: dict[Path, str] | None = None,
    ) -> None:
        """Compare with the scans of a folder.

        `written` has the digests of the scans that were stored, by the path of the file.

        Args:
            folder: Folder of the stored scans; it need not exist.
            test: The test, as pytest names it on its command line, for messages.
            update: Whether scans that differ, or are not there, are stored instead.
            writers: Tests that have stored scans in this run, by the path of the file; extended.
        """
        self.folder = folder
        self.written: dict[Path, str] = {}
        self._test = test
        self._update = update
        self._writers = {} if writers is None else writers

    def check(
        self,
        scan: PolarScan | NDArray[np.uint8] | NDArray[np.bool_],
        name: str,
        *,
        max_share: float | None = None,
        max_codes: int | None = None,
    ) -> None:
        """Compare a scan with the stored one of a name.

        Without a limit every cell must be equal. With one, only what it limits counts; with both, both do.

        Args:
            scan: A scan, or an array (azimuths, bins) uint8 or bool that a test has made of one.
            name: Name of the stored scan within the folder: letters, digits, "_", "-" and ".", up to 200
                bytes of UTF-8.
            max_share: Largest share of cells that may differ [0 to 1].
            max_codes: Largest difference of a cell, a whole number [codes].

        Raises:
            AssertionError: The scan differs, or none is stored; the message says how, and how to store it.
            TypeError: `scan` or `name` is of another type.
            ValueError: `name` or a limit is not allowed.
        """
        __tracebackhide__ = True
        _check_name(name)
        _check_limits(max_share, max_codes)
        path, found = self.folder / f"{name}.png", _golden(scan)
        picture = path.with_suffix(".difference.png")
        if self._update and path not in self._writers:
            self._store(path, found)
            picture.unlink(missing_ok=True)
            return
        problem = self._problem(path, found, picture, max_share, max_codes)
        if problem:
            raise AssertionError(f"{problem}\n{self._advice(path)}")
        picture.unlink(missing_ok=True)

    def _store(self, path: Path, found: Golden) -> None:
        """Store a scan unless the stored one is equal."""
        try:
            if read_golden(path).same(found):
                return
        except (FileNotFoundError, GoldenError):
            pass
        write_golden(path, found)
        self._writers[path] = self._test
        self.written[path] = found.digest

    def _problem(
        self, path: Path, found: Golden, picture: Path, max_share: float | None, max_codes: int | None
    ) -> str:
        """Return what differs from the stored scan beyond the limits, "" where nothing does."""
        shown = path.relative_to(path.parents[2]) if len(path.parents) > 2 else path
        try:
            stored = read_golden(path)
        except FileNotFoundError:
            return f"there is no stored scan {shown}"
        except GoldenError as error:
            return f"the stored scan {shown} {error}"
        if stored.codes.shape != found.codes.shape:
            return f"the scan has shape {found.codes.shape}, {shown} has {stored.codes.shape}"
        if stored.mask != found.mask:
            kinds = "codes", "bool"
            return f"the scan is of {kinds[found.mask]}, {shown} of {kinds[stored.mask]}"
        if stored.axes != found.axes:
            return f"the scan has other axes than {shown}: {_changed(stored.axes, found.axes)}"
        lines = _cell_lines(stored, found, max_share, max_codes)
        if not lines:
            return ""
        return "\n  ".join(
            [
                f"the scan differs from {shown}",
                *lines,
                *_version_lines(stored),
                _drawn(picture, stored, found),
            ]
        )

    def _advice(self, path: Path) -> str:
        if path in self._writers:
            return f"it was stored in this run by {self._writers[path]}: each scan needs a name of its own"
        how = f'pytest "{self._test}" --radar-update-golden' if self._test else "update=True"
        return f"to store what the test makes now: {how}"


def _check_name(name: object) -> None:
    check_kind(str, name=name)
    if not _NAME.fullmatch(str(name)):
        raise ValueError(f"name must hold letters, digits, '_', '-' and '.' only, got {name!r}")
    size = len(str(name).encode())
    if size > _LONGEST_NAME:
        raise ValueError(f"name must have {_LONGEST_NAME} bytes of UTF-8 or fewer, got {size}: {name!r}")


def _check_limits(max_share: float | None, max_codes: int | None) -> None:
    if max_share is not None:
        check_number(max_share=max_share)
        if not 0 <= max_share <= 1:
            raise ValueError(f"max_share must be between 0 and 1, got {max_share}")
    if max_codes is not None:
        check_whole(max_codes=max_codes, least=None)
        if not 0 <= max_codes <= 255:
            raise ValueError(f"max_codes must be between 0 and 255, got {max_codes}")


def _golden(scan: Any) -> Golden:
    """Return what is stored of a scan or an array."""
    if isinstance(scan, PolarScan):
        axes = {
            "bin_m": scan.bin_m,
            "encoder_per_turn": scan.encoder_per_turn,
            "encoder": scan.encoder.tolist(),
        }
        return Golden(codes=scan.codes, axes=axes, versions=versions())
    array = np.asarray(scan)
    if array.ndim != 2 or array.size == 0 or array.dtype not in (np.dtype(np.uint8), np.dtype(np.bool_)):
        raise TypeError(
            "scan must be a PolarScan or an array (azimuths, bins) of uint8 or bool, "
            f"got {type(scan).__name__} of {array.dtype} and shape {array.shape}"
        )
    mask = array.dtype == np.bool_
    return Golden(codes=array.astype(np.uint8), axes={}, versions=versions(), mask=mask)


def _changed(stored: Mapping[str, Any], found: Mapping[str, Any]) -> str:
    """Return the entries in which two axes differ."""
    if not stored or not found:
        return "a scan and a plain array are not compared"
    names = [name for name in found if stored.get(name) != found[name]]
    told = [f"{name} was {stored.get(name)}, is {found[name]}" for name in names if name != "encoder"]
    return ", ".join([*told, *(["the encoder counts differ"] if "encoder" in names else [])])


def _cell_lines(stored: Golden, found: Golden, max_share: float | None, max_codes: int | None) -> list[str]:
    """Return lines about the cells that differ, none where they are within the limits."""
    change = found.codes.astype(np.int16) - stored.codes
    differ = np.argwhere(change)
    share, most = len(differ) / change.size, int(np.abs(change).max())
    limits = {"max_share": (max_share, share), "max_codes": (max_codes, most)}
    given = {name: (limit, value) for name, (limit, value) in limits.items() if limit is not None}
    if not len(differ) or (given and all(value <= limit for limit, value in given.values())):
        return []
    allowed = ", ".join(f"{name} {limit:g}" for name, (limit, _) in given.items()) or "no difference"
    lines = [
        f"{len(differ)} of {change.size} cells differ ({share:.2g})"
        + ("" if found.mask else f", by up to {most} codes ({most / 2:g} dB)"),
        f"allowed: {allowed}",
    ]
    bin_m = found.axes.get("bin_m")
    for row, column in differ[:_MORE]:
        at = "" if bin_m is None else f" ({(column + 0.5) * bin_m:.1f} m)"
        was, now = stored.codes[row, column], found.codes[row, column]
        lines.append(f"azimuth {row}, bin {column}{at}: {was} stored, {now} now")
    return [*lines, "..."] if len(differ) > _MORE else lines


def _version_lines(stored: Golden) -> list[str]:
    """Return a line on packages whose versions have changed since the scan was stored."""
    now = versions()
    others = [
        f"{name} {version}, now {now[name]}"
        for name, version in stored.versions.items()
        if now.get(name, version) != version
    ]
    if not others:
        return []
    limits = ", ".join(f"{name}={value:g}" for name, value in OTHER_VERSIONS.items())
    return [f"it was stored with {'; '.join(others)}; check(..., {limits}) allows for that"]


def _drawn(picture: Path, stored: Golden, found: Golden) -> str:
    """Write the figure of the difference and return a line that says where it is."""
    from echoscape.testing.golden_figure import write_difference

    try:
        write_difference(picture, stored, found)
    except OSError as error:
        return f"no figure was written: {error}"
    return f"figure: {picture}"
