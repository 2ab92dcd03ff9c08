"""Folders of scans: each kind is recognised, real or made here, and read alike; others are refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from PIL import Image

from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.layouts.oxford import OdometryRow, write_odometry
from echoscape.sim.datasets.layouts.registry import LAYOUTS, home_of, layout_named, layout_of
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.datasets.scan_folder import open_folder
from echoscape.sim.sensor.cir204 import CIR204
from echoscape.sim.sensor.cir304 import CIR304, CIR304_RT
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.sensor.registry import SENSORS
from echoscape.sim.sensor.sensor import Sensor
from tests.paths import SHARED
from tests.sim.scans import START_US, drawn_scan

REAL = SHARED / "real"
needs_real = pytest.mark.skipif(not REAL.is_dir(), reason="no ../shared/real beside the checkout")
KNOWN = [("oxford", CTS350X), ("mulran", CIR204), ("boreas", CIR304), ("boreas", CIR304_RT)]


def scan_of(sensor: Sensor, start_us: int = START_US) -> PolarScan:
    drawn = drawn_scan(sensor=sensor)
    rising = sensor.rising if sensor.chirps == "alternating" else None
    stamps = drawn.timestamp_us + (start_us - START_US)
    return replace(drawn, timestamp_us=stamps, rising=rising, valid=np.ones(400, np.bool_))


def put(folder: Path, layout: str, sensor: Sensor, *starts_us: int) -> list[Path]:
    """Write scans as the layout has them, and nothing else."""
    each, paths = LAYOUTS[layout], []
    for start_us in starts_us or (START_US,):
        scan = scan_of(sensor, start_us)
        path = each.scan_path(folder, each.stem(scan.timestamp_us))
        path.parent.mkdir(parents=True, exist_ok=True)
        each.write_scan(path, scan)
        paths.append(path)
    return paths


@pytest.mark.parametrize(("layout", "sensor"), KNOWN)
def test_folder_is_recognised_and_read_as_it_was_written(tmp_path: Path, layout: str, sensor: Sensor) -> None:
    put(tmp_path, layout, sensor, START_US, START_US + 250_000)
    if layout == "boreas":
        (tmp_path / "applanix").mkdir()
    found = open_folder(tmp_path)
    assert (found.layout.name, found.sensor.name, found.sensor.bin_m, len(found)) == (
        layout,
        sensor.name,
        sensor.bin_m if sensor is not CIR304 else 0.04381,  # of a time after the update
        2,
    )
    for index, scan in enumerate(found):
        expected = scan_of(sensor, START_US + 250_000 * index)
        for name in ("codes", "timestamp_us", "encoder", "valid"):
            assert_array_equal(getattr(scan, name), getattr(expected, name))
        assert (scan.rising is None) == (expected.rising is None)
        assert found.truth(index) is None
    assert found.poses() is None
    assert found.motion() is None
    first = {"oxford": 0, "mulran": 399 * 625, "boreas": 199 * 625}[layout]
    assert found.timestamps_us.tolist() == [START_US + first, START_US + first + 250_000]


@pytest.mark.parametrize(("layout", "sensor"), KNOWN)
def test_loose_images_are_recognised_by_their_width_and_their_clock(
    tmp_path: Path, layout: str, sensor: Sensor
) -> None:
    for number, path in enumerate(put(tmp_path / "made", layout, sensor, START_US, START_US + 250_000)):
        (tmp_path / f"{number:06d}.png").write_bytes(path.read_bytes())
    found = open_folder(tmp_path)
    assert (found.layout.name, found.sensor.name) == (layout, sensor.name)
    assert [path.name for path in found.paths] == ["000000.png", "000001.png"]
    first = {"oxford": 0, "mulran": 399 * 625, "boreas": 199 * 625}[layout]
    assert found.timestamps_us[0] == START_US + first


@pytest.mark.parametrize(("later_us", "bin_m"), [(-1, 0.0596), (0, 0.0596), (1, 0.04381)])
def test_bins_of_boreas_go_by_the_time_in_the_name(tmp_path: Path, later_us: int, bin_m: float) -> None:
    # pyboreas: 0.04381 m where the name is later than 1632182400 s, the night to 21 September 2021.
    put(tmp_path, "boreas", CIR304, 1_632_182_400_000_000 + later_us - 199 * 625)
    assert open_folder(tmp_path).sensor.bin_m == bin_m


def test_bins_of_an_image_without_a_time_in_its_name_go_by_its_first_azimuth(tmp_path: Path) -> None:
    for start_us, bin_m in ((1_632_182_400_000_000, 0.0596), (1_632_182_400_000_001, 0.04381)):
        (tmp_path / "made" / "radar").mkdir(parents=True, exist_ok=True)
        path = put(tmp_path / "made", "boreas", CIR304, start_us)[0]
        folder = tmp_path / str(bin_m)
        folder.mkdir()
        path.rename(folder / "000001.png")
        assert open_folder(folder, layout="boreas").sensor.bin_m == bin_m


@pytest.mark.parametrize("sensor", [CIR204, CIR304, CIR304_RT], ids=lambda each: each.name)
def test_simulated_drives_have_dates_at_which_boreas_has_their_bins(tmp_path: Path, sensor: Sensor) -> None:
    (path,) = put(tmp_path, "boreas", sensor, sensor.epoch_us)
    resolution_m = 0.04381 if int(path.stem) / 1e6 > 1632182400 else 0.0596  # pyboreas, utils/radar.py
    assert sensor.bin_m == pytest.approx(resolution_m, rel=5e-4)  # the guide of Boreas-RT has 0.0438
    assert open_folder(tmp_path).sensor.bin_m == sensor.bin_m


def test_wide_images_whose_sweeps_do_not_alternate_are_recognised(tmp_path: Path) -> None:
    put(tmp_path, "boreas", replace(CIR304_RT, chirps="rising"))
    found = open_folder(tmp_path)
    assert found.sensor.chirps == "rising"
    assert found.read(0).rising is None


@pytest.mark.parametrize("where", ["sensor_data/radar/polar_oxford_form", "polar_oxford_form"])
def test_mulran_is_found_wherever_its_users_unpack_it(tmp_path: Path, where: str) -> None:
    path = put(tmp_path / "made", "mulran", CIR204)[0]
    (tmp_path / "set" / where).mkdir(parents=True)
    path.rename(tmp_path / "set" / where / path.name)
    assert open_folder(tmp_path / "set").layout.name == "mulran"


def test_layout_and_sensor_can_be_forced(tmp_path: Path) -> None:
    sensor = replace(CIR204, name="mine", bins=100, fft_size=512, bin_m=0.9, bandwidth_hz=40e6)
    put(tmp_path, "boreas", sensor)
    with pytest.raises(
        DatasetError, match=r"124375\.png: 400 rows and 111 columns are not a scan of the layout boreas"
    ):
        open_folder(tmp_path)
    found = open_folder(tmp_path, layout="boreas", sensor=sensor)
    assert found.read(0).codes.shape == (400, 100)
    assert found.read(0).bin_m == 0.9
    with pytest.raises(ValueError, match="layout must be one of oxford, mulran, boreas, got 'moon'"):
        open_folder(tmp_path, layout="moon")


def test_oxford_odometry_is_chained_and_gaps_are_nan(tmp_path: Path) -> None:
    starts = [START_US + 250_000 * i for i in range(4)]
    put(tmp_path, "oxford", CTS350X, *starts)
    (tmp_path / "gt").mkdir()
    # 2 m on, 0.5 m to the right, and a right angle to the right; then 3 m on and 1 m to the right: back.
    moves = [(2.0, 0.5, np.pi / 2), (3.0, 1.0, 0.0)]
    rows = [
        OdometryRow(
            source_us=starts[i + 1],
            destination_us=starts[i],
            x=x,
            y=y,
            z=0.0,
            roll=0.0,
            pitch=0.0,
            yaw=yaw,
            source_radar_us=starts[i + 1],
            destination_radar_us=starts[i],
        )
        for i, (x, y, yaw) in enumerate(moves)
    ]
    write_odometry(tmp_path / "gt" / "radar_odometry.csv", rows)
    found = open_folder(tmp_path)
    poses, motion = found.poses(), found.motion()
    assert poses is not None
    assert motion is not None
    # World: x forward, y left, yaw counter-clockwise.
    assert_allclose(poses[:3], [[0, 0, 0, 0], [2, -0.5, 0, -np.pi / 2], [1, -3.5, 0, -np.pi / 2]], atol=1e-5)
    assert np.isnan(poses[3]).all()
    assert_allclose(motion[:2], [[2, 0.5, 0, np.pi / 2], [3, 1, 0, 0]], atol=1e-5)
    assert np.isnan(motion[2]).all()


@pytest.mark.parametrize(("layout", "sensor"), KNOWN)
def test_cut_image_is_refused_by_name(tmp_path: Path, layout: str, sensor: Sensor) -> None:
    paths = put(tmp_path, layout, sensor, START_US, START_US + 250_000)
    paths[1].write_bytes(paths[1].read_bytes()[:5000])
    with pytest.raises(DatasetError, match=rf"{paths[1].name}: not a complete PNG"):
        open_folder(tmp_path).read(1)


def test_image_of_another_width_than_the_first_is_refused_by_name(tmp_path: Path) -> None:
    paths = put(tmp_path, "oxford", CTS350X, START_US, START_US + 250_000)
    Image.new("L", (3000, 400)).save(paths[1])
    with pytest.raises(
        DatasetError, match=rf"{paths[1].name}: a scan of cts350x has 400 rows and 3779 columns"
    ):
        open_folder(tmp_path).read(1)


def test_what_is_no_folder_of_scans_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="nowhere: no such folder"):
        open_folder(tmp_path / "nowhere")
    (tmp_path / "empty").mkdir()
    with pytest.raises(DatasetError, match="empty: no scans"):
        open_folder(tmp_path / "empty")
    Image.new("RGB", (20, 20)).save(tmp_path / "photo.png")
    with pytest.raises(DatasetError, match=r"photo\.png: .* mode RGB"):
        open_folder(tmp_path)
    Image.new("L", (20, 20)).save(tmp_path / "photo.png")
    with pytest.raises(DatasetError, match=r"photo\.png: 20 rows and 20 columns"):
        open_folder(tmp_path)


def test_scans_are_read_by_index_and_slice_like_a_list(tmp_path: Path) -> None:
    put(tmp_path, "oxford", CTS350X, *(START_US + 250_000 * number for number in range(4)))
    folder = open_folder(tmp_path)
    scans = list(folder)
    assert [folder[number] for number in range(-4, 4)] == scans + scans
    assert folder[np.int64(1)] == folder.read(np.int64(1)) == scans[1]
    assert folder.read(-1) == scans[3]
    assert [int(scan.timestamp_us[0]) for scan in scans] == [START_US + 250_000 * n for n in range(4)]
    for slices in (slice(1, 3), slice(None, None, -2), slice(-9, 99), slice(3, 1)):
        assert folder[slices] == scans[slices]
    for index in (4, -5):
        with pytest.raises(IndexError, match=f"index must be between -4 and 3, got {index}"):
            folder[index]
        for read in (folder.read, folder.truth, folder.beat):
            with pytest.raises(IndexError, match=f"index must be between -4 and 3, got {index}"):
                read(index)
    with pytest.raises(TypeError):
        folder[1.0]  # pyright: ignore


def test_simulated_folder_whose_truth_is_gone_says_so(tmp_path: Path) -> None:
    put(tmp_path, "oxford", CTS350X, START_US)
    folder = replace(open_folder(tmp_path), simulated=True)
    with pytest.raises(DatasetError, match=f"^{tmp_path}: the folder holds no truth"):
        folder.truth(0)
    (tmp_path / "truth").mkdir()
    with pytest.raises(DatasetError, match=rf"{START_US}\.npz: no such truth file"):
        folder.truth(0)


def test_layouts_are_found_by_name_and_every_sensor_has_a_home() -> None:
    assert layout_named("mulran").name == "mulran"
    with pytest.raises(ValueError, match="got 'moon'"):
        layout_named("moon")
    homes = {name: home_of(name).name for name in (*SENSORS, "mine")}
    assert homes == {
        "cts350x": "oxford",
        "cts_small": "oxford",
        "cir204": "mulran",
        "cir304": "boreas",
        "cir304_rt": "boreas",
        "mine": "oxford",
    }
    sensor = {"name": "cir204"}
    assert layout_of({"config": {"sensor": sensor}}).name == "mulran"
    assert layout_of({"config": {"sensor": sensor, "layout": "boreas"}}).name == "boreas"
    for bad in ({}, {"config": 3}, {"config": {"sensor": sensor, "layout": "moon"}}):
        with pytest.raises(DatasetError, match=r"config\.layout"):
            layout_of(bad)


@needs_real
def test_real_oxford_pair_reads_with_its_motion() -> None:
    found = open_folder(REAL / "oxford-pair")
    assert (found.layout.name, found.sensor) == ("oxford", CTS350X)
    assert found.timestamps_us.tolist() == [1547131050856549, 1547131051108813]
    motion = found.motion()
    assert motion is not None
    assert_allclose(motion, [[0.864929, 0.004842, 0, 0.001772]], atol=1e-6)
    assert_allclose(np.degrees(found.read(0).azimuth_rad[[0, 399]]), [0.8357, 359.9357], atol=1e-3)


@needs_real
def test_real_mulran_scans_read() -> None:
    found = open_folder(REAL / "mulran")
    assert (found.layout.name, found.sensor, len(found)) == ("mulran", CIR204, 3)
    # The data set's own name for the first is 1567410201812840928.png.
    assert found.timestamps_us[0] == 1567410201812840
    scan = found.read(0)
    assert scan.codes.shape == (400, 3360)
    assert scan.timestamp_us[0] == 1567410201563630
    assert int(scan.codes.max()) == 135
    assert scan.valid.all()


@needs_real
def test_real_boreas_rt_scan_reads_with_its_sweeps() -> None:
    found = open_folder(REAL / "boreas-rt")
    assert (found.layout.name, found.sensor, len(found)) == ("boreas", CIR304_RT, 1)
    scan = found.read(0)
    assert scan.codes.shape == (400, 6848)
    assert scan.rising is not None
    assert_array_equal(scan.rising, CIR304_RT.rising)
    assert scan.valid.all()
    assert scan.timestamp_us[0] == 1733239501859565
    # Bin k lies at k 0.0438 - 0.31 m, half a bin less than the offset from our bin centres.
    assert found.range_offset_m == pytest.approx(-0.31 - 0.0219)


@needs_real
@pytest.mark.parametrize("name", ["oxford-pair", "mulran", "boreas-rt"])
def test_real_scans_hold_only_codes_that_the_quantiser_writes(name: str) -> None:
    for scan in open_folder(REAL / name):
        assert not np.isin(scan.codes, [1, 2, 3, 4, 5, 7, 8, 10, 11, 13, 16, 255]).any()
