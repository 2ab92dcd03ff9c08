"""The cache changes the time that a world takes, and nothing else, whatever lies in its folder."""

import json
import logging
import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from echoscape.scenes.core.scene import Mover, Scene
from echoscape.scenes.core.targets import Target
from echoscape.scenes.driving.ego_drive import plan_ego_drive
from echoscape.scenes.town.build import build_town
from echoscape.scenes.traffic.plan import TrafficSettings, plan_traffic
from echoscape.sim.datasets.files.record_file import record_bytes, record_of
from echoscape.sim.generation import cache as stage
from echoscape.sim.generation import setup as setup_stage
from echoscape.sim.generation.cache import cache_folder, cached, code_digest
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.setup import SceneSetup, add_traffic, build_scene
from echoscape.sim.generation.single_scan import build_simulator
from echoscape.sim.settings.tracing import TraceSettings
from tests.sim.custom_scene import user_scene_file
from tests.sim.datasets.files.test_record_file import same

SLOW = [pytest.param(each, marks=pytest.mark.slow) for each in ("suburb", "industrial", "town")]
PRESETS = ["empty", "open", "motorway", *SLOW]
CONFIG = SimulationConfig(preset="empty", seed=3, scans=4, trace=TraceSettings(rays=16))


@dataclass(frozen=True, kw_only=True)
class Thing:
    values: NDArray[np.float64]
    note: object = None


