"""Plane curves as sampled lines: resampling, offsets, curvature, and the curves on which traffic turns.

Turning lanes are quintic Hermite curves that match position, direction and curvature at both ends.
Turnarounds have linearly changing curvature (clothoids, as in road design).
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root_scalar

from echoscape.scenes.core import portable_math
from echoscape.scenes.core.headings import unwrapped_headings

_END_POINTS = 12

Line = NDArray[np.float64]
"""A sampled curve: (P, 2) float64 [m]."""


def arc_length(line: Line) -> NDArray[np.float64]:
    """Return the arc length at each point of a line.

    Args:
        line: Line (P, 2) [m].

    Returns:
        Distance along the line from its first point (P,) [m].
    """
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])


def resampled(line: Line, step_m: float) -> Line:
    """Resample a line at equal spacing, keeping both ends.

    Args:
        line: Line (P, 2) [m].
        step_m: Largest spacing of the new points [m].

    Returns:
        Resampled line (N, 2) [m].
    """
    along = arc_length(line)
    return points_at(line, np.linspace(0.0, along[-1], max(int(np.ceil(along[-1] / step_m)), 3) + 1))


def points_at(line: Line, distance_m: NDArray[np.float64]) -> Line:
    """Interpolate points on a line.

    Args:
        line: Line (P, 2) [m].
        distance_m: Distances along the line (N,) [m].

    Returns:
        Points (N, 2) [m].
    """
    along = arc_length(line)
    return np.stack([np.interp(distance_m, along, line[:, axis]) for axis in range(2)], axis=-1)


def section(line: Line, start_m: float, end_m: float) -> Line:
    """Cut a section out of a line.

    Args:
        line: Line (P, 2) [m].
        start_m: Distance along the line at which the section starts [m].
        end_m: Distance along the line at which it ends [m].

    Returns:
        The section (N, 2) [m].
    """
    along = arc_length(line)
    inside = along[(along > start_m + 1e-3) & (along < end_m - 1e-3)]
    return points_at(line, np.concatenate([[start_m], inside, [end_m]]))


def tangents(line: Line) -> Line:
    """Return unit tangents, of second order at the ends as well.

    Args:
        line: Line (P, 2) [m].

    Returns:
        Unit vectors (P, 2) in the direction of travel.
    """
    step = np.diff(line, axis=0)
    length = np.sqrt(step[:, :1] ** 2 + step[:, 1:] ** 2)
    chord = step / length
    both = length[:-1] + length[1:]
    bend = (chord[1:] - chord[:-1]) / both
    inside = chord[:-1] + length[:-1] * bend
    slope = np.concatenate([chord[:1] - length[:1] * bend[:1], inside, chord[-1:] + length[-1:] * bend[-1:]])
    return slope / np.sqrt(slope[:, :1] ** 2 + slope[:, 1:] ** 2)


def left_normals(line: Line) -> Line:
    """Return unit normals that point to the left of travel.

    Args:
        line: Line (P, 2) [m].

    Returns:
        Unit vectors (P, 2).
    """
    along = tangents(line)
    return np.stack([-along[:, 1], along[:, 0]], axis=-1)


def offset(line: Line, distance_m: float) -> Line:
    """Offset a line sideways.

    Args:
        line: Line (P, 2) [m].
        distance_m: Distance to the left, negative to the right [m].

    Returns:
        The parallel line (P, 2) [m].
    """
    return line + distance_m * left_normals(line)


def headings(line: Line) -> NDArray[np.float64]:
    """Return the heading of the tangent at each point.

    Args:
        line: Line (P, 2) [m].

    Returns:
        Unwrapped headings (P,) [rad], counter-clockwise from x.
    """
    return unwrapped_headings(tangents(line))


def curvature(line: Line) -> NDArray[np.float64]:
    """Return the signed curvature at each point.

    Args:
        line: Line (P, 2) [m].

    Returns:
        Curvature (P,) [1/m], positive where the line bends to the left.
    """
    return np.gradient(headings(line), arc_length(line), edge_order=1)


def smallest_radius(line: Line) -> float:
    """Return the smallest radius of curvature, from the change of heading per sample.

    Args:
        line: Line (P, 2) [m].

    Returns:
        Radius [m].
    """
    steps = np.diff(line, axis=0)
    bend = np.abs(np.diff(unwrapped_headings(steps)))
    length = np.hypot(*steps.T)
    return float(1.0 / max(np.max(2 * bend / (length[1:] + length[:-1])), 1e-9))


def connecting_curve(before: Line, after: Line, *, step_m: float = 0.1) -> Line:
    """Return a smooth curve that connects two lines.

    A quintic Hermite curve with matching position, direction and curvature. Its speeds at the two ends are
    chosen from a grid so that the largest curvature is least. Results are cached, since a road graph needs
    most curves several times.

    Args:
        before: Line that ends where the curve starts (P, 2) [m]; only its last 12 points matter.
        after: Line that starts where the curve ends (P, 2) [m]; only its first 12 points matter.
        step_m: Largest spacing of the points [m].

    Returns:
        The curve (N, 2) [m].
    """
    ends = (np.ascontiguousarray(line, np.float64) for line in (before[-_END_POINTS:], after[:_END_POINTS]))
    return _connecting_curve(*(line.tobytes() for line in ends), step_m).copy()


@lru_cache(maxsize=4096)
def _connecting_curve(before_bytes: bytes, after_bytes: bytes, step_m: float) -> Line:
    """Return the curve between two lines that are given as the bytes of their (P, 2) float64 points."""
    (start, leaving, first_bend), (end, arriving, last_bend) = _end(before_bytes), _start(after_bytes)
    direction = np.stack([leaving, arriving])  # (2, 2)
    bend = np.array([first_bend, last_bend])
    chord = float(np.linalg.norm(end - start))
    speed = chord * np.linspace(0.7, 2.0, 10)
    leave, arrive = (grid.ravel() for grid in np.meshgrid(speed, speed))  # (G,)
    candidates = _quintics(start, end, direction, bend, np.stack([leave, arrive], axis=-1))  # (G, T, 2)
    best = int(np.argmin(_peak_curvature(candidates)))
    line = _quintics(start, end, direction, bend, np.array([[leave[best], arrive[best]]]), samples=801)[0]
    line[0], line[-1] = start, end
    return resampled(line, step_m)


@lru_cache(maxsize=4096)
def _start(points_bytes: bytes) -> tuple[Line, Line, float]:
    """Return place (2,), direction (2,) and curvature [1/m] at the start of a line given as bytes."""
    line = np.frombuffer(points_bytes).reshape(-1, 2)
    return line[0], tangents(line[:8])[0], float(np.median(curvature(line[:12])[1:6]))


@lru_cache(maxsize=4096)
def _end(points_bytes: bytes) -> tuple[Line, Line, float]:
    """Return place (2,), direction (2,) and curvature [1/m] at the end of a line given as bytes."""
    line = np.frombuffer(points_bytes).reshape(-1, 2)
    return line[-1], tangents(line[-8:])[-1], float(np.median(curvature(line[-12:])[-6:-1]))


def _quintics(
    start: Line, end: Line, direction: Line, bend: NDArray[np.float64], speeds: Line, samples: int = 41
) -> NDArray[np.float64]:
    """Return (G, samples, 2) quintic Hermite curves, one for each row of `speeds` (G, 2)."""
    normal = np.stack([-direction[:, 1], direction[:, 0]], axis=-1)
    first = speeds[:, :, None] * direction  # (G, 2 ends, 2)
    second = speeds[:, :, None] ** 2 * (bend[:, None] * normal)
    gap = np.broadcast_to(end - start, first[:, 0].shape)
    rest = gap - first[:, 0] - second[:, 0] / 2
    slope = first[:, 1] - first[:, 0] - second[:, 0]
    hump = second[:, 1] - second[:, 0]
    cubic, quartic, fifth = (
        10 * rest - 4 * slope + hump / 2,
        -15 * rest + 7 * slope - hump,
        6 * rest - 3 * slope + hump / 2,
    )
    time = np.linspace(0.0, 1.0, samples)[:, None]
    lines = fifth[:, None, :] * time
    for factor in (quartic, cubic, second[:, 0] / 2, first[:, 0]):  # Horner's scheme
        lines += factor[:, None, :]
        lines *= time
    lines += start
    return lines


def _peak_curvature(lines: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (G,) the greatest absolute curvature [1/m] of each of the (G, T, 2) lines."""
    step = np.diff(lines, axis=1)
    length = np.maximum(np.linalg.norm(step, axis=-1), 1e-9)
    cross = step[:, :-1, 0] * step[:, 1:, 1] - step[:, :-1, 1] * step[:, 1:, 0]
    bend = np.abs(portable_math.arctan2(cross, np.sum(step[:, :-1] * step[:, 1:], axis=-1)))
    return np.max(2 * bend / (length[:, 1:] + length[:, :-1]), axis=1)


