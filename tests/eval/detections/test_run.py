import hashlib
import json
import shutil
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from echoscape.eval.detections.bootstrap import BLOCK_M
from echoscape.eval.detections.cfar import CfarSettings
from echoscape.eval.detections.interface import ScoredScan, cells_of
from echoscape.eval.detections.merit import FIGURE_NAMES, figures
from echoscape.eval.detections.registry import (
    METHODS,
    KeypointSettings,
    MethodSettings,
    build_detectors,
    check_methods,
)
from echoscape.eval.detections.report import write_detection_report
from echoscape.eval.detections.run import DetectionResult, judge_detectors
from echoscape.eval.detections.targets import LABELS, OUTSIDE, TARGET, JudgeSettings
from echoscape.eval.methods.cen2018 import Cen2018Settings
from echoscape.learn.model.weights import chosen_weights
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.polar_scan import Component, PolarScan
from echoscape.sim.datasets.scan_folder import ScanFolder, open_folder
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.dataset import write_dataset
from echoscape.sim.sensor.cts_small import CTS_SMALL
from echoscape.sim.settings.tracing import TraceSettings

BY_HAND = ("cfar", "oscfar", "kstrongest")


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Scans a few metres apart."""
    out = tmp_path_factory.mktemp("short") / "yard"
    config = SimulationConfig(preset="yard", seed=3, scans=7, sensor=CTS_SMALL, trace=TraceSettings(rays=64))
    write_dataset(out, config)
    return out


@pytest.fixture(scope="module")
def yard(short: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same scans as if the car had driven 100 m from each to the next."""
    out = Path(shutil.copytree(short, tmp_path_factory.mktemp("long") / "yard"))
    for number, path in enumerate(sorted((out / "truth").glob("*.npz"))):
        with np.load(path) as archive:
            arrays = dict(archive)
        arrays["middle_pose"] = np.array([60.0 * number, 80.0 * number, 0.0, 0.0])
        np.savez(path, **arrays)
    return out


class Knowing:
    """Detects the cells of the truth, shifted in range."""

    name, score_name, score_limits = "knowing", "none", (0.0, 1.0)

    def __init__(self, folder: ScanFolder, *, shift: int = 0) -> None:
        self._folder, self._shift, self._index = folder, shift, 0

    def detect(self, scan: PolarScan) -> ScoredScan:
        truth = self._folder.truth(self._index)
        assert truth is not None
        self._index += 1
        cells = truth.cells
        mask = (cells.component == Component.DIRECT) & ~cells.moving
        found = cells_of(np.roll(mask, self._shift, axis=1), np.ones(mask.shape), scan.bin_m)
        return ScoredScan(detections=found, score_map=found)


def by_hand(folder: Path, **options) -> DetectionResult:
    data = open_folder(folder)
    return judge_detectors(data, build_detectors(BY_HAND, MethodSettings(), data.sensor), **options)


@pytest.fixture(scope="module")
def judged(yard: Path) -> DetectionResult:
    return by_hand(yard)


def test_a_detector_that_knows_the_truth_is_perfect(yard: Path) -> None:
    folder = open_folder(yard)
    result = judge_detectors(folder, [Knowing(folder)])
    found = {name: figure.value for name, figure in figures(result.methods[0]).items()}
    assert found["precision"] == found["recall"] == found["object_recall"] == 1.0
    assert found["average_precision"] == pytest.approx(1.0)
    assert found["false_alarms_per_scan"] == 0
    assert result.methods[0].blocks.total.echoes > 500


def test_figures_are_in_their_ranges_and_inside_their_intervals(judged: DetectionResult) -> None:
    for method in judged.methods:
        found = figures(method)
        assert tuple(found) == FIGURE_NAMES
        for name, figure in found.items():
            assert figure.value is not None
            assert figure.interval is not None
            assert figure.interval[0] <= figure.value * 1.02
            assert figure.interval[1] >= figure.value * 0.98
            assert figure.value >= 0
            assert figure.value <= 1 or name.endswith("per_scan")
        values = {name: figure.value or 0.0 for name, figure in found.items()}
        assert values["average_precision"] <= values["recall"]
        assert values["score_average_precision"] > 0
        assert 0 < values["map_base_rate"] < 1


