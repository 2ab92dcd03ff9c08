"""Datasets in every layout: made, read back with their motion and truth, resumed to the same bytes."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.files.metadata import manifest_text
from echoscape.sim.datasets.files.navtech_png import write_png
from echoscape.sim.datasets.scan_folder import ScanFolder, open_folder
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.dataset import write_dataset
from echoscape.sim.generation.manifest import manifest
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.sensor.registry import SENSORS
from echoscape.sim.settings.tracing import TraceSettings
from tests.sim.scans import START_US, drawn_scan

CASES = [
    pytest.param(("cir204", None, "mulran"), id="cir204"),
    pytest.param(("cir304_rt", None, "boreas"), id="cir304_rt", marks=pytest.mark.slow),
    pytest.param(("cts350x", "mulran", "mulran"), id="cts350x in mulran", marks=pytest.mark.slow),
]


@pytest.fixture(scope="module", params=CASES)
def made(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[ScanFolder, SimulationConfig, str]:
    radar, layout, expected = request.param
    config = SimulationConfig(
        preset="open", seed=3, scans=3, sensor=SENSORS[radar], layout=layout, trace=TraceSettings(rays=16)
    )
    out = tmp_path_factory.mktemp("set")
    write_dataset(out, config)
    return open_folder(out), config, expected


def test_dataset_is_read_back_as_what_it_was_made_as(made: tuple[ScanFolder, SimulationConfig, str]) -> None:
    found, config, expected = made
    assert found.simulated
    assert (found.layout.name, found.sensor, len(found)) == (expected, config.sensor, 3)
    assert found.range_offset_m == 0
    assert (found.timestamps_us[1:] - found.timestamps_us[:-1]) == pytest.approx(250_000, rel=0.02)


def test_scans_and_their_truth_share_a_name(made: tuple[ScanFolder, SimulationConfig, str]) -> None:
    found = made[0]
    for index, scan in enumerate(found):
        truth = found.truth(index)
        assert truth is not None
        assert truth.cells.component.shape == scan.codes.shape
        assert truth.middle_us == pytest.approx((scan.timestamp_us[0] + scan.timestamp_us[-1]) / 2, abs=1)
        assert scan.encoder[0] == found.sensor.encoder_first
        if found.sensor.chirps == "alternating":
            assert scan.rising is not None
            assert_array_equal(scan.rising, np.arange(400) % 2 == 1)
        assert found.stems[index] == found.layout.stem(scan.timestamp_us)


def test_motion_of_the_files_is_that_of_the_truth(made: tuple[ScanFolder, SimulationConfig, str]) -> None:
    found = made[0]
    truths = [found.truth(index) for index in range(3)]
    poses = found.poses()
    assert poses is not None
    expected = np.array([each.middle_pose for each in truths if each is not None])
    # Boreas tells the pose of row 199, half a row (0.3 ms) before mid-scan; MulRan has to guess how long the
    # first turn took, whose deviation is that of the sensor (1.3 ms): a few centimetres at 30 m/s.
    assert_allclose(poses[1:, :3], expected[1:, :3], atol=0.02)
    assert_allclose(poses[0, :3], expected[0, :3], atol=0.06)
    assert_allclose(np.cos(poses[:, 3] - expected[:, 3]), 1, atol=1e-6)
    motion = found.motion()
    assert motion is not None
    steps = np.linalg.norm(np.diff(expected[:, :2], axis=0), axis=1)
    assert (motion[:, 0] > 0).all()
    assert_allclose(np.hypot(motion[:, 0], motion[:, 1]), steps, atol=0.06)


def test_resuming_a_whole_dataset_changes_nothing(made: tuple[ScanFolder, SimulationConfig, str]) -> None:
    found, config, _ = made
    before = {path: path.read_bytes() for path in found.folder.rglob("*") if path.is_file()}
    write_dataset(found.folder, config, resume=True)
    assert {path: path.read_bytes() for path in found.folder.rglob("*") if path.is_file()} == before


@pytest.mark.slow
def test_lost_image_is_made_again_alike(made: tuple[ScanFolder, SimulationConfig, str]) -> None:
    found, config, _ = made
    before = found.paths[1].read_bytes()
    found.paths[1].unlink()
    write_dataset(found.folder, config, resume=True)
    assert found.paths[1].read_bytes() == before


def test_unknown_layout_is_refused_by_name() -> None:
    with pytest.raises(ValueError, match="layout must be one of oxford, mulran, boreas, got 'moon'"):
        replace(SimulationConfig(sensor=CTS350X), layout="moon")


@pytest.mark.parametrize(
    ("found", "remedy"),
    [
        (1, ", written by an earlier version .* simulate the data set again from its options, or delete"),
        (2, ", written by an earlier version .* simulate the data set again from its options, or delete"),
        (4, ", written by a later version of echoscape: install that one$"),
        (None, "$"),
        (True, "$"),
    ],
)
def test_folder_of_another_format_is_refused_by_name(tmp_path: Path, found: object, remedy: str) -> None:
    content = manifest(SimulationConfig(preset="empty", scans=1)) | {"format": found}
    (tmp_path / "echoscape.json").write_text(manifest_text(content))
    (tmp_path / "radar").mkdir()
    write_png(tmp_path / "radar" / f"{START_US}.png", drawn_scan())
    with pytest.raises(DatasetError, match=rf"echoscape\.json: must be of format 3, got {found}{remedy}"):
        open_folder(tmp_path)


def test_folder_of_an_earlier_format_is_read_as_real_without_its_manifest(tmp_path: Path) -> None:
    # As the message says: the azimuths are then those of the encoder, and there is no truth.
    (tmp_path / "radar").mkdir()
    write_png(tmp_path / "radar" / f"{START_US}.png", drawn_scan())
    (tmp_path / "truth").mkdir()
    found = open_folder(tmp_path)
    assert (found.simulated, found.truth(0), found.sensor) == (False, None, CTS350X)
    assert found.read(0).first_azimuth_rad == pytest.approx(2 * np.pi * 13 / 5600)
