"""What a viewer page shows: reduced scans with their ground truth, the plan, the drive, and boxes of objects.

Range bins of an azimuth are pooled; each group is shown as its strongest bin, both its code and its truth.
"""

import io
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from echoscape.eval.figures.frame import shown_components
from echoscape.eval.figures.mover_boxes import ObservedBox, observed_boxes
from echoscape.eval.figures.style import (
    COMPONENT_COLOURS,
    IN_PLACE,
    OTHER_COLOUR,
    class_colour,
    class_legend,
    component_legend,
)
from echoscape.eval.figures.town_plan import Window, drive_window, plan_image
from echoscape.eval.viewer.source import Motion, Pose, Source, open_source
from echoscape.scenes.core.progress import Progress
from echoscape.sim.datasets.polar_scan import CellTruth, PolarScan, ScanTruth
from echoscape.sim.datasets.se2 import relative_from_world

Legend = list[tuple[str, str]]
"""Names with their colours."""

_CODE_QUALITY = 80
_PLAN_QUALITY = 70
_PLAN_PIXELS = 800
_MAX_BOUNCES = 15
"""What four bits hold."""


@dataclass(frozen=True, kw_only=True)
class ViewedScan:
    """One scan of a page.

    Attributes:
        number: Its place in the data set, from 0.
        stamp_us: Time that names its file [us].
        codes: Grey WebP (azimuths, columns) of codes [half dB].
        labels: Lossless WebP of the same size: red is component + 16 bounces, green class, blue moving; None
            without truth.
        pose: Pose of the car at mid-scan, None where unknown.
        motion: Motion since the scan before, None where unknown.
        speed_m_s: Speed of the car [m/s], None where unknown.
        yaw_rate_rad_s: Yaw rate of the car, clockwise [rad/s], None where unknown.
        clipped: Azimuths in which the converter clipped.
        obstacle_m: Range of the first obstacle by azimuth [m], None where there is none.
        boxes: Boxes of moving objects where the scan shows them.
    """

    number: int
    stamp_us: int
    codes: bytes
    labels: bytes | None
    pose: Pose | None
    motion: Motion | None
    speed_m_s: float | None
    yaw_rate_rad_s: float | None
    clipped: list[int]
    obstacle_m: list[float | None]
    boxes: list[ObservedBox]


@dataclass(frozen=True, kw_only=True)
class View:
    """All that a page shows.

    Attributes:
        title: What was simulated, or the folder's name.
        sensor: Name of the radar.
        azimuths: Azimuths of a scan.
        first_azimuth_rad: Direction of the first of them, clockwise from ahead [rad].
        columns: Pooled range bins of an azimuth; column k is centred at (k + 1/2) column_m + offset_m.
        column_m: Length of a pooled range bin [m].
        offset_m: Offset to the ranges of bins [m].
        total: Number of scans in the data set.
        has_truth: Whether the data set has ground truth.
        north_up: Whether north is up in the plan's world.
        components: Name and colour of each component, by number, that of ghosts in place last.
        classes: Name and colour of each class, by number.
        component_legend: Components that occur in the scans shown.
        class_legend: Groups of classes that occur in the scans shown.
        window: Part of the world that the plan shows, None where poses are unknown.
        plan: WebP of the town in that window, None where unknown.
        path: Poses of the car over the whole data set, None where unknown.
        scans: The scans shown.
    """

    title: str
    sensor: str
    azimuths: int
    first_azimuth_rad: float
    columns: int
    column_m: float
    offset_m: float
    total: int
    has_truth: bool
    north_up: bool
    components: Legend
    classes: Legend
    component_legend: Legend
    class_legend: Legend
    window: Window | None
    plan: bytes | None
    path: list[Pose] | None
    scans: list[ViewedScan]


def view_of(
    folder: Path,
    *,
    scans: int | None = None,
    every: int = 1,
    columns: int = 640,
    progress: Progress = lambda stage, done, total: None,
) -> View:
    """Read what a page shows of a data set.

    Args:
        folder: The data set, simulated or real.
        scans: Maximum number of scans, None for all.
        every: Step from one scan to the next.
        columns: Maximum number of pooled range bins of an azimuth.
        progress: Called as the work proceeds; stages: scans, plan.

    Returns:
        The content of the page.

    Raises:
        DatasetError: The folder is not a data set, or a file of it is damaged; the message names it.
        ValueError: An argument is out of its range.
    """
    for name, value in (("scans", scans), ("every", every), ("columns", columns)):
        if value is not None and value < 1:
            raise ValueError(f"{name} must be 1 or more, got {value}")
    source = open_source(Path(folder))
    components = [*source.components, IN_PLACE]
    sensor = source.scans.sensor
    pool = math.ceil(sensor.bins / columns)
    chosen = range(len(source.scans))[::every][:scans]
    shown, occurring = [], _Occurring()
    for number in chosen:
        progress("scans", len(shown), len(chosen))
        shown.append(_viewed(source, number, pool=pool, occurring=occurring))
    progress("scans", len(chosen), len(chosen))
    progress("plan", 0, 1)
    path = [pose for pose in map(source.pose, range(len(source.scans))) if pose]
    window, plan = _plan(source, path)
    progress("plan", 1, 1)
    return View(
        title=source.title,
        sensor=sensor.name.upper(),
        azimuths=sensor.azimuths,
        first_azimuth_rad=round(sensor.first_azimuth_rad, 9),
        columns=sensor.bins // pool,
        column_m=round(pool * sensor.bin_m, 9),
        offset_m=source.scans.range_offset_m,
        total=len(source.scans),
        has_truth=source.has_truth,
        north_up=source.north_up,
        components=[(name, COMPONENT_COLOURS.get(name, OTHER_COLOUR)) for name in components],
        classes=[(name, class_colour(name)) for name in source.classes],
        component_legend=list(component_legend(occurring.names(components, 0)).items()),
        class_legend=list(class_legend(occurring.names(source.classes, 1)).items()),
        window=window,
        plan=plan,
        path=path or None,
        scans=shown,
    )


