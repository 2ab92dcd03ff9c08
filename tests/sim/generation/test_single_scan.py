"""One scan by preset and seed is the scan of the data set of the same settings."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from echoscape.sim.datasets.scan_folder import open_folder
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.dataset import write_dataset
from echoscape.sim.generation.single_scan import DEFAULT_SCANS, scan
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.sensor.cts_small import CTS_SMALL
from echoscape.sim.settings.artefacts import Artefacts

FEW = replace(CTS350X, azimuths=40, encoder_per_turn=5600)


def test_scan_equals_that_of_the_data_set(tmp_path: Path) -> None:
    settings = {"preset": "empty", "seed": 3, "scans": 3, "sensor": FEW, "artefacts": Artefacts(rain=5.0)}
    write_dataset(tmp_path / "set", SimulationConfig(**settings))
    folder = open_folder(tmp_path / "set")
    for index in (2, 0):
        found = scan(index=index, **settings)
        assert found == replace(folder.read(index), truth=found.truth)
        assert found.truth == folder.truth(index)
    assert scan(index=1, **settings) != scan(index=2, **settings)


@pytest.mark.parametrize("index", [-1, DEFAULT_SCANS])
def test_index_outside_of_the_drive_is_refused(index: int) -> None:
    with pytest.raises(ValueError, match=rf"index must be from 0 to scans - 1 \({DEFAULT_SCANS - 1}\)"):
        scan("empty", seed=1, index=index)


def test_unknown_preset_is_refused() -> None:
    with pytest.raises(ValueError, match="preset must be one of"):
        scan("moon", seed=1)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"sensor": 5}, "sensor must be of type Sensor or str, got 5"),
        ({"artefacts": 5}, "artefacts must be of type Artefacts or Mapping or None, got 5"),
        ({"artefacts": "ghosts"}, "artefacts must be of type Artefacts or Mapping or None, got 'ghosts'"),
    ],
)
def test_arguments_of_another_type_are_refused_by_name(changes: dict, message: str) -> None:
    with pytest.raises(TypeError, match=f"^{message}"):
        scan("empty", seed=1, **changes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"sensor": "moon"}, "a sensor must be one of cts350x, .* got 'moon'"),
        ({"artefacts": {"moon": 1.0}}, "an artefact must be one of speckle, ghosts, .* got 'moon'"),
        ({"artefacts": {"ghosts": -1.0}}, "ghosts must be .* got -1"),
    ],
)
def test_names_and_strengths_that_there_are_not_are_refused(changes: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        scan("empty", seed=1, **changes)


def test_names_of_radars_and_artefacts_are_the_same_arguments() -> None:
    named = scan("empty", seed=3, scans=2, sensor="cts_small", artefacts={"rain": 5.0, "ghosts": False})
    given = Artefacts(rain=5.0, ghosts=0.0)
    assert named == scan("empty", seed=3, scans=2, sensor=CTS_SMALL, artefacts=given)
    assert named != scan("empty", seed=3, scans=2, sensor=CTS_SMALL)


def test_numbers_of_numpy_are_the_same_arguments() -> None:
    numbers: dict[str, Any] = {"seed": np.int64(3), "index": np.int8(1), "scans": np.uint16(3)}
    assert scan("empty", sensor=FEW, **numbers) == scan("empty", seed=3, index=1, scans=3, sensor=FEW)


@pytest.mark.parametrize("name", ["seed", "index", "scans"])
@pytest.mark.parametrize("value", [1.5, "1", True, None])
def test_what_counts_must_be_whole(name: str, value: Any) -> None:
    with pytest.raises(ValueError, match=f"^{name} must be a whole number, got {value!r}$"):
        scan("empty", **{"seed": 1, name: value})