def test_counts_of_a_folder_are_those_of_its_scans(yard: Path, judged: DetectionResult) -> None:
    data = open_folder(yard)
    detectors = build_detectors(BY_HAND, MethodSettings(), data.sensor)
    for detector, method in zip(detectors, judged.methods, strict=True):
        number = sum(len(detector.detect(data.read(index)).detections) for index in range(len(data)))
        assert 0.9 * number < method.blocks.total.labels.sum() <= number  # those nearer than 3 m do not count
    assert judged.scans == judged.methods[0].blocks.total.scans == 7
    assert judged.travelled_m == pytest.approx(600)
    assert judged.methods[0].blocks.scans.tolist() == [1, 1, 1, 1, 1, 2]  # the last scan ends the last 100 m


def test_the_scan_that_is_drawn_has_the_labels_that_were_counted(judged: DetectionResult) -> None:
    for method in judged.methods:
        block = method.blocks.labels[judged.shown_number]
        shown = method.shown_labels[method.shown_labels != OUTSIDE]
        assert_array_equal(np.bincount(shown, minlength=len(LABELS)), block.sum(axis=1))
        assert (shown == TARGET).any()


def test_one_scan_of_two_is_judged(yard: Path) -> None:
    steps: list[tuple[str, int, int]] = []
    result = by_hand(yard, every=2, progress=lambda *each: steps.append(each))
    assert result.scans == 4
    assert result.travelled_m == pytest.approx(600)
    assert steps == [("scans", done, 4) for done in range(5)]


def test_scans_of_nearly_one_place_have_no_intervals_and_the_report_says_why(
    short: Path, tmp_path: Path
) -> None:
    result = by_hand(short)
    assert result.methods[0].blocks.scans.tolist() == [7]
    assert 0 < result.travelled_m < BLOCK_M
    assert all(each.interval is None for method in result.methods for each in figures(method).values())
    write_detection_report(tmp_path, result)
    way = f"{result.travelled_m:.0f} m"
    why = f"o intervals: the way of {way} makes blocks of 80 m or more, and 1 block gives no interval"
    assert f"N{why}" in (tmp_path / "detections.md").read_text()
    found = json.loads((tmp_path / "detections.json").read_text())
    assert found["intervals"]["none_because"].startswith(f"n{why}")
    assert found["intervals"]["blocks"] == 1
    assert not [name for name in _csv(tmp_path)[0] if name.endswith("_low") and _csv(tmp_path)[0][name]]


def test_a_long_drive_has_intervals_in_all_files(judged: DetectionResult, tmp_path: Path) -> None:
    write_detection_report(tmp_path, judged)
    found = json.loads((tmp_path / "detections.json").read_text())
    assert found["intervals"] == {
        "confidence": 0.95,
        "travelled_m": pytest.approx(600),
        "block_m": 80.0,
        "blocks": 6,
        "none_because": None,
    }
    text = (tmp_path / "detections.md").read_text()
    assert "at 95 %, from 6 blocks of 80 m or more, on the way of 600 m" in text
    for row in _csv(tmp_path):
        low, high = found["methods"][row["method"]]["figures"]["average_precision"]["interval"]
        assert float(row["average_precision_low"]) == pytest.approx(low, rel=1e-4)
        assert f" ({low:.3f} to {high:.3f}) |" in text


def _csv(folder: Path) -> list[dict[str, str]]:
    head, *lines = (folder / "detections.csv").read_text().splitlines()
    return [dict(zip(head.split(","), line.split(","), strict=True)) for line in lines]


def test_json_records_all_that_decides_the_figures(yard: Path, tmp_path: Path) -> None:
    data = open_folder(yard)
    settings = MethodSettings(
        cfar=CfarSettings(training_m=9.0),
        cen2018=Cen2018Settings(near_m=4.0),
        learned=KeypointSettings(least_score=0.25, device="cpu"),
    )
    names = ["cfar", "kstrongest", "cen2018", "learned"]
    result = judge_detectors(data, [*build_detectors(names, settings, data.sensor), Knowing(data)], every=7)
    write_detection_report(tmp_path, result)
    found = json.loads((tmp_path / "detections.json").read_text())
    manifest = json.loads((yard / "echoscape.json").read_text())
    assert found["data"] == {"config": manifest["config"], "versions": manifest["versions"]}
    assert found["data"]["config"]["sensor"]["name"] == "cts_small"
    for package in ("echoscape", "numpy", "scipy", "torch"):
        assert found["versions"][package] == version(package)
    record = {name: content["settings"] for name, content in found["methods"].items()}
    assert record["cfar"] == asdict(settings.cfar)
    assert record["kstrongest"] == {"k": 40, "floor_db": 30.0, "near_m": 3.0}
    assert record["cen2018"] == asdict(settings.cen2018)
    assert record["knowing"] == {}
    assert record["learned"]["least_score"] == 0.25
    digest = hashlib.sha256(chosen_weights().read_bytes()).hexdigest()
    assert record["learned"]["weights_sha256"] == digest