class _Occurring:
    """Gathers which components and classes occur in the labels of the scans shown."""

    def __init__(self) -> None:
        self._numbers: tuple[set[int], set[int]] = (set(), set())

    def add(self, labels: NDArray[np.uint8]) -> None:
        """Add the labels (azimuths, columns, 3) of a scan."""
        self._numbers[0].update(np.unique(labels[..., 0] & 15).tolist())
        self._numbers[1].update(np.unique(labels[..., 1]).tolist())

    def names(self, known: list[str], which: int) -> list[str]:
        """Return the names of the components (0) or classes (1) that occur."""
        return [name for number, name in enumerate(known) if number in self._numbers[which]]


# ---------------------------------------------------------------------- one scan


def _viewed(source: Source, number: int, *, pool: int, occurring: _Occurring) -> ViewedScan:
    scan, truth = source.scans.read(number), source.truth(number)
    codes, strongest = strongest_bins(scan.codes, pool)
    labels = _labels(truth.cells, source.components, strongest) if truth else None
    if labels is not None:
        occurring.add(labels)
    speed, yaw_rate = _rates(source, number, scan, truth)
    share = source.motion_distortion
    return ViewedScan(
        number=number,
        stamp_us=source.stamps_us[number],
        codes=_webp(codes, quality=_CODE_QUALITY),
        labels=None if labels is None else _webp(labels),
        pose=source.pose(number),
        motion=source.motion(number),
        speed_m_s=speed,
        yaw_rate_rad_s=yaw_rate,
        clipped=np.flatnonzero(truth.saturated).tolist() if truth else [],
        obstacle_m=[_decimetres(value) for value in truth.first_obstacle_m.tolist()] if truth else [],
        boxes=list(observed_boxes(truth, motion_distortion=share)) if truth else [],
    )


def strongest_bins(codes: NDArray[np.uint8], pool: int) -> tuple[NDArray[np.uint8], NDArray[np.intp]]:
    """Pool range bins by their maximum.

    Args:
        codes: Codes (azimuths, bins) of a scan.
        pool: Range bins that are pooled into one; a rest at the far end is dropped.

    Returns:
        The largest code of each group (azimuths, bins // pool), and the bin that holds it.
    """
    azimuths, bins = codes.shape
    groups = codes[:, : bins // pool * pool].reshape(azimuths, -1, pool)
    at = groups.argmax(axis=2)
    return groups.max(axis=2), at + pool * np.arange(at.shape[1])


def _labels(cells: CellTruth, components: list[str], bins: NDArray[np.intp]) -> NDArray[np.uint8]:
    """Return the truth of the range bins `bins` (azimuths, columns) as an image (azimuths, columns, 3)."""
    shown = shown_components(cells, components)
    component, bounces, class_id, moving = (
        np.take_along_axis(values, bins, axis=1).astype(np.uint8)
        for values in (shown, cells.bounces, cells.class_id, cells.moving)
    )
    packed = component + 16 * np.minimum(bounces, _MAX_BOUNCES)
    return np.dstack([packed, class_id, moving]).astype(np.uint8)


def _rates(
    source: Source, number: int, scan: PolarScan, truth: ScanTruth | None
) -> tuple[float | None, float | None]:
    """Return speed [m/s] and yaw rate [rad/s]: over the scan with truth, else since the scan before."""
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


# ---------------------------------------------------------------------- the plan, and image files


def _plan(source: Source, path: list[Pose]) -> tuple[Window | None, bytes | None]:
    """Return the window around the drive and an image of the town in it, None for what is unknown."""
    if not path:
        return None, None
    window = drive_window(np.array(path))
    scene = source.scans.folder / "scene.glb"
    if not (source.has_truth and scene.exists()):
        return window, None
    plan = plan_image(scene, window, pixels=_PLAN_PIXELS)
    return window, _webp(np.rint(255 * plan).astype(np.uint8), quality=_PLAN_QUALITY)


def _webp(pixels: NDArray[np.uint8], *, quality: int | None = None) -> bytes:
    """Return an image as WebP, lossless unless a quality is given."""
    data = io.BytesIO()
    if quality is None:
        Image.fromarray(pixels).save(data, "webp", lossless=True, quality=80, method=4)
    else:
        Image.fromarray(pixels).save(data, "webp", quality=quality, method=6)
    return data.getvalue()


def _decimetres(value: float) -> float | None:
    """Return a range rounded to 0.1 m, None where it is infinite."""
    return round(value, 1) if math.isfinite(value) else None
