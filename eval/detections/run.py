"""Judges detectors over a folder of simulated scans: a scan is read once, and every method works on it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.eval.detections.interface import Detections, Detector
from echoscape.eval.detections.tally import BAND_M, Tally, tally_scan
from echoscape.eval.detections.targets import JudgeSettings, ScanTargets, judged_bins
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.files.metadata import read_manifest
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.datasets.scan_folder import ScanFolder

Progress = Callable[[str, int, int], None]
"""Called with a stage (scans), how much of it is done, and how much there is to do."""
MOST_BLOCKS = 64
"""Blocks of scans whose counts are kept apart, for the bootstrap."""


@dataclass(frozen=True, kw_only=True)
class JudgedMethod:
    """What a method detected in a folder.

    Attributes:
        name: Its name.
        score_name: What its score is, with its unit.
        score_limits: Its lowest and highest score.
        blocks: Counts of blocks of successive scans; the first axis is that of the blocks.
        shown: Its detections in the scan that is drawn.
        shown_labels: What these fell on.
    """

    name: str
    score_name: str
    score_limits: tuple[float, float]
    blocks: Tally
    shown: Detections
    shown_labels: NDArray[np.uint8]


@dataclass(frozen=True, kw_only=True)
class DetectionResult:
    """Methods judged over a folder.

    Attributes:
        folder: Name of the folder.
        settings: How detections are judged.
        classes: Names of the object classes by number.
        near_m: Where the judged ranges begin [m].
        far_m: Where they end [m].
        scans: Number of scans.
        shown_number: Number of the scan that is drawn, in the folder.
        shown_scan: That scan.
        methods: The methods.
    """

    folder: str
    settings: JudgeSettings
    classes: tuple[str, ...]
    near_m: float
    far_m: float
    scans: int
    shown_number: int
    shown_scan: PolarScan
    methods: tuple[JudgedMethod, ...]


def judge_detectors(
    folder: ScanFolder,
    detectors: Sequence[Detector],
    settings: JudgeSettings | None = None,
    *,
    every: int = 1,
    progress: Progress | None = None,
) -> DetectionResult:
    """Judge detectors by the truth of a folder.

    Args:
        folder: A simulated folder.
        detectors: The methods.
        settings: How detections are judged; None for the default.
        every: Judge one scan of so many.
        progress: Called with stage, done and total.

    Returns:
        What each method detected.

    Raises:
        DatasetError: The folder has no truth, or a file is absent or damaged.
        ValueError: `every` is below 1, or no bin is judged.
    """
    settings = settings or JudgeSettings()
    classes = _classes(folder)
    if every < 1:
        raise ValueError(f"every must be 1 or more, got {every}")
    bin_m = folder.sensor.bin_m
    judged = judged_bins(folder.sensor.bins, bin_m, settings)
    size = {"bands": int((judged.stop - 0.5) * bin_m // BAND_M) + 1, "classes": len(classes)}
    numbers = range(0, len(folder), every)
    blocks, shown = min(len(numbers), MOST_BLOCKS), numbers[len(numbers) // 2]
    running = [_Running(detector, Tally.empty(blocks, **size)) for detector in detectors]
    report = progress or (lambda stage, done, total: None)
    report("scans", 0, len(numbers))
    for place, number in enumerate(numbers):
        scan, truth = folder.read(number), folder.truth(number)
        assert truth is not None
        targets = ScanTargets(scan, truth.cells, folder.sensor, settings)
        for each in running:
            each.judge(scan, targets, place * blocks // len(numbers), shown=number == shown)
        report("scans", place + 1, len(numbers))
    return DetectionResult(
        folder=folder.folder.resolve().name,
        settings=settings,
        classes=classes,
        near_m=judged.start * bin_m,
        far_m=judged.stop * bin_m,
        scans=len(numbers),
        shown_number=shown,
        shown_scan=folder.read(shown),
        methods=tuple(each.result() for each in running),
    )


class _Running:
    """A method at work on a folder: its counts so far, and what it made of the scan that is drawn."""

    def __init__(self, detector: Detector, blocks: Tally) -> None:
        self._detector, self._blocks = detector, blocks
        self._shown: tuple[Detections, NDArray[np.uint8]] | None = None

    def judge(self, scan: PolarScan, targets: ScanTargets, block: int, *, shown: bool) -> None:
        """Add what the method makes of a scan to a block; keep it if the scan is to be drawn."""
        scored = self._detector.detect(scan)
        bands, classes = self._blocks.echoes_by.shape[1:]
        limits = self._detector.score_limits
        self._blocks.add(block, tally_scan(targets, scored, limits, bands=bands, classes=classes))
        if shown:
            self._shown = scored.detections, targets.label(scored.detections)

    def result(self) -> JudgedMethod:
        """Return all that was counted."""
        assert self._shown is not None
        return JudgedMethod(
            name=self._detector.name,
            score_name=self._detector.score_name,
            score_limits=self._detector.score_limits,
            blocks=self._blocks,
            shown=self._shown[0],
            shown_labels=self._shown[1],
        )


def _classes(folder: ScanFolder) -> tuple[str, ...]:
    """Return the names of the classes by number; refuse a folder without truth."""
    if not folder.simulated:
        raise DatasetError(
            f"{folder.folder}: has no truth; detections are judged by the truth of simulated scans only"
        )
    return tuple(read_manifest(folder.folder)["classes"])