def test_ranges_and_targets_are_those_asked_for(yard: Path) -> None:
    narrow = by_hand(yard, settings=JudgeSettings(near_m=10.0, far_m=30.0))
    assert narrow.near_m == pytest.approx(10.0, abs=CTS_SMALL.bin_m)
    assert narrow.far_m == pytest.approx(30.0, abs=CTS_SMALL.bin_m)
    echoes = narrow.methods[0].blocks.total.echoes_by.sum(axis=1)
    assert echoes[0] == 0
    assert (echoes[1:3] > 0).all()
    assert len(echoes) == 3


def test_a_report_is_complete_and_the_same_again(judged: DetectionResult, yard: Path, tmp_path: Path) -> None:
    paths = write_detection_report(tmp_path / "a", judged)
    again = write_detection_report(tmp_path / "b", by_hand(yard))
    names = {"detections.csv", "recall.csv", "detections.md", "detections.json", "detections.png"}
    assert {path.name for path in paths} == names == {path.name for path in (tmp_path / "a").iterdir()}
    for one, other in zip(paths, again, strict=True):
        assert one.read_bytes() == other.read_bytes()


def test_tables_and_json_agree_with_the_counts(judged: DetectionResult, tmp_path: Path) -> None:
    write_detection_report(tmp_path, judged)
    found = json.loads((tmp_path / "detections.json").read_text())
    head, *lines = (tmp_path / "detections.csv").read_text().splitlines()
    for line, method in zip(lines, judged.methods, strict=True):
        row = dict(zip(head.split(","), line.split(","), strict=True))
        content = found["methods"][method.name]
        assert row["method"] == method.name
        assert float(row["precision"]) == pytest.approx(content["figures"]["precision"]["value"], rel=1e-5)
        alarms = sum(content["false_alarms_per_scan"].values())
        assert alarms == pytest.approx(content["figures"]["false_alarms_per_scan"]["value"])
        assert content["curve"]["recall"][0] == content["figures"]["recall"]["value"]
        best = content["best_threshold"]
        assert best["f1"] >= 2 / (1 / best["precision"] + 1 / best["recall"]) - 1e-9
    lines = (tmp_path / "recall.csv").read_text().splitlines()[1:]
    rows = [line.split(",") for line in lines if line.startswith("kstrongest,")]
    for _, _, _, _, echoes, found, recall, objects, seen, object_recall in rows:
        assert float(recall) == pytest.approx(int(found) / int(echoes), rel=1e-5)
        assert not objects or float(object_recall) == pytest.approx(int(seen) / int(objects), rel=1e-5)
    by_class = [row for row in rows if row[2] == "all"]
    by_band = [row for row in rows if row[2] != "all"]
    echoes = int(judged.methods[2].blocks.total.echoes)
    assert sum(int(row[4]) for row in by_class) == sum(int(row[4]) for row in by_band) == echoes
    assert {row[1] for row in by_class} <= set(judged.classes)


def test_scans_without_truth_are_refused(yard: Path, tmp_path: Path) -> None:
    shutil.copytree(yard / "radar", tmp_path / "radar")
    data = open_folder(tmp_path, layout="oxford", sensor=CTS_SMALL)
    with pytest.raises(DatasetError, match="has no truth; detections are judged by the truth of simulated"):
        judge_detectors(data, [])


def test_a_truth_file_that_is_gone_is_named(yard: Path, tmp_path: Path) -> None:
    copy = Path(shutil.copytree(yard, tmp_path / "copy"))
    gone = sorted((copy / "truth").glob("*.npz"))[2]
    gone.unlink()
    with pytest.raises(DatasetError, match=gone.name):
        by_hand(copy)


def test_refuses_names_of_methods() -> None:
    check_methods(list(METHODS))
    with pytest.raises(ValueError, match=r"methods must be among cfar, .*, got 'cafr'"):
        check_methods(["cafr"])
    with pytest.raises(ValueError, match="methods must be named once each, got cfar twice"):
        check_methods(["cfar", "kstrongest", "cfar"])
    with pytest.raises(ValueError, match="methods must name at least one of cfar"):
        check_methods([])


def test_refuses_a_step_of_0(yard: Path) -> None:
    with pytest.raises(ValueError, match="every must be 1 or more, got 0"):
        by_hand(yard, every=0)
