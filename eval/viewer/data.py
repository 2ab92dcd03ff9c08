"""What a page needs to step through a data set: scans and truth made small, the plan, the drive, the boxes.

A row of a scan is cut into groups of bins; each is shown as its strongest cell, code and truth.
"""

import io
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from echoscape.eval.figures.style import COMPONENT_COLOURS, THINGS, drive_window
from echoscape.eval.figures.town_plan import Window, plan_picture
from echoscape.eval.viewer.mover_boxes import Box, observed_boxes
from echoscape.eval.viewer.source import Motion, Pose, Source, open_source
from echoscape.sim.datasets.polar_scan import CellTruth, PolarScan, ScanTruth
from echoscape.sim.datasets.se2 import relative_from_world

Progress = Callable[[str, int, int], None]

_CODE_QUALITY = 80
_PLAN_QUALITY = 70
_PLAN_PIXELS = 800
_MOST_BOUNCES = 15
"""What four bits hold."""
_OTHER_COLOUR = "#e8ecf1"


@dataclass(frozen=True, kw_only=True)
class Shown:
    """One scan of the page.

    number: its place in the data set; codes: grey WebP (azimuths, columns); labels: lossless WebP of the same
    size, red component + 16 bounces, green class, blue moving, None without truth; motion since the scan
    before, speed [m/s], yaw_rate [rad/s] clockwise: None where unknown; clipped: rows in which the converter
    clipped; first_m: by row, None where nothing was met.
    """

    number: int
    stamp_us: int
    codes: bytes
    labels: bytes | None
    pose: Pose | None
    motion: Motion | None
    speed: float | None
    yaw_rate: float | None
    clipped: list[int]
    first_m: list[float | None]
    boxes: list[Box]


@dataclass(frozen=True, kw_only=True)
class View:
    """All that a page shows.

    Drawn cell k of a row is centred at (k + 1/2) cell_m + offset_m [m]; total: scans in the data set;
    absolute: whether the plan's world has its north upwards; components, classes, groups: name, colour;
    window, plan (WebP), path: None where unknown.
    """

    title: str
    sensor: str
    azimuths: int
    columns: int
    cell_m: float
    offset_m: float
    total: int
    has_truth: bool
    absolute: bool
    components: list[tuple[str, str]]
    classes: list[tuple[str, str]]
    groups: list[tuple[str, str]]
    window: Window | None
    plan: bytes | None
    path: list[Pose] | None
    scans: list[Shown]


def view_of(
    folder: Path,
    *,
    scans: int | None = None,
    every: int = 1,
    columns: int = 640,
    progress: Progress = lambda stage, done, total: None,
) -> View:
    """Return what a page shows of the data set in `folder`: every `every`-th scan, at most `scans` of them.

    columns: range cells kept of each row, at most; progress is told stage, done and total.

    Raises:
        DatasetError: it is no data set or a file of it is damaged; the message names it.
        ValueError: an argument is out of its range.
    """
    for name, value in (("scans", scans), ("every", every), ("columns", columns)):
        if value is not None and value < 1:
            raise ValueError(f"{name} must be 1 or more, got {value}")
    source = open_source(Path(folder))
    sensor = source.scans.sensor
    pool = math.ceil(sensor.bins / columns)
    chosen = range(len(source.scans))[::every][:scans]
    shown = []
    for number in chosen:
        progress("scans", len(shown), len(chosen))
        shown.append(_shown(source, number, pool=pool))
    progress("scans", len(chosen), len(chosen))
    progress("plan", 0, 1)
    path = [pose for pose in map(source.pose, range(len(source.scans))) if pose]
    window, plan = _plan(source, path)
    progress("plan", 1, 1)
    return View(
        title=source.title,
        sensor=sensor.name.upper(),
        azimuths=sensor.azimuths,
        columns=sensor.bins // pool,
        cell_m=round(pool * sensor.bin_m, 9),
        offset_m=source.scans.range_offset_m,
        total=len(source.scans),
        has_truth=source.has_truth,
        absolute=source.absolute,
        components=[(name, COMPONENT_COLOURS.get(name, _OTHER_COLOUR)) for name in source.components],
        classes=[(name, _class_colour(name)) for name in source.classes],
        groups=[(group, colour) for group, (colour, _) in THINGS.items()],
        window=window,
        plan=plan,
        path=path or None,
        scans=shown,
    )


