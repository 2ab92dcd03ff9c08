"""Datasets: what the folder holds, the same bytes however it was made, resuming, and what is refused."""

import json
import math
import multiprocessing
import os
import shutil
import signal
import subprocess
import sys
import time
from collections import deque
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from numpy.testing import assert_allclose

from echoscape.scenes.traffic.plan import TrafficSettings
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.files.metadata import read_manifest, sensor_of
from echoscape.sim.datasets.files.navtech_png import read_png
from echoscape.sim.datasets.files.truth_npz import read_truth
from echoscape.sim.datasets.layouts.oxford import read_odometry, read_timestamps
from echoscape.sim.generation import setup as stage
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.dataset import write_dataset
from echoscape.sim.generation.workers import WorkerError, WorkerPool, complete_scans
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.settings.tracing import TraceSettings

CONFIG = SimulationConfig(preset="empty", seed=3, scans=4, trace=TraceSettings(rays=16))
OPTIONS = ["--preset", "empty", "--seed", "3", "--scans", "4", "--trace.rays", "16", "--no-preview"]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("made") / "set"
    write_dataset(out, CONFIG)
    return out


def _bytes(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def _assert_same_bytes(folder: Path, other: Path) -> None:
    first, second = _bytes(folder), _bytes(other)
    assert first.keys() == second.keys()
    assert [name for name in first if first[name] != second[name]] == []


def test_folder_holds_what_is_promised(made: Path) -> None:
    stamps = read_timestamps(made / "radar.timestamps")
    names = {
        "echoscape.json",
        "scene.glb",
        "movers.csv",
        "tracks.csv",
        "radar.timestamps",
        "gt/radar_odometry.csv",
        *(f"radar/{stamp}.png" for stamp in stamps),
        *(f"truth/{stamp}.npz" for stamp in stamps),
    }
    assert len(stamps) == 4
    assert set(_bytes(made)) == names


def test_scan_is_named_after_its_first_azimuth_and_odometry_after_its_middle(made: Path) -> None:
    stamps = read_timestamps(made / "radar.timestamps")
    rows = read_odometry(made / "gt" / "radar_odometry.csv")
    assert [(row.source_radar_us, row.destination_radar_us) for row in rows] == list(
        zip(stamps[1:], stamps[:-1], strict=True)
    )
    for stamp, row in zip(stamps[1:], rows, strict=True):
        scan = read_png(made / "radar" / f"{stamp}.png")
        assert scan.timestamp_us[0] == stamp
        assert row.source_us == pytest.approx((scan.timestamp_us[0] + scan.timestamp_us[-1]) / 2, abs=1)


def test_odometry_leads_from_pose_to_pose(made: Path) -> None:
    rows = read_odometry(made / "gt" / "radar_odometry.csv")
    truths = [
        read_truth(made / "truth" / f"{stamp}.npz") for stamp in read_timestamps(made / "radar.timestamps")
    ]
    x, y, _, yaw = truths[0].middle_pose
    for row in rows:  # y is right and yaw clockwise, the world's are left and counter-clockwise
        x += math.cos(yaw) * row.x + math.sin(yaw) * row.y
        y += math.sin(yaw) * row.x - math.cos(yaw) * row.y
        yaw -= row.yaw
        assert row.x > 0
    # Three rows of six decimals.
    assert_allclose((x, y, yaw), truths[-1].middle_pose[[0, 1, 3]], atol=1e-5)


def test_manifest_has_configuration_versions_and_names_but_nothing_of_the_machine(made: Path) -> None:
    content = read_manifest(made)
    assert content["config"]["seed"] == 3
    assert content["config"]["trace"]["rays"] == 16
    assert content["components"][:3] == ["noise", "leakage", "direct"]
    assert content["classes"][0] == "none"
    assert {"python", "numpy", "mitsuba", "drjit", "llvm", "echoscape"} <= content["versions"].keys()
    assert sensor_of(content) == CTS350X
    assert str(made.parent) not in json.dumps(content)
    assert not {"host", "user", "time", "date", "path"} & _keys(content)


def test_tracks_hold_the_car_and_its_poses(made: Path) -> None:
    lines = (made / "tracks.csv").read_text().splitlines()
    assert lines[0].startswith("timestamp_us,instance,x_m,y_m,z_m,yaw_rad")
    car = np.array(
        [[float(word) for word in line.split(",")] for line in lines[1:] if line.split(",")[1] == "0"]
    )
    truth = read_truth(made / "truth" / f"{read_timestamps(made / 'radar.timestamps')[0]}.npz")
    assert_allclose(car[0, 2:4], truth.pose[0, :2], atol=1e-3)
    assert lines[0].endswith(",pitch_rad,roll_rad")
    assert truth.attitude is not None
    assert_allclose(car[0, 9:], truth.attitude[0], atol=1e-4)
    assert np.abs(car[:, 9:]).max() > 0


def test_resuming_a_whole_dataset_changes_nothing(made: Path) -> None:
    before = _bytes(made)
    write_dataset(made, CONFIG, resume=True)
    assert _bytes(made) == before


def _keys(content: object) -> set[str]:
    if not isinstance(content, dict):
        return set()
    return {*content}.union(*(_keys(value) for value in content.values()))


@pytest.mark.parametrize("threads", [1, 2])
def test_bytes_do_not_depend_on_threads(made: Path, tmp_path: Path, threads: int) -> None:
    write_dataset(tmp_path, CONFIG, threads=threads)
    _assert_same_bytes(tmp_path, made)


def test_bytes_do_not_depend_on_workers(made: Path, tmp_path: Path) -> None:
    write_dataset(tmp_path / "new" / "set", CONFIG, workers=2)
    _assert_same_bytes(tmp_path / "new" / "set", made)


def _start(out: Path, *options: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "echoscape.cli.__main__", "simulate", str(out), *OPTIONS, *options]
    return subprocess.Popen(command, stderr=subprocess.PIPE, text=True, start_new_session=True)


def _wait_for_scan(out: Path, process: subprocess.Popen[str]) -> None:
    end = time.monotonic() + 120
    while not list(out.glob("radar/*.png")):
        assert time.monotonic() < end
        assert process.poll() is None, process.communicate()[1]
        time.sleep(0.005)


@pytest.mark.parametrize("workers", ["1", "2"])
def test_killed_run_resumes_to_the_same_bytes(made: Path, tmp_path: Path, workers: str) -> None:
    out, whole = tmp_path, dict[Path, int]()
    for attempt in range(5):  # on a busy machine all four scans may be there before anybody looks
        out = tmp_path / str(attempt)
        process = _start(out, "--workers", workers)
        _wait_for_scan(out, process)
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        whole = {path: path.stat().st_mtime_ns for path in out.glob("radar/*.png")}
        if len(whole) < CONFIG.scans:
            break
    assert 0 < len(whole) < CONFIG.scans
    write_dataset(out, CONFIG, resume=True)
    assert {path: path.stat().st_mtime_ns for path in whole} == whole
    _assert_same_bytes(out, made)


def test_interrupted_run_ends_with_130_and_a_hint(tmp_path: Path) -> None:
    # Where the tests run in the background of a script, SIGINT is ignored, and that is inherited.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        process = _start(tmp_path, "--scans", "200")
    finally:
        signal.signal(signal.SIGINT, before)
    _wait_for_scan(tmp_path, process)
    os.killpg(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "--resume" in errors
    assert "Traceback" not in errors
    assert not list(tmp_path.rglob("*.part"))


def test_worker_that_dies_ends_the_run(tmp_path: Path) -> None:
    # Whether the one that is killed makes a scan yet or still starts depends on how fast the other one was.
    killed: list[str] = []

    def kill_one(stage: str, done: int, total: int) -> None:
        if stage == "scans" and done and not killed:
            one = multiprocessing.active_children()[0]
            killed.append(one.name)
            os.kill(one.pid or 0, signal.SIGKILL)

    with pytest.raises(
        WorkerError, match=r"worker \d died while (starting|making scan \d) \(signal SIGKILL\)"
    ) as found:
        write_dataset(tmp_path, CONFIG, workers=2, progress=kill_one)
    assert str(found.value).startswith(killed[0])
    assert multiprocessing.active_children() == []
    assert not list(tmp_path.rglob("*.part"))


def test_worker_that_cannot_write_ends_the_run_and_names_its_scan(tmp_path: Path) -> None:
    def spoil(stage: str, done: int, total: int) -> None:
        if stage == "scans" and (tmp_path / "truth").is_dir():
            (tmp_path / "truth").rmdir()
            (tmp_path / "truth").touch()

    with pytest.raises(
        WorkerError, match=r"worker \d failed while making scan \d:\n(.|\n)*NotADirectoryError"
    ):
        write_dataset(tmp_path, CONFIG, workers=2, progress=spoil)
    assert multiprocessing.active_children() == []
    assert not list(tmp_path.rglob("*.png"))


@pytest.mark.parametrize(
    ("scans", "first", "second"),
    [(1, [0], []), (2, [0], [1]), (3, [0, 1], [2]), (4, [0, 1], [2]), (9, [0, 1], [2, 3])],
)
def test_worker_gets_a_second_scan_ahead_only_where_enough_are_left_for_the_others(
    tmp_path: Path, scans: int, first: list[int], second: list[int]
) -> None:
    pool = WorkerPool(tmp_path, CONFIG, cast("Any", None), workers=2, threads=1)
    pipes = [Pipe() for _ in range(2)]
    pool._to_do = deque(range(scans))
    for pipe in pipes:
        pool._busy[cast("Any", pipe)] = deque()
        pool._hand_out(cast("Any", pipe))
    assert [pipe.sent for pipe in pipes] == [first, second]
    assert len(pool._busy) == bool(first) + bool(second)


class Pipe:
    """Keeps what is sent into it."""

    def __init__(self) -> None:
        self.sent: list[int] = []

    def send(self, index: int) -> None:
        self.sent.append(index)


def test_another_configuration_is_not_resumed_and_the_setting_is_named(made: Path) -> None:
    before = _bytes(made)
    other = SimulationConfig(preset="empty", seed=3, scans=4, trace=TraceSettings(rays=32))
    with pytest.raises(DatasetError, match=r"trace\.rays was 16, now it is 32"):
        write_dataset(made, other, resume=True)
    assert _bytes(made) == before


def test_full_folder_is_refused_and_left_alone(tmp_path: Path) -> None:
    (tmp_path / "diary.txt").write_text("dear")
    with pytest.raises(DatasetError, match="OUT must be empty or new"):
        write_dataset(tmp_path, CONFIG)
    with pytest.raises(DatasetError, match="is not a data set"):
        write_dataset(tmp_path, CONFIG, resume=True)
    assert [path.name for path in tmp_path.iterdir()] == ["diary.txt"]


@pytest.mark.parametrize("there", [True, False])
def test_nothing_is_left_when_the_first_step_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, there: bool
) -> None:
    def fail(*arguments: object, **settings: object) -> None:
        raise ArithmeticError("no town")

    monkeypatch.setenv("ECHOSCAPE_CACHE", "off")
    monkeypatch.setattr(stage, "build_town", fail)
    out = tmp_path / "a" / "b"
    if there:
        out.mkdir(parents=True)
    with pytest.raises(ArithmeticError):
        write_dataset(out, CONFIG)
    assert out.exists() == there
    assert (tmp_path / "a").exists() == there
    assert not there or list(out.iterdir()) == []


@pytest.mark.parametrize(("workers", "threads", "name"), [(0, None, "workers"), (1, 0, "threads")])
def test_fewer_than_one_worker_or_thread_is_refused(
    tmp_path: Path, workers: int, threads: int | None, name: str
) -> None:
    with pytest.raises(ValueError, match=f"{name} must be 1 or more, got 0"):
        write_dataset(tmp_path / "set", CONFIG, workers=workers, threads=threads)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("value", [math.nan, math.inf, -1.0])
def test_invalid_traffic_is_refused_by_name(value: float) -> None:
    with pytest.raises(ValueError, match="vehicles_per_km2 must be between 0 and 1000"):
        SimulationConfig(traffic=TrafficSettings(vehicles_per_km2=value))


@pytest.mark.slow
def test_town_has_the_same_bytes_from_one_and_two_workers(tmp_path: Path) -> None:
    config = SimulationConfig(preset="town", seed=7, scans=3)
    write_dataset(tmp_path / "one", config)
    write_dataset(tmp_path / "two", config, workers=2)
    _assert_same_bytes(tmp_path / "one", tmp_path / "two")


@pytest.mark.parametrize("lost", ["truth", "radar", "scene.glb", "tracks.csv"])
def test_resume_makes_whatever_is_missing(made: Path, tmp_path: Path, lost: str) -> None:
    out = tmp_path / "set"
    write_dataset(out, CONFIG)
    path = out / lost
    (sorted(path.iterdir())[1] if path.is_dir() else path).unlink()
    write_dataset(out, CONFIG, resume=True)
    _assert_same_bytes(out, made)


@pytest.fixture(scope="module")
def with_beat(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("beat") / "set"
    write_dataset(out, replace(CONFIG, keep_beat=True))
    return out


@pytest.mark.parametrize("kind", ["radar", "truth", "beat"])
def test_resume_makes_again_what_was_cut_short(with_beat: Path, tmp_path: Path, kind: str) -> None:
    out = Path(shutil.copytree(with_beat, tmp_path / "set"))
    config = replace(CONFIG, keep_beat=True)
    nothing, half, nearly, whole = sorted((out / kind).iterdir())
    for path, size in ((nothing, 0), (half, half.stat().st_size // 2), (nearly, nearly.stat().st_size - 1)):
        os.truncate(path, size)
    assert complete_scans(out, config) == {whole.stem}
    before = whole.stat().st_mtime_ns
    write_dataset(out, config, resume=True)
    assert whole.stat().st_mtime_ns == before
    _assert_same_bytes(out, with_beat)


def test_failed_start_leaves_other_peoples_datasets_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    neighbour = tmp_path / "sets" / "other" / "finished.txt"

    def build(preset: str, *, seed: int) -> None:
        neighbour.parent.mkdir()
        neighbour.write_text("a day's work")
        raise KeyboardInterrupt

    monkeypatch.setenv("ECHOSCAPE_CACHE", "off")
    monkeypatch.setattr(stage, "build_town", build)
    with pytest.raises(KeyboardInterrupt):
        write_dataset(tmp_path / "sets" / "mine", CONFIG)
    assert neighbour.read_text() == "a day's work"
    assert not (tmp_path / "sets" / "mine").exists()


@pytest.mark.parametrize(
    ("name", "scan_lost"),
    [("movers.csv", False), ("tracks.csv", False), ("tracks.csv", True), ("scene.glb", False)],
)
def test_resume_makes_again_what_was_cut_short_of_the_scenery(
    made: Path, tmp_path: Path, name: str, scan_lost: bool
) -> None:
    out = Path(shutil.copytree(made, tmp_path / "set"))
    os.truncate(out / name, (out / name).stat().st_size - 1)
    if scan_lost:
        next((out / "radar").iterdir()).unlink()
    write_dataset(out, CONFIG, resume=True)
    _assert_same_bytes(out, made)


def test_resume_makes_a_scan_again_whose_image_is_damaged(made: Path, tmp_path: Path) -> None:
    out = Path(shutil.copytree(made, tmp_path / "set"))
    damaged, *others = sorted((out / "radar").iterdir())
    data = bytearray(damaged.read_bytes())
    data[5000] ^= 0xFF
    damaged.write_bytes(data)
    assert complete_scans(out, CONFIG) == {path.stem for path in others}
    write_dataset(out, CONFIG, resume=True)
    _assert_same_bytes(out, made)
