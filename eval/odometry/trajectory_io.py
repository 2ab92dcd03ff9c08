"""Trajectories: poses as 4 x 4 matrices, and the text files that tools exchange.

Files are those of the KITTI odometry devkit (Geiger et al., CVPR 2012: twelve numbers a line) and of the TUM
RGB-D benchmark (Sturm et al., IROS 2012: `t x y z qx qy qz qw`); axes and times are in docs/conventions.md.
"""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from echoscape.sim.datasets.files.atomic_write import DatasetError, read_text

_ROTATION_TOLERANCE = 0.01
"""Largest deviation of R R^T from 1: files with three decimals pass."""


def matrices(poses: ArrayLike) -> NDArray[np.float64]:
    """Convert planar poses to matrices.

    Args:
        poses: Poses (N, 3): x, y [m], yaw [rad].

    Returns:
        Matrices (N, 4, 4): a rotation by yaw about z and a translation in the plane.
    """
    x, y, yaw = np.moveaxis(np.asarray(poses, np.float64), -1, 0)
    found = np.zeros((*x.shape, 4, 4))
    found[..., 0, 0] = found[..., 1, 1] = np.cos(yaw)
    found[..., 1, 0] = np.sin(yaw)
    found[..., 0, 1] = -found[..., 1, 0]
    found[..., 2, 2] = found[..., 3, 3] = 1.0
    found[..., 0, 3], found[..., 1, 3] = x, y
    return found


# ---------------------------------------------------------------------- text files


def kitti_text(poses: NDArray[np.float64]) -> str:
    """Write poses in KITTI's format.

    Args:
        poses: Poses (N, 4, 4).

    Returns:
        A line of twelve numbers for each pose: its upper 3 x 4 part, row by row.
    """
    return "".join(" ".join(f"{value + 0.0:.12f}" for value in each[:3].ravel()) + "\n" for each in poses)


def read_kitti(path: Path) -> NDArray[np.float64]:
    """Read poses in KITTI's format.

    Args:
        path: The file.

    Returns:
        Poses (N, 4, 4).

    Raises:
        DatasetError: The file is absent or empty, or a line is no pose; the message names both.
    """
    numbers = _numbers(path, count=12)
    poses = np.tile(np.eye(4), (len(numbers), 1, 1))
    poses[:, :3] = numbers.reshape(-1, 3, 4)
    rotations = poses[:, :3, :3]
    deviation = np.abs(rotations @ rotations.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
    wrong = (deviation > _ROTATION_TOLERANCE) | (np.linalg.det(rotations) < 0)
    if wrong.any():
        raise DatasetError(
            f"{path}: line {int(np.argmax(wrong)) + 1} is no pose: its 3 x 3 part is no rotation"
        )
    return poses


def tum_text(times_us: Sequence[int] | NDArray[np.int64], poses: NDArray[np.float64]) -> str:
    """Write poses in TUM's format.

    Args:
        times_us: Times (N,) [us].
        poses: Poses (N, 4, 4).

    Returns:
        A line `t x y z qx qy qz qw` for each pose, t in seconds with six decimals.

    Raises:
        ValueError: The numbers of times and poses differ.
    """
    if len(times_us) != len(poses):
        raise ValueError(f"times_us must be as many as the poses, {len(poses)}, got {len(times_us)}")
    lines = []
    for time_us, each in zip(times_us, poses, strict=True):
        seconds, rest = divmod(int(time_us), 1_000_000)
        values = (*each[:3, 3], *_quaternion(each[:3, :3]))
        lines.append(f"{seconds}.{rest:06d} " + " ".join(f"{value + 0.0:.9f}" for value in values) + "\n")
    return "".join(lines)


def read_tum(path: Path) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Read poses in TUM's format, in which # begins a comment.

    Args:
        path: The file.

    Returns:
        Times (N,) [us] and poses (N, 4, 4).

    Raises:
        DatasetError: The file is absent or empty, or a line is no pose; the message names both.
    """
    numbers = _numbers(path, count=8)
    length = np.linalg.norm(numbers[:, 4:], axis=1)
    wrong = np.abs(length - 1) > _ROTATION_TOLERANCE
    if wrong.any():
        raise DatasetError(f"{path}: pose {int(np.argmax(wrong)) + 1} has a quaternion that is no rotation")
    poses = np.tile(np.eye(4), (len(numbers), 1, 1))
    poses[:, :3, :3] = _rotations(numbers[:, 4:] / length[:, None])
    poses[:, :3, 3] = numbers[:, 1:4]
    return np.rint(numbers[:, 0] * 1e6).astype(np.int64), poses


def _numbers(path: Path, *, count: int) -> NDArray[np.float64]:
    """Return the rows (N, count) of finite numbers in a text file, without empty lines and comments."""
    rows = []
    for number, line in enumerate(read_text(path).splitlines(), 1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        try:
            row = [float(word) for word in words]
        except ValueError as error:
            raise DatasetError(f"{path}: line {number} is no pose ({error})") from error
        if len(row) != count or not all(map(math.isfinite, row)):
            raise DatasetError(
                f"{path}: line {number} is no pose: {count} finite numbers, got {line.strip()!r}"
            )
        rows.append(row)
    if not rows:
        raise DatasetError(f"{path}: no poses in it")
    return np.array(rows)


def _quaternion(rotation: NDArray[np.float64]) -> tuple[float, float, float, float]:
    """Return x, y, z, w >= 0 of a rotation (3, 3), from its largest component (Shepperd 1978)."""
    r = rotation
    trace = np.trace(r)
    # 4 q q^T for q = (x, y, z, w); its largest column is numerically the most stable one.
    outer = np.array(
        [
            [1 + 2 * r[0, 0] - trace, r[0, 1] + r[1, 0], r[0, 2] + r[2, 0], r[2, 1] - r[1, 2]],
            [r[0, 1] + r[1, 0], 1 + 2 * r[1, 1] - trace, r[1, 2] + r[2, 1], r[0, 2] - r[2, 0]],
            [r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], 1 + 2 * r[2, 2] - trace, r[1, 0] - r[0, 1]],
            [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], 1 + trace],
        ]
    )
    column = outer[:, int(np.argmax(np.diag(outer)))]
    x, y, z, w = (column / np.linalg.norm(column) * (1.0 if column[3] >= 0 else -1.0)).tolist()
    return x, y, z, w


def _rotations(quaternions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return rotations (N, 3, 3) of unit quaternions (N, 4), x, y, z, w."""
    x, y, z, w = np.moveaxis(quaternions, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)
