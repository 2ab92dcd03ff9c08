"""Planar motions as tensors: conversion from and to `sim.datasets.se2.SE2`, and the action on points."""

from collections.abc import Sequence

import torch
from torch import Tensor

from echoscape.learn.geometry.procrustes import Motion, moved, rotation_of_yaw
from echoscape.sim.datasets.se2 import SE2


def to_motion(poses: SE2 | Sequence[SE2], dtype: torch.dtype = torch.float32) -> Motion:
    """Convert poses to a batch of motions.

    Args:
        poses: B poses, or one, which becomes a batch of one.
        dtype: Number format of the tensors.

    Returns:
        Motions with rotation (B, 2, 2), translation (B, 2) [m], all marked certain.
    """
    each = [poses] if isinstance(poses, SE2) else poses
    yaw = torch.tensor([pose.yaw_rad for pose in each], dtype=torch.float64)
    return Motion(
        rotation=rotation_of_yaw(yaw).to(dtype),
        translation_m=torch.tensor([[pose.x_m, pose.y_m] for pose in each], dtype=dtype),
        certain=torch.ones(len(each), dtype=torch.bool),
    )


def to_pose(motion: Motion) -> SE2:
    """Convert the first of a batch of motions to a pose.

    Args:
        motion: B >= 1 motions.

    Returns:
        The first of them.
    """
    forward, right = motion.translation_m[0].tolist()
    return SE2(x_m=forward, y_m=right, yaw_rad=float(motion.yaw_rad[0]))


def transform(pose: SE2, points_m: Tensor) -> Tensor:
    """Map points by a pose T_a_b.

    Args:
        pose: T_a_b.
        points_m: Points (B, N, 2) in b: forward, right [m].

    Returns:
        The points (B, N, 2) in a [m].
    """
    return moved(points_m, to_motion(pose, points_m.dtype))


def relative(first: Motion, second: Motion) -> Motion:
    """Compute T_b_c of T_a_b and T_a_c.

    Args:
        first: T_a_b, B of them.
        second: T_a_c, B of them.

    Returns:
        T_b_c; certain where both are.
    """
    back = first.rotation.transpose(1, 2)
    away = (second.translation_m - first.translation_m)[..., None]
    certain = second.certain & first.certain
    return Motion(rotation=back @ second.rotation, translation_m=(back @ away)[..., 0], certain=certain)
