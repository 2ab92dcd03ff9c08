"""Scans of an ablation: traced once, and the very files that a simulation of each condition writes."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from echoscape.eval.ablation.study.conditions import SUITES
from echoscape.eval.ablation.study.scans import DriveFolders, DriveWriter
from echoscape.eval.ablation.study.settings import AblationStudy
from echoscape.sim.datasets.files.metadata import read_manifest
from echoscape.sim.datasets.scan_folder import open_folder
from echoscape.sim.effects.sensor_faults import arriving, recorded_us, with_faults
from echoscape.sim.generation.dataset import write_dataset
from echoscape.sim.generation.setup import add_traffic, build_scene
from echoscape.sim.raytracing.tracer import Tracer
from tests.eval.ablation.study.studies import small_study


def written(folder: Path, study: AblationStudy) -> DriveFolders:
    """Write the scans of the first drive of a study."""
    drive = study.drives[0]
    folders = DriveFolders(folder=folder, drive=drive, conditions=study.runs, keep_truth=study.keep_scans)
    writer = DriveWriter(folders, add_traffic(build_scene(drive.config), drive.config))
    assert writer.missing() == [*range(study.scans)]
    for index in reversed(range(study.scans)):
        writer.write(index)
    assert writer.missing() == []
    assert not folders.complete
    writer.finish()
    assert folders.complete
    return folders


@pytest.fixture
def traces(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The numbers of the scans that are traced, in order."""
    found: list[int] = []
    trace: Callable[..., Any] = Tracer.trace

    def counted(self: Tracer, state: Any, *arguments: Any, **named: Any) -> Any:
        found.append(state.index)
        return trace(self, state, *arguments, **named)

    monkeypatch.setattr(Tracer, "trace", counted)
    return found


def test_every_scan_is_traced_once_for_all_conditions_that_allow_it(
    tmp_path: Path, traces: list[int]
) -> None:
    levels = ("ghosts=0,0.5,2", "speckle=0", "phase_noise=0", "clock_jitter=0.02", "gain_step=3")
    written(tmp_path, small_study(*levels))
    assert sorted(traces) == [0, 1]


def test_conditions_that_change_the_paths_have_traces_of_their_own(tmp_path: Path, traces: list[int]) -> None:
    written(tmp_path, small_study("movers=0,0.5", "ghosts=0"))
    assert sorted(traces) == [0, 0, 0, 1, 1, 1]


def test_folders_are_those_of_a_simulation_of_each_condition(tmp_path: Path) -> None:
    study = small_study("ghosts=0", "rain=20", keep_scans=True)
    folders = written(tmp_path / "scans", study)
    for condition in study.runs:
        config = replace(study.drives[0].config, artefacts=condition.artefacts)
        write_dataset(tmp_path / condition.name, config)
        there = tmp_path / condition.name
        for path in folders.of(condition).rglob("*.*"):
            assert path.read_bytes() == (there / path.relative_to(folders.of(condition))).read_bytes(), path
        assert {path.name for path in folders.of(condition).iterdir()} == {
            *("echoscape.json", "radar", "radar.timestamps", "gt", "truth")
        }


def test_scans_with_faults_are_recorded_with_the_true_motion(tmp_path: Path) -> None:
    study = small_study("dropped_scans=0.6", "clock_jitter=0.03", "range_scale=0.05", scans=6)
    folders = written(tmp_path, study)
    config = study.drives[0].config
    plain, *faulty = (open_folder(folders.of(each)) for each in study.runs)
    poses = plain.poses()
    assert poses is not None
    for condition, folder in zip(study.runs[1:], faulty, strict=True):
        kept = arriving(condition.faults, study.scans, seed=config.seed).nonzero()[0].tolist()
        assert len(folder) == len(kept)
        for place, index in enumerate(kept):
            expected = with_faults(
                plain.read(index),
                condition.faults,
                index=index,
                count=6,
                seed=config.seed,
                sensor=config.sensor,
            )
            assert folder.read(place) == expected
        found = folder.poses()
        assert found is not None
        assert found == pytest.approx(poses[kept], abs=1e-5)
        assert read_manifest(folder.folder)["faults"] == vars(condition.faults)
    assert 2 <= len(faulty[0]) < 6
    jittered = recorded_us(plain.read(2).timestamp_us, study.runs[2].faults, index=2, seed=config.seed)
    assert faulty[1].paths[2].stem == str(jittered[0]) != plain.paths[2].stem


def test_every_stress_changes_what_is_recorded(tmp_path: Path, traces: list[int]) -> None:
    study = small_study(*SUITES["stress"], scans=6)
    folders = written(tmp_path, study)
    plain = {path.name: path.read_bytes() for path in (folders.of(study.runs[0]) / "radar").iterdir()}
    for condition in study.runs[1:]:
        found = {path.name: path.read_bytes() for path in (folders.of(condition) / "radar").iterdir()}
        assert found != plain, condition.name
    assert sorted(traces) == [*range(6)]  # rain and interference need no trace of their own
