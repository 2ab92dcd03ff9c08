"""Time stamps and odometry in the Oxford layout: there and back, and damage."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.layouts.layout import ScanRecord
from echoscape.sim.datasets.layouts.oxford import (
    ODOMETRY_HEADER,
    OdometryRow,
    Oxford,
    read_odometry,
    read_timestamps,
    write_odometry,
    write_timestamps,
)
from echoscape.sim.sensor.cts350x import CTS350X
from tests.sim.scans import START_US


def test_time_stamps_are_one_a_line_and_valid(tmp_path: Path) -> None:
    path = tmp_path / "radar.timestamps"
    write_timestamps(path, [START_US, START_US + 250_000])
    assert path.read_text() == f"{START_US} 1\n{START_US + 250_000} 1\n"
    assert read_timestamps(path) == [START_US, START_US + 250_000]


@pytest.mark.parametrize("line", ["", "12", "12 1 1", "noon 1"])
def test_invalid_time_stamps_are_refused_by_name_and_line(tmp_path: Path, line: str) -> None:
    path = tmp_path / "radar.timestamps"
    path.write_text(f"12 1\n{line}\n")
    with pytest.raises(DatasetError, match=r"radar\.timestamps: line 2"):
        read_timestamps(path)


def test_odometry_has_the_header_and_the_later_frame_first(tmp_path: Path) -> None:
    path = tmp_path / "radar_odometry.csv"
    write_odometry(path, [ROW])
    assert path.read_text() == (
        "source_timestamp,destination_timestamp,x,y,z,roll,pitch,yaw,"
        "source_radar_timestamp,destination_radar_timestamp\n"
        "374,124,1.500000,0.004842,0.000000,0.000000,0.000000,-0.100000,250,0\n"
    )
    assert len(ODOMETRY_HEADER) == 10
    assert read_odometry(path) == [ROW]


ROW = OdometryRow(
    source_us=374,
    destination_us=124,
    x=1.5,
    y=0.004842,
    z=0.0,
    roll=0.0,
    pitch=0.0,
    yaw=-0.1,
    source_radar_us=250,
    destination_radar_us=0,
)


@pytest.mark.parametrize("line", ["1,2,3", "374,124,x,0,0,0,0,0,250,0", "1.5,1,0,0,0,0,0,0,1,2", ",,,,,,,,,"])
def test_invalid_odometry_is_refused_by_name_and_line(tmp_path: Path, line: str) -> None:
    path = tmp_path / "radar_odometry.csv"
    path.write_text(",".join(ODOMETRY_HEADER) + f"\n{line}\n")
    with pytest.raises(DatasetError, match=r"radar_odometry\.csv: line 2"):
        read_odometry(path)


@pytest.mark.parametrize("text", ["", "a,b,c\n"])
def test_odometry_without_its_header_is_refused_by_name(tmp_path: Path, text: str) -> None:
    path = tmp_path / "radar_odometry.csv"
    path.write_text(text)
    with pytest.raises(DatasetError, match=r"radar_odometry\.csv: the header"):
        read_odometry(path)


def test_poses_chain_from_the_first_pair_that_has_a_row(tmp_path: Path) -> None:
    stems = [str(START_US + 250_000 * k) for k in range(5)]
    rows = [
        OdometryRow(
            source_us=int(later),
            destination_us=int(earlier),
            x=2.0,
            y=0.0,
            z=0.0,
            roll=0.0,
            pitch=0.0,
            yaw=0.0,
            source_radar_us=int(later),
            destination_radar_us=int(earlier),
        )
        for earlier, later in pairwise(stems[1:4])
    ]
    (tmp_path / "gt").mkdir()
    write_odometry(tmp_path / "gt" / "radar_odometry.csv", rows)
    poses = Oxford().read_poses(tmp_path, stems, CTS350X)
    assert poses is not None
    assert_array_equal(np.isfinite(poses).all(axis=1), [False, True, True, True, False])
    assert_allclose(poses[1:4, 0], [0, 2, 4])
    write_odometry(tmp_path / "gt" / "radar_odometry.csv", [])
    nothing = Oxford().read_poses(tmp_path, stems, CTS350X)
    assert nothing is not None
    assert np.isnan(nothing).all()


def test_a_climb_is_a_negative_z_in_the_file_and_a_positive_one_when_read_again(tmp_path: Path) -> None:
    stems = [str(START_US + 250_000 * k) for k in range(3)]
    world = np.array([[0.0, 0, 0, 0], [2.0, -0.5, 0.3, -0.1], [4.0, -1.5, 0.5, -0.2]])
    records = [
        ScanRecord(
            stem=stem,
            middle_us=int(stem) + 125_000,
            pose=np.tile(pose, (400, 1)),
            middle_pose=pose,
        )
        for stem, pose in zip(stems, world, strict=True)
    ]
    (tmp_path / "gt").mkdir()
    Oxford().write_motion(tmp_path, records, CTS350X)
    first, _ = read_odometry(tmp_path / "gt" / "radar_odometry.csv")
    # Right is south of a car that heads east, and a right turn makes the world's yaw smaller.
    assert (first.x, first.y, first.z, first.yaw) == (2.0, 0.5, -0.3, 0.1)
    poses = Oxford().read_poses(tmp_path, stems, CTS350X)
    assert poses is not None
    assert_allclose(poses, world, atol=2e-6)  # six decimals in the file
