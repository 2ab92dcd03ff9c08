"""Planar rigid motions, the group SE(2): composition, inverse, relative pose, exponential and logarithm.

Axes are Oxford's (docs/conventions.md): x forward, y right [m], yaw clockwise seen from above [rad]. `T_a_b`
maps b into a. Exponential and logarithm after Solà et al., "A micro Lie theory for state estimation in
robotics", 2018, appendix on SE(2); they take arrays of the namespace `xp`, NumPy or torch.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

_SMALL_RAD = 1e-4
"""Yaw below which series stand for the quotients of the exponential and the logarithm."""

# ---------------------------------------------------------------------- arrays of poses


def compose(first: ArrayLike, second: ArrayLike) -> NDArray[np.float64]:
    """Chain poses: T_a_c = T_a_b T_b_c.

    Args:
        first: T_a_b (..., 3): x, y [m], yaw [rad].
        second: T_b_c (..., 3), in the axes of b.

    Returns:
        T_a_c (..., 3); its yaw is the plain sum of both yaws, so that a chain counts full turns.
    """
    one, other = np.asarray(first, np.float64), np.asarray(second, np.float64)
    cosine, sine = np.cos(one[..., 2]), np.sin(one[..., 2])
    x = one[..., 0] + cosine * other[..., 0] - sine * other[..., 1]
    y = one[..., 1] + sine * other[..., 0] + cosine * other[..., 1]
    return np.stack([x, y, one[..., 2] + other[..., 2]], axis=-1)


def relative(first: ArrayLike, second: ArrayLike) -> NDArray[np.float64]:
    """Compute the pose of one frame in another: T_b_c = T_a_b^-1 T_a_c.

    Args:
        first: T_a_b (..., 3): x, y [m], yaw [rad].
        second: T_a_c (..., 3).

    Returns:
        T_b_c (..., 3), yaw in [-pi, pi].
    """
    one, other = np.asarray(first, np.float64), np.asarray(second, np.float64)
    dx, dy, yaw = np.moveaxis(other - one, -1, 0)
    cosine, sine = np.cos(one[..., 2]), np.sin(one[..., 2])
    return np.stack([cosine * dx + sine * dy, cosine * dy - sine * dx, wrapped(yaw)], axis=-1)


def inverse(poses: ArrayLike) -> NDArray[np.float64]:
    """Invert poses: T_b_a of T_a_b.

    Args:
        poses: T_a_b (..., 3): x, y [m], yaw [rad].

    Returns:
        T_b_a (..., 3), yaw in [-pi, pi].
    """
    return relative(poses, np.zeros(3))


def chain(motions: ArrayLike) -> NDArray[np.float64]:
    """Chain successive motions into poses in the first frame.

    Args:
        motions: T_(i-1)_i (N, 3): x, y [m], yaw [rad].

    Returns:
        T_0_i (N + 1, 3), the first of them the identity.

    Raises:
        ValueError: `motions` is not (N, 3) or not finite.
    """
    steps = np.asarray(motions, np.float64)
    if steps.ndim != 2 or steps.shape[1] != 3:
        raise ValueError(f"motions must be finite (pairs, 3), got shape {steps.shape}")
    if not np.isfinite(steps).all():
        raise ValueError("motions must be finite (pairs, 3), got numbers that are not finite")
    poses = np.zeros((len(steps) + 1, 3))
    for i, step in enumerate(steps):
        poses[i + 1] = compose(poses[i], step)
    return poses


def transform(poses: ArrayLike, points_m: ArrayLike) -> NDArray[np.float64]:
    """Map points of frame b into frame a.

    Args:
        poses: T_a_b (..., 3): x, y [m], yaw [rad]; broadcast against the points.
        points_m: Points (..., 2) in b: forward, right [m].

    Returns:
        The points (..., 2) in a [m].
    """
    points = np.asarray(points_m, np.float64)
    return compose(poses, np.concatenate([points, np.zeros_like(points[..., :1])], axis=-1))[..., :2]


def wrapped(yaw_rad: ArrayLike) -> NDArray[np.float64]:
    """Reduce angles to [-pi, pi].

    Args:
        yaw_rad: Angles of any shape [rad].

    Returns:
        The same directions in [-pi, pi] [rad]; angles that lie there already keep their bits.
    """
    yaw = np.asarray(yaw_rad, np.float64)
    return yaw - 2 * math.pi * np.round(yaw / (2 * math.pi))


def from_world(poses: ArrayLike) -> NDArray[np.float64]:
    """Convert world poses to planar poses in Oxford axes.

    Args:
        poses: World poses (..., 4): x east, y north, z up [m], yaw counter-clockwise [rad].

    Returns:
        Poses (..., 3): x, -y, -yaw, so that y is right of x and yaw is clockwise from above.
    """
    return np.asarray(poses, np.float64)[..., [0, 1, 3]] * [1.0, -1.0, -1.0]


def to_world(poses: ArrayLike) -> NDArray[np.float64]:
    """Convert planar poses in Oxford axes to world poses at height 0: the inverse of `from_world`.

    Args:
        poses: Poses (..., 3): x, y [m], yaw clockwise [rad].

    Returns:
        World poses (..., 4): x east, y north, z = 0 [m], yaw counter-clockwise [rad].
    """
    x, y, yaw = np.moveaxis(np.asarray(poses, np.float64), -1, 0)
    return np.stack([x, -y, np.zeros_like(x), -yaw], axis=-1)


# ---------------------------------------------------------------------- exponential and logarithm


def exp(twists: Any, *, xp: Any = np) -> Any:
    """Compute the pose reached at constant velocity: the exponential of SE(2).

    With yaw a: t = V(a) v, V = [[sin a, cos a - 1], [1 - cos a, sin a]] / a.

    Args:
        twists: Velocity times time (..., 3): forward, right [m], yaw [rad], in the moving frame's axes.
        xp: Array namespace of `twists`: `numpy` or `torch`.

    Returns:
        Poses (..., 3): x, y [m], yaw [rad], as arrays of `xp`.
    """
    forward, right, yaw = twists[..., 0], twists[..., 1], twists[..., 2]
    small = xp.abs(yaw) < _SMALL_RAD
    safe = xp.where(small, xp.ones_like(yaw), yaw)
    sine = xp.where(small, 1 - yaw**2 / 6, xp.sin(safe) / safe)  # sin a / a
    cosine = xp.where(small, yaw / 2, (1 - xp.cos(safe)) / safe)  # (1 - cos a) / a
    return xp.stack([sine * forward - cosine * right, cosine * forward + sine * right, yaw], axis=-1)


def log(poses: Any, *, xp: Any = np) -> Any:
    """Compute the constant velocity times time that leads to a pose: the logarithm of SE(2).

    Args:
        poses: Poses (..., 3): x, y [m], yaw in (-pi, pi) [rad].
        xp: Array namespace of `poses`: `numpy` or `torch`.

    Returns:
        Twists (..., 3): forward, right [m], yaw [rad], whose `exp` is `poses`, as arrays of `xp`.
    """
    forward, right, yaw = poses[..., 0], poses[..., 1], poses[..., 2]
    half = yaw / 2
    small = xp.abs(half) < _SMALL_RAD
    safe = xp.where(small, xp.ones_like(half), half)
    along = xp.where(small, 1 - half**2 / 3, safe / xp.tan(safe))  # diagonal of the inverse of V
    return xp.stack([along * forward + half * right, along * right - half * forward, yaw], axis=-1)


# ---------------------------------------------------------------------- a single pose


@dataclass(frozen=True, kw_only=True)
class SE2:
    """One pose or motion T_a_b. `T_a_b @ T_b_c` is T_a_c.

    Attributes:
        x_m: Forward [m].
        y_m: Right [m].
        yaw_rad: Clockwise seen from above [rad].
    """

    x_m: float
    y_m: float
    yaw_rad: float

    @classmethod
    def from_array(cls, pose: ArrayLike) -> "SE2":
        """Make a pose of an array.

        Args:
            pose: x, y [m], yaw [rad] (3,).

        Returns:
            The pose.
        """
        x_m, y_m, yaw_rad = np.asarray(pose, np.float64).tolist()
        return cls(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad)

    @property
    def array(self) -> NDArray[np.float64]:
        """X, y [m], yaw [rad] (3,)."""
        return np.array([self.x_m, self.y_m, self.yaw_rad])

    @property
    def length_m(self) -> float:
        """Distance that the origin moves [m]."""
        return math.hypot(self.x_m, self.y_m)

    def __matmul__(self, other: "SE2") -> "SE2":
        """Chain two poses: T_a_c = T_a_b @ T_b_c.

        Args:
            other: T_b_c of this T_a_b.

        Returns:
            T_a_c, yaw in [-pi, pi].
        """
        x_m, y_m, yaw_rad = compose(self.array, other.array).tolist()
        return SE2(x_m=x_m, y_m=y_m, yaw_rad=float(wrapped(yaw_rad)))

    def inverse(self) -> "SE2":
        """Invert the pose.

        Returns:
            T_b_a of this T_a_b, yaw in [-pi, pi].
        """
        return SE2.from_array(inverse(self.array))

    def scaled(self, factor: float) -> "SE2":
        """Scale a motion, as an approximation of the motion after `factor` of its time.

        Args:
            factor: Part of the time.

        Returns:
            The motion with x, y and yaw multiplied by `factor`; exact for a yaw of 0.
        """
        return SE2(x_m=factor * self.x_m, y_m=factor * self.y_m, yaw_rad=factor * self.yaw_rad)


IDENTITY = SE2(x_m=0.0, y_m=0.0, yaw_rad=0.0)
"""No motion."""


def relative_from_world(earlier: ArrayLike, later: ArrayLike) -> SE2:
    """Compute the motion of the car between two of its poses in the world.

    Args:
        earlier: World pose (4,): x, y, z [m], yaw counter-clockwise [rad].
        later: World pose (4,).

    Returns:
        T_earlier_later in Oxford axes, yaw in [-pi, pi].
    """
    return SE2.from_array(relative(from_world(earlier), from_world(later)) + 0.0)