def _class_colour(name: str) -> str:
    """Return the colour of the group of a class."""
    return next((colour for colour, members in THINGS.values() if name in members), _OTHER_COLOUR)


# ---------------------------------------------------------------------- one scan


def _shown(source: Source, number: int, *, pool: int) -> Shown:
    scan, truth = source.scans.read(number), source.truth(number)
    codes, strongest = strongest_cells(scan.codes, pool)
    speed, yaw_rate = _rates(source, number, scan, truth)
    return Shown(
        number=number,
        stamp_us=source.stamps_us[number],
        codes=_webp(codes, quality=_CODE_QUALITY),
        labels=_webp(_labels(truth.cells, strongest)) if truth else None,
        pose=source.pose(number),
        motion=source.motion(number),
        speed=speed,
        yaw_rate=yaw_rate,
        clipped=np.flatnonzero(truth.saturated).tolist() if truth else [],
        first_m=[_decimetres(value) for value in truth.first_m.tolist()] if truth else [],
        boxes=list(observed_boxes(scan, truth)) if truth else [],
    )


def strongest_cells(codes: NDArray[np.uint8], pool: int) -> tuple[NDArray[np.uint8], NDArray[np.intp]]:
    """Return the largest code of every `pool` bins (azimuths, bins // pool), and the bin where it stands."""
    azimuths, bins = codes.shape
    groups = codes[:, : bins // pool * pool].reshape(azimuths, -1, pool)
    at = groups.argmax(axis=2)
    return groups.max(axis=2), at + pool * np.arange(at.shape[1])


def _labels(cells: CellTruth, bins: NDArray[np.intp]) -> NDArray[np.uint8]:
    """Return the truth of the cells `bins` (azimuths, columns) as a picture (azimuths, columns, 3)."""
    component, bounces, class_id, moving = (
        np.take_along_axis(values, bins, axis=1).astype(np.uint8)
        for values in (cells.component, cells.bounces, cells.class_id, cells.moving)
    )
    marked = component + 16 * np.minimum(bounces, _MOST_BOUNCES)
    return np.dstack([marked, class_id, moving]).astype(np.uint8)


def _rates(
    source: Source, number: int, scan: PolarScan, truth: ScanTruth | None
) -> tuple[float | None, float | None]:
    """Return speed [m/s], yaw rate [rad/s]: over the rows if their poses are known, else since the last."""
    motion = source.motion(number)
    if truth is not None:
        x, y, yaw = relative_from_world(truth.pose[0], truth.pose[-1]).array.tolist()
        seconds = float(scan.timestamp_us[-1] - scan.timestamp_us[0]) / 1e6
    elif motion is not None:
        x, y, yaw = motion
        seconds = (source.stamps_us[number] - source.stamps_us[number - 1]) / 1e6
    else:
        return None, None
    if seconds <= 0:
        return None, None
    return round(math.hypot(x, y) / seconds, 3), round(yaw / seconds, 4)


# ---------------------------------------------------------------------- the plan, and files in memory


def _plan(source: Source, path: list[Pose]) -> tuple[Window | None, bytes | None]:
    """Return the window round the drive and the town in it, None what is unknown."""
    if not path:
        return None, None
    window = drive_window(np.array(path))
    scene = source.scans.folder / "scene.glb"
    if not (source.has_truth and scene.exists()):
        return window, None
    picture = plan_picture(scene, window, pixels=_PLAN_PIXELS)
    return window, _webp(np.rint(255 * picture).astype(np.uint8), quality=_PLAN_QUALITY)


def _webp(pixels: NDArray[np.uint8], *, quality: int | None = None) -> bytes:
    """Return a picture as WebP, lossless unless a quality is given."""
    data = io.BytesIO()
    if quality is None:
        Image.fromarray(pixels).save(data, "webp", lossless=True, quality=80, method=4)
    else:
        Image.fromarray(pixels).save(data, "webp", quality=quality, method=6)
    return data.getvalue()


def _decimetres(value: float) -> float | None:
    return round(value, 1) if math.isfinite(value) else None