class Builder:
    """Builds things of one value, and counts them."""

    def __init__(self, value: float = 1.0, note: object = None) -> None:
        self.thing, self.built = Thing(values=np.full(1000, value), note=note), 0

    def __call__(self) -> Thing:
        self.built += 1
        return self.thing

    def cached(self, **settings: object) -> Thing:
        return cached("thing", Thing, settings, self)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("ECHOSCAPE_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(stage, "code_digest", lambda *_: "of the code")  # whoever edits it meanwhile
    return tmp_path / "cache"


def only_file(folder: Path) -> Path:
    (path,) = folder.iterdir()
    return path


def same_setup(first: SceneSetup, second: SceneSetup) -> bool:
    return all(same(getattr(first, name), getattr(second, name)) for name in ("scene", "drive", "movers"))


# What is kept


@pytest.mark.parametrize("preset", PRESETS)
def test_every_field_of_town_and_traffic_comes_back_equal(preset: str) -> None:
    town = build_town(preset, seed=7)
    drive = plan_ego_drive(town, seed=7, duration_s=5.0)
    movers = plan_traffic(town, drive, seed=7)
    for record, kind in ((town, Scene), (drive, type(drive)), (movers, tuple[Mover, ...])):
        data = record_bytes(record, kind, key="")
        assert same(record_of(bytearray(data), kind, key=""), record)


@pytest.mark.parametrize("preset", PRESETS)
def test_scans_have_the_same_bytes_without_cache_cold_and_warm(
    folder: Path, monkeypatch: pytest.MonkeyPatch, preset: str
) -> None:
    config = replace(CONFIG, preset=preset)
    cold, warm = (build_simulator(config).scan(1) for _ in range(2))
    assert sorted(path.name.partition("-")[0] for path in folder.iterdir()) == ["drive", "town", "traffic"]
    monkeypatch.setenv("ECHOSCAPE_CACHE", "off")
    assert cold == warm == build_simulator(config).scan(1)


@pytest.mark.usefixtures("folder")
def test_numbers_of_numpy_are_kept_as_the_same_settings() -> None:
    builder = Builder()
    for settings in ({"a": 7, "b": {"c": 0.5}}, {"a": np.int64(7), "b": {"c": np.float32(0.5)}}):
        assert same(builder.cached(**settings), builder.thing)
    assert builder.built == 1
    with pytest.raises(TypeError, match=r"a setting must be made of numbers, words and lists, got \{1\}"):
        builder.cached(a={1})


def test_a_second_run_builds_nothing(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = add_traffic(build_scene(CONFIG), CONFIG)

    def fail(*arguments: object, **settings: object) -> None:
        raise AssertionError("built again")

    monkeypatch.setattr(setup_stage, "build_town", fail)
    monkeypatch.setattr(setup_stage, "plan_ego_drive", fail)
    monkeypatch.setattr(setup_stage, "plan_traffic", fail)
    assert same_setup(add_traffic(build_scene(CONFIG), CONFIG), first)
    with pytest.raises(AssertionError):
        build_scene(replace(CONFIG, seed=4))


@pytest.mark.parametrize(
    "change",
    [
        {"preset": "open"},
        {"seed": 4},
        {"scans": 9},
        {"drive": replace(CONFIG.drive, wander_m=0.3)},
        {"traffic": TrafficSettings(vehicles_per_km2=300.0, near_m=400.0)},
        {"targets": (Target(kind="point", position_m=(500.0, 500.0, 1.0)),)},
    ],
)
def test_a_warm_cache_of_other_settings_changes_nothing(
    folder: Path, monkeypatch: pytest.MonkeyPatch, change: dict
) -> None:
    add_traffic(build_scene(CONFIG), CONFIG)
    config = replace(CONFIG, **change)
    found = add_traffic(build_scene(config), config)
    monkeypatch.setenv("ECHOSCAPE_CACHE", "off")
    assert same_setup(found, add_traffic(build_scene(config), config))


def test_custom_scenes_are_not_kept(folder: Path, tmp_path: Path) -> None:
    from echoscape.scenes.io.user_scene import read_user_scene

    scene = read_user_scene(user_scene_file(tmp_path / "files"))
    config = SimulationConfig(scene=scene, scans=2, trace=TraceSettings(rays=16))
    add_traffic(build_scene(config), config)
    assert not folder.exists()


# The key


def test_settings_code_and_versions_each_decide_what_is_found(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    build = Builder()
    for _ in range(2):
        build.cached(seed=1)
    assert build.built == 1
    build.cached(seed=2)
    assert build.built == 2
    monkeypatch.setattr(stage, "code_digest", lambda *_: "changed")
    build.cached(seed=1)
    assert build.built == 3
    monkeypatch.setattr(stage, "_versions", lambda: {"numpy": "99"})
    build.cached(seed=1)
    assert build.built == 4


def test_the_code_is_digested_whole_and_in_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def digest(started_ns: int, packages: tuple[str, ...] = ("scenes",), **sources: str) -> str | None:
        for path in tmp_path.glob("*/*.py"):
            path.unlink()
        for name, text in sources.items():
            folder = tmp_path / ("sim" if name.startswith("sim_") else "scenes")
            folder.mkdir(exist_ok=True)
            (folder / f"{name}.py").write_text(text)
        monkeypatch.setattr(stage.scenes, "__file__", str(tmp_path / "scenes" / "__init__.py"))
        monkeypatch.setattr(stage, "_STARTED_NS", started_ns)
        code_digest.cache_clear()
        try:
            return code_digest(packages)
        finally:
            code_digest.cache_clear()

    late = time.time_ns() + 10**12
    first = digest(late, a="x = 1", b="y = 2")
    assert first == digest(late, b="y = 2", a="x = 1")
    others = [digest(late, a="x = 1", b="y = 3"), digest(late, a="x = 1", c="y = 2"), digest(late, a="x = 1")]
    assert len({first, *others}) == 4
    assert digest(late, a="x = 1", b="y = 2", sim_c="z = 3") == first  # code of other packages
    both = ("scenes", "sim")
    assert digest(late, both, a="x = 1", sim_c="z = 3") != digest(late, both, a="x = 1", sim_c="z = 4")
    assert digest(late) is None
    assert digest(0, a="x = 1") is None  # edited since this process has started


def test_nothing_is_kept_where_the_code_may_have_changed(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stage, "code_digest", lambda *_: None)
    assert Builder().cached().values[0] == 1.0
    assert not folder.exists()


# The folder


@pytest.mark.parametrize("value", ["", "0", "off", "OFF"])
def test_the_cache_can_be_switched_off(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, value: str) -> None:
    monkeypatch.setenv("ECHOSCAPE_CACHE", value)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    build = Builder()
    for _ in range(2):
        build.cached()
    assert cache_folder() is None
    assert build.built == 2
    assert list(tmp_path.iterdir()) == []


def test_the_default_folder_is_that_of_the_platform(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("ECHOSCAPE_CACHE")
    monkeypatch.setenv("HOME", "/home/somebody")
    for base, expected in (
        ("/var/cache/mine", "/var/cache/mine/echoscape"),
        ("relative", "/home/somebody/.cache/echoscape"),
        ("", "/home/somebody/.cache/echoscape"),
    ):
        monkeypatch.setenv("XDG_CACHE_HOME", base)
        assert cache_folder() == Path(expected)
    monkeypatch.delenv("XDG_CACHE_HOME")
    assert cache_folder() == Path("/home/somebody/.cache/echoscape")


def test_only_the_user_can_read_or_write_what_is_kept(folder: Path) -> None:
    before = os.umask(0)
    try:
        Builder().cached()
    finally:
        os.umask(before)
    assert folder.stat().st_mode & 0o777 == 0o700
    assert only_file(folder).stat().st_mode & 0o777 == 0o600


def test_a_folder_that_cannot_be_made_is_logged_and_otherwise_ignored(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("ECHOSCAPE_CACHE", str(tmp_path / "file" / "cache"))
    with caplog.at_level(logging.WARNING):
        assert Builder(2.0).cached().values[0] == 2.0
    assert "thing of this run is not kept" in caplog.text


def test_a_full_disk_is_logged_and_otherwise_ignored(
    folder: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def full(path: Path, data: bytes) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(stage, "write_atomic", full)
    assert Builder(2.0).cached().values[0] == 2.0
    assert "No space left" in caplog.text


def test_a_value_of_an_unknown_type_is_not_kept_but_logged(
    folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    build = Builder(note=Path("x"))
    assert build.cached() is build.cached() is build.thing
    assert build.built == 2
    assert "PosixPath cannot be stored" in caplog.text
    assert not folder.exists()


# What lies there


def _garbage(path: Path) -> None:
    path.write_bytes(b"garbage" * 1000)


def _cut(path: Path) -> None:
    os.truncate(path, path.stat().st_size // 2)


def _empty(path: Path) -> None:
    os.truncate(path, 0)


def _flip(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[-4000] ^= 1
    path.write_bytes(content)


def _another(path: Path) -> None:
    """The whole and valid file of other settings under this name."""
    other = Builder(9.0)
    other.cached(seed=9)
    (found,) = set(path.parent.iterdir()) - {path}
    found.replace(path)


def _writable_by_all(path: Path) -> None:
    path.chmod(0o666)


def _link(path: Path) -> None:
    """A link to a valid file elsewhere."""
    path.rename(path.parent.parent / "elsewhere")
    path.symlink_to(path.parent.parent / "elsewhere")


def _pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path, 0o600)


@pytest.mark.parametrize("spoil", [_garbage, _cut, _empty, _flip, _another, _writable_by_all, _link, _pipe])
def test_a_broken_or_foreign_file_is_built_again_and_replaced(
    folder: Path, caplog: pytest.LogCaptureFixture, spoil: Callable[[Path], None]
) -> None:
    build = Builder()
    build.cached()
    path = only_file(folder)
    spoil(path)
    for _ in range(2):
        assert same(build.cached(), build.thing)
    assert build.built == 2
    assert "is built again" in caplog.text
    assert path.is_file()
    assert not path.is_symlink()


def test_a_link_is_replaced_and_what_it_points_to_left_alone(folder: Path, tmp_path: Path) -> None:
    build = Builder()
    build.cached()
    path = only_file(folder)
    path.unlink()
    (tmp_path / "diary").write_text("dear")
    path.symlink_to(tmp_path / "diary")
    build.cached()
    assert (tmp_path / "diary").read_text() == "dear"


def test_a_folder_in_the_place_of_a_file_is_left_alone(folder: Path) -> None:
    build = Builder()
    build.cached()
    path = only_file(folder)
    path.unlink()
    path.mkdir()
    assert same(build.cached(), build.thing)
    assert path.is_dir()
    assert list(folder.iterdir()) == [path]


def test_nothing_is_unpickled(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*arguments: object, **settings: object) -> None:
        raise AssertionError("unpickled")

    for name in ("load", "loads", "Unpickler"):
        monkeypatch.setattr(f"pickle.{name}", fail)
    for _ in range(2):
        Builder().cached()


# Size and company


def test_what_was_not_used_for_longest_is_removed_first(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    build = Builder()
    build.cached(seed=0)
    size = only_file(folder).stat().st_size
    monkeypatch.setattr(stage, "MOST_BYTES", 3 * size)
    names = {0: only_file(folder)}
    for seed in (1, 2):
        build.cached(seed=seed)
        (names[seed],) = set(folder.iterdir()) - set(names.values())
    for seed, age_s in ((0, 300), (1, 200), (2, 100)):
        os.utime(names[seed], (time.time() - age_s, time.time() - age_s))
    assert build.built == 3
    build.cached(seed=0)  # used again, so that 1 is the oldest
    assert build.built == 3
    build.cached(seed=3)
    assert sorted(seed for seed, path in names.items() if path.exists()) == [0, 2]
    assert sum(path.stat().st_size for path in folder.iterdir()) <= 3 * size


def test_what_is_larger_than_the_cache_is_not_kept(
    folder: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    Builder().cached(seed=0)
    monkeypatch.setattr(stage, "MOST_BYTES", only_file(folder).stat().st_size + 100)
    large = Thing(values=np.zeros(10_000))
    assert cached("large", Thing, {}, lambda: large) is large
    assert only_file(folder).name.startswith("thing-")
    assert "large of this run is not kept" in caplog.text


def test_other_files_in_the_folder_are_left_alone(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder.mkdir()
    for name in ("notes.txt", "town.echoscape", ".x.1.part"):
        (folder / name).write_text("mine")
        os.utime(folder / name, (0, 0))
    abandoned = folder / f".town-{'a' * 32}.echoscape.123.part"
    abandoned.write_text("half")
    os.utime(abandoned, (0, 0))
    monkeypatch.setattr(stage, "MOST_BYTES", 20_000)
    for seed in range(5):
        Builder().cached(seed=seed)
    kept = [path.name for path in folder.iterdir()]
    assert {"notes.txt", "town.echoscape", ".x.1.part"} < set(kept)
    assert abandoned.name not in kept
    assert sum("thing-" in name for name in kept) == 2


_PROCESS = """
import sys, json
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.setup import build_scene
from echoscape.sim.datasets.files.record_file import record_bytes
from echoscape.scenes.core.scene import Scene
import hashlib
scene = build_scene(SimulationConfig(preset="empty", seed=5, scans=2)).scene
print(json.dumps(hashlib.sha256(record_bytes(scene, Scene, key="")).hexdigest()))
"""


def test_processes_that_build_the_same_town_at_once_agree(folder: Path) -> None:
    running = [
        subprocess.Popen([sys.executable, "-c", _PROCESS], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        for _ in range(2)
    ]
    ended = [each.communicate() for each in running]
    assert [error for _, error in ended] == [b"", b""]
    assert len({json.loads(output) for output, _ in ended}) == 1
    assert sorted(path.name.partition("-")[0] for path in folder.iterdir()) == ["drive", "town"]
