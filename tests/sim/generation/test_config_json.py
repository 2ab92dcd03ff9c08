"""A configuration read from an echoscape.json is the one that it was written from, or the entry is named."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from echoscape.scenes.core.targets import Target
from echoscape.scenes.driving.ego_drive import DriveSettings
from echoscape.scenes.io.target_toml import FromStart
from echoscape.scenes.io.user_scene import UserScene, read_user_scene
from echoscape.scenes.town.presets import PRESETS
from echoscape.scenes.traffic.plan import TrafficSettings
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.files.metadata import manifest_text
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.config_json import config_of, read_config
from echoscape.sim.generation.domain_randomization import randomized
from echoscape.sim.generation.manifest import manifest
from echoscape.sim.sensor.registry import SENSORS
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.sim.settings.tracing import TraceSettings
from tests.sim.custom_scene import user_scene_file

POINT = Target(kind="point", position_m=(25.0, 4.0, 1.0), rcs_m2=3.0)
PLATE = Target(kind="plate", position_m=(30, 1, 2), heading_rad=3.1, size_m=(0.5, 0.25), material="brick")
NUMPYS: dict[str, Any] = {"seed": np.int64(3), "scans": np.int16(7)}
CONFIGS = {
    "defaults": SimulationConfig(),
    **{name: SimulationConfig(preset=name, seed=3, scans=7) for name in PRESETS},
    **{name: SimulationConfig(sensor=sensor) for name, sensor in SENSORS.items()},
    "numbers of NumPy": SimulationConfig(**NUMPYS),
    "layout": SimulationConfig(sensor=SENSORS["cir204"], layout="boreas", keep_beat=True),
    "artefacts": SimulationConfig(artefacts=Artefacts(rain=5.0, ghosts=0, doppler=0.01, quantisation=None)),
    "targets": SimulationConfig(targets=(POINT, FromStart(target=PLATE))),
    "whole numbers": SimulationConfig(trace=TraceSettings(rays=16, floor_db=-3)),
    **{f"randomized {seed}": randomized(SimulationConfig(seed=seed)) for seed in range(4)},
}


def written(config: SimulationConfig) -> str:
    return manifest_text(manifest(config))


@pytest.mark.parametrize("name", CONFIGS)
def test_a_configuration_read_again_is_the_same_and_is_written_alike(name: str, tmp_path: Path) -> None:
    (tmp_path / "echoscape.json").write_text(written(CONFIGS[name]))
    for path in (tmp_path, tmp_path / "echoscape.json"):
        found = read_config(path)
        assert found == CONFIGS[name]
        assert written(found) == written(CONFIGS[name])


def test_drive_and_traffic_settings_are_read_again() -> None:
    drive, traffic = DriveSettings(corner_m=9.0), TrafficSettings(vehicles_per_km2=12.0)
    config = SimulationConfig(drive=drive, traffic=traffic)
    assert config != SimulationConfig()
    assert config_of(json.loads(written(config))) == config


# ---------------------------------------------------------------------- custom scenes


@pytest.fixture
def custom(tmp_path: Path) -> SimulationConfig:
    return SimulationConfig(
        scene=read_user_scene(user_scene_file(tmp_path / "files")),
        scans=2,
        targets=(FromStart(target=POINT),),
    )


def test_a_custom_scene_is_found_beside_the_manifest(tmp_path: Path, custom: SimulationConfig) -> None:
    (tmp_path / "set").mkdir()
    (tmp_path / "set" / "echoscape.json").write_text(written(custom))
    shutil.copy(tmp_path / "files" / "wall.obj", tmp_path / "set")
    found = read_config(tmp_path / "set")
    assert isinstance(found.scene, UserScene)
    assert found.scene.mesh_path == tmp_path / "set" / "wall.obj"
    assert replace(found, scene=custom.scene, preset="") == custom
    assert written(found) == written(custom)


def test_a_custom_scene_can_be_given_again(tmp_path: Path, custom: SimulationConfig) -> None:
    (tmp_path / "echoscape.json").write_text(written(custom))
    assert read_config(tmp_path, scene=custom.scene) == custom


def test_a_custom_scene_that_is_missing_or_changed_is_refused(
    tmp_path: Path, custom: SimulationConfig
) -> None:
    (tmp_path / "echoscape.json").write_text(written(custom))
    with pytest.raises(DatasetError, match=r"wall\.obj is recorded without its folder; give the TOML file"):
        read_config(tmp_path)
    (tmp_path / "wall.obj").write_text("v 0 0 0\n")
    with pytest.raises(DatasetError, match=r"wall\.obj is not the mesh of the data set"):
        read_config(tmp_path)


# ---------------------------------------------------------------------- damage


def remove(*names: str) -> Callable[[dict[str, Any]], None]:
    def change(content: dict[str, Any]) -> None:
        for name in names[:-1]:
            content = content[name]
        del content[names[-1]]

    return change


def put(value: Any, *names: str) -> Callable[[dict[str, Any]], None]:
    def change(content: dict[str, Any]) -> None:
        for name in names[:-1]:
            content = content[name]
        content[names[-1]] = value

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (remove("config"), "config is missing"),
        (remove("config", "seed"), r"config\.seed is missing"),
        (remove("config", "sensor", "bins"), r"config\.sensor\.bins is missing"),
        (put(1, "config", "moon"), r"config\.moon is unknown; config has preset, seed"),
        (put(1, "config", "artefacts", "fog"), r"config\.artefacts\.fog is unknown"),
        (put("x", "config", "scans"), r"config\.scans must be a whole number, got 'x'"),
        (put(True, "config", "scans"), r"config\.scans must be a whole number, got True"),
        (put(1.5, "config", "seed"), r"config\.seed must be a whole number, got 1\.5"),
        (put(0, "config", "scans"), r"config: scans must be 1 or more, got 0"),
        (put("moon", "config", "layout"), r"config\.layout must be one of 'oxford', 'mulran', 'boreas'"),
        (put([[0, 1, 2]], "config", "sensor", "leakage_dbm"), r"leakage_dbm\[0\] must have 2 entries, got 3"),
        (put(3, "config", "trace"), r"config\.trace must be a table, got 3"),
        (put({"kind": "ufo"}, "config", "targets"), r"config\.targets must be a list"),
        (put([{"kind": "ufo"}], "config", "targets"), r"config\.targets\[0\]\.position_m is missing"),
        (put(-1.0, "config", "artefacts", "rain"), r"config\.artefacts: rain must be between 0 and 150"),
        (put(2, "format"), "must be of format 3, got 2, written by an earlier version"),
    ],
)
def test_damage_is_refused_by_entry_and_file(
    tmp_path: Path, change: Callable[[dict[str, Any]], None], message: str
) -> None:
    content = json.loads(written(SimulationConfig()))
    change(content)
    (tmp_path / "echoscape.json").write_text(json.dumps(content))
    with pytest.raises(DatasetError, match=message) as refused:
        read_config(tmp_path)
    assert str(tmp_path) in str(refused.value)


def test_an_absent_manifest_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"echoscape\.json: no such file"):
        read_config(tmp_path)
    with pytest.raises(DatasetError, match=r"other\.json: no such file"):
        read_config(tmp_path / "other.json")


def test_scans_with_faults_of_the_sensor_are_not_simulated_as_if_they_had_none() -> None:
    content = json.loads(written(SimulationConfig())) | {"faults": {"clock_jitter": 0.02}}
    with pytest.raises(DatasetError, match="faults: scans with sensor faults are made by echoscape ablate"):
        config_of(content)
