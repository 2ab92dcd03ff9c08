"""Scenes and targets of one's own as datasets: the same bytes wherever they lie, or a plain refusal."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from echoscape.scenes.core.scene import CLASSES
from echoscape.scenes.core.targets import Target
from echoscape.scenes.io.strict_toml import SceneError
from echoscape.scenes.io.target_toml import FromStart
from echoscape.scenes.io.user_scene import read_user_scene
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.files.truth_npz import read_truth
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.dataset import write_dataset
from echoscape.sim.generation.setup import build_scene
from echoscape.sim.settings.tracing import TraceSettings
from tests.sim.custom_scene import SCENE, WALL, user_scene_file

FEW = TraceSettings(rays=16)


def _config(path: Path, *, scans: int = 2) -> SimulationConfig:
    return SimulationConfig(scene=read_user_scene(path), scans=scans, trace=FEW)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("custom")
    write_dataset(folder / "set", _config(user_scene_file(folder / "files")))
    return folder / "set"


def _bytes(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_bytes_do_not_depend_on_where_the_files_lie_nor_on_workers(
    made: Path, tmp_path: Path, workers: int
) -> None:
    write_dataset(tmp_path / "set", _config(user_scene_file(tmp_path / "elsewhere")), workers=workers)
    first, second = _bytes(made), _bytes(tmp_path / "set")
    assert first.keys() == second.keys()
    assert [name for name in first if first[name] != second[name]] == []


def test_the_manifest_holds_the_description_and_the_hash_but_no_place(made: Path) -> None:
    content = json.loads((made / "echoscape.json").read_text())
    scene = content["config"]["scene"]
    assert (content["config"]["preset"], scene["file"], len(scene["sha256"])) == ("custom", "wall.obj", 64)
    assert scene["rules"][0]["material"] == "metal"
    assert str(made.parent) not in (made / "echoscape.json").read_text()


def test_the_wall_is_where_it_was_put_and_is_the_object_of_the_truth(made: Path) -> None:
    paths = sorted((made / "truth").iterdir())
    cells = read_truth(paths[0]).cells
    # The antenna is 20 m from the wall; in a quarter of a second it comes 2.5 m nearer.
    hit = np.flatnonzero(cells.instance[0] == 1) * 0.0432
    assert 19.0 < np.median(hit) < 20.1
    assert set(np.unique(cells.class_id)) == {0, CLASSES.index("wall")}
    assert (made / "movers.csv").read_text().count("\n") == 1


def test_a_changed_mesh_or_description_is_not_resumed(made: Path, tmp_path: Path) -> None:
    out = tmp_path / "set"
    shutil.copytree(made, out)
    path = user_scene_file(tmp_path / "files")
    before = _bytes(out)
    write_dataset(out, _config(path), resume=True)
    (path.parent / "wall.obj").write_text(WALL.replace("20", "21"))
    with pytest.raises(DatasetError, match=r"scene\.sha256 was "):
        write_dataset(out, _config(path), resume=True)
    with pytest.raises(DatasetError, match=r"scene\.scale was 1\.0, now it is 2\.0"):
        write_dataset(out, _config(user_scene_file(tmp_path / "files", "scale = 2\n" + SCENE)), resume=True)
    assert _bytes(out) == before


def test_a_mesh_that_is_found_broken_leaves_nothing(tmp_path: Path) -> None:
    path = user_scene_file(tmp_path / "files")
    (path.parent / "wall.obj").write_text(WALL + "f 1 2 77\n")
    with pytest.raises(SceneError, match="a face refers to vertex 77"):
        write_dataset(tmp_path / "set", _config(path))
    assert not (tmp_path / "set").exists()


def test_scans_beyond_the_drive_are_refused_and_the_most_is_named(tmp_path: Path) -> None:
    path = user_scene_file(tmp_path)  # 12 m at 10 m/s: 1.2 s, and a turn lasts up to 0.25325 s
    build_scene(_config(path, scans=4))
    refusal = r"scans must be 4 or fewer: the drive lasts 1\.20 s, a scan up to 0\.25325 s; got 5"
    with pytest.raises(SceneError, match=refusal):
        build_scene(_config(path, scans=5))
    build_scene(_config(path, scans=5), whole_drive=True)


def test_a_drive_through_a_wall_is_refused_with_its_name_time_and_place(tmp_path: Path) -> None:
    path = user_scene_file(tmp_path, SCENE.replace("[12, 0]", "[32, 0]"))
    with pytest.raises(
        SceneError, match=r"passes through object 'wall' 1\.8 s after its start, at x 17\.\d m"
    ):
        build_scene(_config(path, scans=12))
    build_scene(_config(path, scans=4))  # which end before it


def test_a_preset_beside_a_scene_is_refused(tmp_path: Path) -> None:
    scene = read_user_scene(user_scene_file(tmp_path))
    with pytest.raises(ValueError, match="preset must not be given beside a scene, got 'open'"):
        SimulationConfig(preset="open", scene=scene)
    assert SimulationConfig().preset == "town"
    config = SimulationConfig(scene=scene)
    assert replace(config, scans=3).preset == config.preset == "custom"
    with pytest.raises(ValueError, match=r"preset must be one of town, .*, got 'custom'"):
        SimulationConfig(preset="custom")


AHEAD = FromStart(target=Target(kind="wall", position_m=(15.0, 0.0, 0.0), size_m=(2.0, 2.0, 0.2)))
BESIDE = FromStart(target=Target(kind="sphere", position_m=(12.0, 7.0, 1.5), size_m=(0.2,)))


def test_targets_stand_as_seen_from_the_start_of_a_preset_drive() -> None:
    config = SimulationConfig(preset="empty", seed=3, scans=1, targets=(BESIDE,))
    setup = build_scene(config)
    (placed,) = setup.scene.targets
    x, y, z, yaw = setup.drive.trajectory.pose(np.float64(0.0))
    offset = np.array(placed.target.position_m) - (x, y, z)
    expected = 12 * np.array([np.cos(yaw), np.sin(yaw)]) + 7 * np.array([np.sin(yaw), -np.cos(yaw)])
    assert_allclose(offset, (*expected, 1.5), atol=1e-9)
    assert setup.scene.instance_class[placed.instance] == CLASSES.index("target")
    assert len(setup.scene.instance_class) == placed.instance + 1


def test_a_target_in_the_path_is_refused() -> None:
    config = SimulationConfig(preset="empty", seed=3, scans=40, targets=(BESIDE, AHEAD))
    with pytest.raises(SceneError, match=r"passes through target 2 \(wall\) \d\.\d s after its start"):
        build_scene(config)


def test_targets_are_part_of_the_configuration_and_movers_come_after_them(tmp_path: Path) -> None:
    config = SimulationConfig(preset="empty", seed=3, scans=1, trace=FEW, targets=(BESIDE,))
    write_dataset(tmp_path / "set", config)
    found = json.loads((tmp_path / "set" / "echoscape.json").read_text())["config"]["targets"]
    assert found[0]["target"]["position_m"] == [12.0, 7.0, 1.5]
    movers = (tmp_path / "set" / "movers.csv").read_text().splitlines()[1:]
    instance = build_scene(config).scene.targets[0].instance
    assert all(int(row.split(",")[0]) > instance for row in movers)
    with pytest.raises(DatasetError, match=r"targets had 1 entry, now it has 0"):
        write_dataset(tmp_path / "set", replace(config, targets=()), resume=True)
