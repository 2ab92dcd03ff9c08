"""Judges detectors over a folder of simulated scans: a scan is read once, and every method works on it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from echoscape.eval.detections.bootstrap import block_numbers
from echoscape.eval.detections.interface import Detections, Detector, Recorded
from echoscape.eval.detections.tally import BAND_M, Tally, tally_scan
from echoscape.eval.detections.targets import JudgeSettings, ScanTargets, judged_bins
from echoscape.scenes.core.progress import Progress
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.files.metadata import read_manifest
from echoscape.sim.datasets.files.truth_npz import read_arrays
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.datasets.scan_folder import ScanFolder


@dataclass(frozen=True, kw_only=True)
class JudgedMethod:
    """What a method detected in a folder.

    Attributes:
        name: Its name.
        score_name: What its score is, with its unit.
        score_limits: Its lowest and highest score.
        record: Its settings, and the hashes of files that it read; empty of a detector that records nothing.
        blocks: Counts of blocks of successive scans; the first axis is that of the blocks.
        shown: Its detections in the scan that is drawn.
        shown_labels: What these fell on.
    """

    name: str
    score_name: str
    score_limits: tuple[float, float]
    record: dict[str, Any]
    blocks: Tally
    shown: Detections
    shown_labels: NDArray[np.uint8]


@dataclass(frozen=True, kw_only=True)
class DetectionResult:
    """Methods judged over a folder.

    Attributes:
        folder: Name of the folder.
        manifest: Its record, the content of its echoscape.json.
        settings: How detections are judged.
        classes: Names of the object classes by number.
        near_m: Where the judged ranges begin [m].
        far_m: Where they end [m].
        scans: Number of scans.
        travelled_m: Way from the first scan to the last one [m].
        blocks: Number of blocks of these scans (`eval.detections.bootstrap`).
        shown_number: Number of the scan that is drawn, in the folder.
        shown_scan: That scan.
        methods: The methods.
    """

    folder: str
    manifest: dict[str, Any]
    settings: JudgeSettings
    classes: tuple[str, ...]
    near_m: float
    far_m: float
    scans: int
    travelled_m: float
    blocks: int
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
        every: Judge every Nth scan, from the first.
        progress: Called as the work proceeds; its stage: scans.

    Returns:
        What each method detected.

    Raises:
        DatasetError: The folder has no truth, or a file is absent or damaged.
        ValueError: `every` is below 1, or no bin is judged.
    """
    settings = settings or JudgeSettings()
    manifest = _manifest(folder)
    classes = tuple(manifest["classes"])
    if every < 1:
        raise ValueError(f"every must be 1 or more, got {every}")
    bin_m = folder.sensor.bin_m
    judged = judged_bins(folder.sensor.bins, bin_m, settings)
    size = {"bands": int((judged.stop - 0.5) * bin_m // BAND_M) + 1, "classes": len(classes)}
    numbers = range(0, len(folder), every)
    travelled_m, shown = _travelled_m(folder)[::every], numbers[len(numbers) // 2]
    block = block_numbers(travelled_m)
    blocks = int(block[-1]) + 1
    running = [_Running(detector, Tally.empty(blocks, **size)) for detector in detectors]
    report = progress or (lambda stage, done, total: None)
    report("scans", 0, len(numbers))
    for place, number in enumerate(numbers):
        scan, truth = folder.read(number), folder.truth(number)
        assert truth is not None
        targets = ScanTargets(scan, truth.cells, folder.sensor, settings)
        for each in running:
            each.judge(scan, targets, int(block[place]), shown=number == shown)
        report("scans", place + 1, len(numbers))
    return DetectionResult(
        folder=folder.folder.resolve().name,
        manifest=manifest,
        settings=settings,
        classes=classes,
        near_m=judged.start * bin_m,
        far_m=judged.stop * bin_m,
        scans=len(numbers),
        travelled_m=float(travelled_m[-1]),
        blocks=blocks,
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
            record=self._detector.record() if isinstance(self._detector, Recorded) else {},
            blocks=self._blocks,
            shown=self._shown[0],
            shown_labels=self._shown[1],
        )


def _travelled_m(folder: ScanFolder) -> NDArray[np.float64]:
    """Return the true way from the first scan to each scan (N,) [m]."""
    truths = [folder.folder / "truth" / f"{path.stem}.npz" for path in folder.paths]
    places_m = np.array([read_arrays(truth, ("middle_pose",))["middle_pose"][:2] for truth in truths])
    steps_m = np.hypot(*np.diff(places_m, axis=0).T)
    return np.concatenate([[0.0], np.cumsum(steps_m)])


def _manifest(folder: ScanFolder) -> dict[str, Any]:
    """Return the record of a data set; refuse a folder without truth."""
    if not folder.simulated:
        raise DatasetError(
            f"{folder.folder}: has no truth; detections are judged by the truth of simulated scans only"
        )
    return read_manifest(folder.folder)