def turnaround(offset_m: float, radius_m: float, *, side_radius_m: float = 9.0, step_m: float = 0.25) -> Line:
    """Return a turnaround: a U-turn to the left that first swings out to the right.

    It leads from (0, -offset_m) with heading +x to (0, offset_m) with heading -x.

    Args:
        offset_m: Half the distance between the two lanes [m].
        radius_m: Radius of the turn [m]; may exceed `offset_m`.
        side_radius_m: Radius of the swing to the right [m].
        step_m: Largest spacing of the points [m].

    Returns:
        The curve (N, 2) [m].
    """
    ramp = min(radius_m, side_radius_m) * 0.4

    def half(swing_rad: float) -> Line:
        """Return the first half (P, 2) of the curve for a swing to the right of `swing_rad`."""
        dip, rise = side_radius_m * swing_rad, radius_m * (np.pi / 2 + swing_rad)  # lengths at full curvature
        ease, rush = min(ramp, dip / 2), min(ramp, rise / 2)
        knots = [0.0, ease, dip, dip + ease, dip + ease + rush, dip + ease + rise + rush / 2]
        values = [0.0, -1 / side_radius_m, -1 / side_radius_m, 0.0, 1 / radius_m, 1 / radius_m]
        along = np.linspace(0.0, knots[-1], 4001)
        bend = np.interp(along, knots, values)
        step = along[1]
        heading = np.concatenate([[0.0], np.cumsum((bend[1:] + bend[:-1]) / 2 * step)])
        heading += (np.pi / 2 - heading[-1]) * along / along[-1]
        middle = (heading[1:] + heading[:-1]) / 2
        steps = np.stack([np.cos(middle), np.sin(middle)], axis=-1) * step
        return np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])

    swing = root_scalar(lambda angle: half(angle)[-1, 1] - offset_m, bracket=(1e-3, 1.5), xtol=1e-12).root
    first = half(swing) - [0.0, offset_m]
    line = np.concatenate([first, (first * [1.0, -1.0])[-2::-1]])
    line[0], line[-1] = (0.0, -offset_m), (0.0, offset_m)
    return resampled(line, step_m)


def transformed(line: Line, origin: Line, heading_rad: float) -> Line:
    """Rotate a line and move it to a place.

    Args:
        line: Line (P, 2) [m] in its own frame.
        origin: Place of that frame's origin (2,) [m].
        heading_rad: Heading of that frame's x axis [rad].

    Returns:
        The line (P, 2) [m] in the world.
    """
    cos, sin = np.cos(heading_rad), np.sin(heading_rad)
    return origin + line @ np.array([[cos, sin], [-sin, cos]])
