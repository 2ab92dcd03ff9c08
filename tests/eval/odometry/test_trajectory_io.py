"""Trajectories: chains of motions drive where a car would, files read again say the same."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from echoscape.eval.odometry.trajectory_io import (
    kitti_text,
    matrices,
    read_kitti,
    read_tum,
    tum_text,
)
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.se2 import compose

QUARTER = math.pi / 2
POSE = st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(-3, 3)).map(np.array)


@given(POSE, POSE)
def test_matrices_multiply_as_poses_compose(first: np.ndarray, second: np.ndarray) -> None:
    both = matrices(np.array([first, second]))
    assert_allclose(both[0] @ both[1], matrices(compose(first, second)[None])[0], atol=1e-10)


def rotations(count: int) -> np.ndarray:
    """Rotations of all kinds, half turns about every axis among them, from products of elementary ones."""
    rng = np.random.default_rng(5)
    found = [np.diag(signs) for signs in ([1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1])]
    for a, b, c in rng.uniform(-math.pi, math.pi, (count, 3)):
        about_z = np.array([[math.cos(a), -math.sin(a), 0], [math.sin(a), math.cos(a), 0], [0, 0, 1]])
        about_x = np.array([[1, 0, 0], [0, math.cos(b), -math.sin(b)], [0, math.sin(b), math.cos(b)]])
        again = np.array([[math.cos(c), -math.sin(c), 0], [math.sin(c), math.cos(c), 0], [0, 0, 1]])
        found.append(about_z @ about_x @ again)
    return np.array(found, float)


def poses_3d() -> np.ndarray:
    turns = rotations(40)
    found = np.tile(np.eye(4), (len(turns), 1, 1))
    found[:, :3, :3] = turns
    found[:, :3, 3] = np.random.default_rng(6).normal(0, 1000, (len(turns), 3))
    return found


def test_kitti_files_say_the_same_when_read_again(tmp_path: Path) -> None:
    path = tmp_path / "poses.txt"
    path.write_text(kitti_text(poses_3d()))
    assert_allclose(read_kitti(path), poses_3d(), atol=1e-12)
    words = path.read_text().splitlines()[5].split()
    assert len(words) == 12
    assert float(words[3]) == pytest.approx(poses_3d()[5, 0, 3])  # x ends the first row of the matrix


def test_tum_files_say_the_same_when_read_again(tmp_path: Path) -> None:
    path = tmp_path / "poses.tum"
    times_us = 1_547_131_050_982_510 + 250_001 * np.arange(len(poses_3d()))
    text = tum_text(times_us, poses_3d())
    assert all(float(line.split()[-1]) >= 0 for line in text.splitlines())  # of q and -q the one with w >= 0
    path.write_text("# t x y z qx qy qz qw\n" + text)
    times, poses = read_tum(path)
    assert times.tolist() == times_us.tolist()
    assert_allclose(poses, poses_3d(), atol=2e-8)  # nine decimals of a quaternion


def test_tum_line_of_a_right_angle() -> None:
    # A quarter turn clockwise about z, which points down, is positive: qz = qw = sqrt(1/2).
    line = tum_text([2_000_001], matrices([[1.0, 2.0, QUARTER]]))
    half = f"{math.sqrt(0.5):.9f}"
    assert line == f"2.000001 1.000000000 2.000000000 0.000000000 0.000000000 0.000000000 {half} {half}\n"


def test_times_must_be_as_many_as_poses() -> None:
    with pytest.raises(ValueError, match="times_us must be as many as the poses, 1, got 2"):
        tum_text([1, 2], matrices([[0.0, 0.0, 0.0]]))


ROW = "1 0 0 0 0 1 0 0 0 0 1 0"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no poses in it"),
        (f"{ROW}\n1 2 3\n", "line 2 is no pose: 12 finite numbers, got '1 2 3'"),
        (ROW.replace("1 0 0 0", "1 0 0 nan", 1), "line 1 is no pose"),
        (f"{ROW}\n{ROW.replace('0', 'o', 1)}", "line 2 is no pose"),
        (ROW.replace("1", "2"), "line 1 is no pose: its 3 x 3 part is no rotation"),
        (ROW.replace("1", "-1", 1), "line 1 is no pose: its 3 x 3 part is no rotation"),
    ],
)
def test_files_that_hold_no_poses_are_refused_by_name(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "poses.txt"
    path.write_text(text)
    with pytest.raises(DatasetError) as refused:
        read_kitti(path)
    assert str(path) in str(refused.value)
    assert message in str(refused.value)


def test_tum_files_that_hold_no_poses_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "poses.tum"
    with pytest.raises(DatasetError, match="cannot be read"):
        read_tum(path)
    path.write_text("1 0 0 0 0 0 0 2\n")
    with pytest.raises(DatasetError, match="pose 1 has a quaternion that is no rotation"):
        read_tum(path)
