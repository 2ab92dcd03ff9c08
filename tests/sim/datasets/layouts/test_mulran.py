"""The MulRan layout: nanoseconds, names that are the scan's end, poses as 3 x 4 matrices, there and back."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from PIL import Image

from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.layouts.layout import ScanRecord
from echoscape.sim.datasets.layouts.mulran import MulRan, read_global_poses
from echoscape.sim.sensor.cir204 import CIR204
from tests.sim.scans import START_US, drawn_scan

MULRAN = MulRan()
ROW_US = START_US + 625 * np.arange(400)
TURN_US = 250_000
LAST_US = 249_375


def record(index: int, middle: list[float], last: list[float]) -> ScanRecord:
    """A scan that begins `index` turns of 250 ms after the start."""
    start = START_US + index * TURN_US
    return ScanRecord(
        stem=f"{start + LAST_US}000",
        middle_us=start + round(LAST_US / 2),
        middle_pose=np.array(middle),
        pose=np.linspace(2 * np.array(middle) - last, last, 400),
    )


def test_scan_is_named_after_the_nanosecond_of_its_last_azimuth() -> None:
    assert MULRAN.stem(ROW_US) == "1700000000249375000"
    assert MULRAN.time_us("1700000000249375000") == START_US + LAST_US


def test_image_counts_nanoseconds_and_begins_with_encoder_7(tmp_path: Path) -> None:
    scan = drawn_scan(sensor=CIR204)
    MULRAN.write_scan(tmp_path / "scan.png", scan)
    with Image.open(tmp_path / "scan.png") as image:
        assert image.size == (3371, 400)
        pixels = np.asarray(image)
    assert int.from_bytes(bytes(pixels[1, :8]), "little") == (START_US + 625) * 1000
    assert [int(pixels[row, 8]) + 256 * int(pixels[row, 9]) for row in (0, 1, 399)] == [7, 21, 5593]
    back = MULRAN.read_scan(tmp_path / "scan.png", CIR204)
    for name in ("codes", "timestamp_us", "encoder", "valid"):
        assert_array_equal(getattr(back, name), getattr(scan, name))
    assert back.bin_m == 0.0596
    assert_allclose(back.azimuth_rad[:2], [7 * 2 * math.pi / 5600, 21 * 2 * math.pi / 5600])


def test_pose_file_has_a_time_and_the_matrix_row_by_row(tmp_path: Path) -> None:
    (tmp_path / "sensor_data").mkdir()
    # Heading north: x forward is the world's y, y left the world's -x.
    MULRAN.write_motion(tmp_path, [record(0, [1, 2, 3, math.pi / 2], [1, 4, 3, math.pi / 2])], CIR204)
    lines = (tmp_path / "global_pose.csv").read_text().splitlines()
    assert [int(line.split(",")[0]) for line in lines] == [
        START_US * 1000 + shift for shift in (1000, 124_688_000, 249_375_000)
    ]
    matrix = np.array(lines[1].split(",")[1:], float).reshape(3, 4)
    assert_allclose(matrix, [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3]], atol=1e-9)
    assert (tmp_path / "sensor_data" / "navtech_top_stamp.csv").read_text() == "1700000000249375000\n"
    assert (tmp_path / "sensor_data" / "data_stamp.csv").read_text() == "1700000000249375000,radar\n"


@given(
    st.lists(
        st.tuples(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(-5, 5), st.floats(-9, 9)),
        min_size=1,
        max_size=5,
    )
)
def test_poses_at_mid_scan_come_back(tmp_path_factory: pytest.TempPathFactory, poses: list) -> None:
    folder = tmp_path_factory.mktemp("set")
    (folder / "sensor_data").mkdir()
    records = [
        record(i, list(pose), [pose[0] + 1, pose[1] - 1, pose[2], pose[3] + 0.1])
        for i, pose in enumerate(poses)
    ]
    MULRAN.write_motion(folder, records, CIR204)
    back = MULRAN.read_poses(folder, [each.stem for each in records], CIR204)
    assert back is not None
    # Mid-scan to half a microsecond, in which a leap of 2 km in half a turn is 8 mm.
    assert_allclose(back[:, :3], np.array(poses)[:, :3], atol=1e-2)
    turned = back[:, 3] - np.array(poses)[:, 3]
    assert_allclose(np.cos(turned), 1, atol=1e-6)


def test_real_poses_at_other_times_are_interpolated_to_mid_scan(tmp_path: Path) -> None:
    # 100 Hz, 10 m/s east, turning from +pi across to -pi.
    lines = []
    for step in range(100):
        yaw = math.pi - 0.2 + 0.01 * step
        c, s = math.cos(yaw), math.sin(yaw)
        lines.append(f"{START_US * 1000 + step * 10_000_000},{c},{-s},0,{0.1 * step},{s},{c},0,0,0,0,1,0")
    (tmp_path / "global_pose.csv").write_text("\n".join(lines))
    stems = [f"{START_US + 249_375 + i * TURN_US}000" for i in range(5)]
    poses = MULRAN.read_poses(tmp_path, stems, CIR204)
    assert poses is not None
    middle_s = 0.1246875 + 0.25 * np.arange(4)
    assert_allclose(poses[:4, 0], 10 * middle_s, atol=5e-3)  # half a millisecond of an unknown first turn
    assert_allclose(np.unwrap(poses[:4, 3]), math.pi - 0.2 + middle_s, atol=1e-3)
    assert np.isnan(poses[4]).all()  # no pose is known so late


def test_folder_without_poses_has_none(tmp_path: Path) -> None:
    assert MULRAN.read_poses(tmp_path, ["1700000000249375000"], CIR204) is None


GOOD = "1,1,0,0,0,0,1,0,0,0,0,1,0"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no poses"),
        ("noon,1,2", "no time"),
        (f"{GOOD}\n2,1,2,3", "line 2 is not a row of 13"),
        (f"{GOOD}\n2{GOOD[1:-1]}x", "line 2 is not a row of 13"),
        (f"{GOOD}\n{GOOD}", "times do not increase"),
        ("9" * 30 + GOOD[1:], "no time"),
    ],
)
def test_invalid_poses_are_refused_by_name(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "global_pose.csv"
    path.write_text(text)
    with pytest.raises(DatasetError, match=rf"global_pose\.csv: .*{message}"):
        read_global_poses(path)
