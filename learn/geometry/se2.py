"""Poses in the plane: one after another, undone, and applied to points. Oxford axes (docs/conventions.md).

The group SE(2) in three numbers; tensors of points stay tensors.
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from echoscape.learn.geometry.procrustes import Motion, moved, rotation_of_yaw


@dataclass(frozen=True, kw_only=True)
class PlaneMotion:
    """A pose T_destination_source: x forward, y right [m], yaw clockwise [rad]."""

    x_m: float
    y_m: float
    yaw_rad: float

    def then(self, other: "PlaneMotion") -> "PlaneMotion":
        """Return T_a_c = T_a_b T_b_c of this T_a_b and the other T_b_c; yaw within half a turn."""
        forward, right = rotated((other.x_m, other.y_m), self.yaw_rad)
        return PlaneMotion(
            x_m=self.x_m + forward,
            y_m=self.y_m + right,
            yaw_rad=math.remainder(self.yaw_rad + other.yaw_rad, 2 * math.pi),
        )

    def inverse(self) -> "PlaneMotion":
        """Return T_b_a of this T_a_b."""
        forward, right = rotated((-self.x_m, -self.y_m), -self.yaw_rad)
        return PlaneMotion(x_m=forward, y_m=right, yaw_rad=-self.yaw_rad)

    def times(self, factor: float) -> "PlaneMotion":
        """Return what becomes of the motion in `factor` of its time, near enough where it turns little."""
        return PlaneMotion(x_m=factor * self.x_m, y_m=factor * self.y_m, yaw_rad=factor * self.yaw_rad)

    def of_points(self, points_m: Tensor) -> Tensor:
        """Return points (..., N, 2) forward, right [m] of the source in the frame of the destination."""
        return moved(points_m, self.tensors(points_m.dtype))

    def tensors(self, dtype: torch.dtype = torch.float32) -> Motion:
        """Return the motion as a batch of one."""
        return Motion(
            rotation=rotation_of_yaw(torch.tensor([self.yaw_rad], dtype=torch.float64)).to(dtype),
            translation_m=torch.tensor([[self.x_m, self.y_m]], dtype=dtype),
            certain=torch.ones(1, dtype=torch.bool),
        )

    @property
    def length_m(self) -> float:
        """How far the origin moves [m]."""
        return math.hypot(self.x_m, self.y_m)


STILL = PlaneMotion(x_m=0.0, y_m=0.0, yaw_rad=0.0)
"""No motion."""


def plane_motion_of(motion: Motion) -> PlaneMotion:
    """Return the first of a batch of motions."""
    forward, right = motion.translation_m[0].tolist()
    return PlaneMotion(x_m=forward, y_m=right, yaw_rad=float(motion.yaw_rad[0]))


def rotated(point_m: tuple[float, float], yaw_rad: float) -> tuple[float, float]:
    """Return a point, forward and right [m], rotated clockwise."""
    cosine, sine = math.cos(yaw_rad), math.sin(yaw_rad)
    return cosine * point_m[0] - sine * point_m[1], sine * point_m[0] + cosine * point_m[1]
