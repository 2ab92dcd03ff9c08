"""The Boreas layout: names by the middle azimuth, poses of the radar with z down, direction of sweeps."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from PIL import Image

from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.files.track_csv import TRACK_COLUMNS, read_car_track
from echoscape.sim.datasets.layouts.boreas import POSES_HEADER, Boreas, read_radar_poses
from echoscape.sim.datasets.layouts.layout import ScanRecord
from echoscape.sim.sensor.cir304 import CIR304, CIR304_RT
from tests.sim.scans import START_US, drawn_scan

BOREAS = Boreas()
ROW_US = START_US + 625 * np.arange(400)
STEM = "1700000000124375"
EAST_AND_TURNING = (
    f"{TRACK_COLUMNS}\n"
    f"{START_US},0,0.000,0.000,0.000,0.0000,8.0000,0.0000,0.1000\n"
    f"{START_US},7,0.000,0.000,0.000,0.0000,1.0000,1.0000,1.0000\n"
    f"{START_US + 250_000},0,2.250,0.000,0.000,0.0000,10.0000,1.0000,0.3000\n"
)


def record(yaw: float = 0.5) -> ScanRecord:
    pose = np.tile([10.0, 20.0, 0.3, yaw], (400, 1))
    pose[:, 0] += 0.01 * np.arange(400)
    return ScanRecord(stem=STEM, middle_us=int(ROW_US[199]) + 312, middle_pose=pose[199], pose=pose)


def written(folder: Path, yaw: float = 0.5) -> list[list[str]]:
    (folder / "applanix").mkdir()
    (folder / "tracks.csv").write_text(EAST_AND_TURNING)
    BOREAS.write_motion(folder, [record(yaw)], CIR304)
    return [line.split(",") for line in (folder / "applanix" / "radar_poses.csv").read_text().splitlines()]


def test_scan_is_named_after_its_azimuth_199() -> None:
    assert BOREAS.stem(ROW_US) == STEM == str(START_US + 199 * 625)


def test_column_10_of_alternating_sweeps_is_their_direction(tmp_path: Path) -> None:
    scan = replace(drawn_scan(sensor=CIR304_RT), rising=CIR304_RT.rising)
    BOREAS.write_scan(tmp_path / "scan.png", scan)
    with Image.open(tmp_path / "scan.png") as image:
        pixels = np.asarray(image)
    assert pixels.shape == (400, 6859)
    assert pixels[:4, 10].tolist() == [0, 255, 0, 255]
    back = BOREAS.read_scan(tmp_path / "scan.png", CIR304_RT)
    assert back.rising is not None
    assert_array_equal(back.rising, CIR304_RT.rising)
    assert back.valid.all()
    assert_array_equal(back.codes, scan.codes)
    assert_array_equal(back.timestamp_us, scan.timestamp_us)


def test_poses_have_the_header_and_a_radar_on_its_mount_whose_z_points_down(tmp_path: Path) -> None:
    header, row = written(tmp_path)
    assert ",".join(header) == (
        "GPSTime,easting,northing,altitude,vel_east,vel_north,vel_up,roll,pitch,heading,"
        "angvel_z,angvel_y,angvel_x"
    )
    assert row[0] == STEM
    values = [float(word) for word in row[1:]]
    assert_allclose(values[:3], [10.0 + 1.99, 20.0, 0.3 + 2.2], atol=1e-9)
    # Half way between the two rows of the car (0.4975 of 250 ms); a left turn is negative about z down.
    assert_allclose(values[3:6], [8 + 2 * 0.4975, 0.4975, 0], atol=1e-9)
    assert_allclose(values[6:9], [math.pi, 0, 0.5], atol=1e-9)
    assert_allclose(values[9:], [-(0.1 + 0.2 * 0.4975), 0, 0], atol=1e-9)


@pytest.mark.parametrize("yaw", [0.0, 0.5, 3.0, -2.0, 12.0])
def test_axes_of_the_radar_are_forward_right_and_down(tmp_path: Path, yaw: float) -> None:
    # C_enu_radar = C1(roll) C2(pitch) C3(heading), each the transpose of the usual rotation matrix.
    roll, pitch, heading = (float(word) for word in written(tmp_path, yaw)[1][7:10])

    def usual(axis: int, angle: float) -> np.ndarray:
        c, s = math.cos(angle), math.sin(angle)
        i, j = [(1, 2), (2, 0), (0, 1)][axis]
        matrix = np.eye(3)
        matrix[i, i], matrix[i, j], matrix[j, i], matrix[j, j] = c, -s, s, c
        return matrix

    axes = usual(0, roll).T @ usual(1, pitch).T @ usual(2, heading).T
    forward, right = [math.cos(yaw), math.sin(yaw), 0], [math.sin(yaw), -math.cos(yaw), 0]
    assert_allclose(axes.T, [forward, right, [0, 0, -1]], atol=1e-8)
    back = BOREAS.read_poses(tmp_path, [STEM, "1700000000374375"], CIR304)
    assert back is not None
    assert_allclose(back[0, :3], [11.99, 20.0, 0.3], atol=1e-8)
    assert math.cos(back[0, 3] - yaw) == pytest.approx(1, abs=1e-9)
    assert np.isnan(back[1]).all()


def test_real_heading_with_its_lean_gives_the_yaw_of_the_radars_nose(tmp_path: Path) -> None:
    # A pose as Boreas has it; the nose is the first column of the matrix.
    path = tmp_path / "radar_poses.csv"
    path.write_text(f"{POSES_HEADER}\n160641,1,2,3,0,0,0,3.1202,-0.0113,0.2008,0,0,0\n")
    nose = read_radar_poses(path)["160641"][3]
    assert nose == pytest.approx(0.2008, abs=1e-3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the header"),
        ("a,b\n", "the header"),
        (f"{POSES_HEADER}\n1,2,3\n", "line 2 is not a row of 13"),
        (f"{POSES_HEADER}\n1,2,3,4,5,6,7,8,9,10,11,12,x\n", "line 2 is not a row of 13"),
    ],
)
def test_invalid_poses_are_refused_by_name(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "radar_poses.csv"
    path.write_text(text)
    with pytest.raises(DatasetError, match=rf"radar_poses\.csv: {message}"):
        read_radar_poses(path)


@pytest.mark.parametrize(
    "text", ["", "a,b\n", f"{TRACK_COLUMNS}\n1,7,0,0,0,0,0,0,0\n", f"{TRACK_COLUMNS}\n1,0,0,0,0,0,x,0,0\n"]
)
def test_invalid_tracks_are_refused_by_name(tmp_path: Path, text: str) -> None:
    path = tmp_path / "tracks.csv"
    path.write_text(text)
    with pytest.raises(DatasetError, match=r"tracks\.csv: "):
        read_car_track(path)
