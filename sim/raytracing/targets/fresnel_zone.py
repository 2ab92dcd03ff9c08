"""The share of a leg's Fresnel zone that its mirror fills and nothing hides.

A mirror that does not fill the first Fresnel zone reflects less. The share that it fills, of a zone weighted
with exp(-pi u^2 / b^2), b^2 = lambda d1 d2 / (d1 + d2), is the factor on the amplitude: 1 for a large mirror,
1/2 at the edge of a half plane, and area / b^2 for a small one, as the Fresnel integral has them (Born &
Wolf, Principles of Optics, 8.7) without its ripple.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.targets import Target
from echoscape.sim.raytracing.intersection import RayScene
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.raytracing.targets.mirrors import (
    NEAREST_M,
    SAME_NORMAL,
    SAME_PLANE_M,
    Mirror,
    Vectors,
    specular_points,
)

_SKIN_M = 5e-3
_ZONE_POINTS, _FEW_POINTS = 32, 8
"""Points in which a zone is divided, and those that decide whether it is worth more."""


@dataclass(frozen=True, kw_only=True)
class MirrorLegs:
    """Legs to a target by way of a mirror, at some azimuths of a scan.

    Attributes:
        target: The target.
        mirror: The mirror.
        azimuth: Numbers of the azimuths (K,) int64.
    """

    target: Target
    mirror: Mirror
    azimuth: NDArray[np.int64]


def filled_shares(
    legs: Sequence[MirrorLegs],
    positions: Vectors,
    ray_scene: RayScene,
    *,
    wavelength_m: float,
    exact: bool,
) -> list[NDArray[np.float64]]:
    """Return the shares of the Fresnel zones of legs that their mirrors fill and nothing hides.

    Args:
        legs: Legs, each by way of one mirror at several azimuths.
        positions: Position of the antenna at every azimuth of the scan (A, 3) [m].
        ray_scene: The scene at these azimuths.
        wavelength_m: Wavelength [m].
        exact: Whether by 32 rays a leg, or by 8 to find those that are worth it.

    Returns:
        The share at each azimuth of each of `legs`, 0 to 1.
    """
    antenna = [positions[each.azimuth] for each in legs]
    seen = [
        _nearest_points(each.target, each.mirror.image(at)) for each, at in zip(legs, antenna, strict=True)
    ]
    counts = [len(each.azimuth) for each in legs]
    rays = _LegRays(
        antenna=np.concatenate(antenna),
        seen=np.concatenate(seen),
        azimuth=np.concatenate([each.azimuth for each in legs]),
        normal=np.repeat([each.mirror.normal for each in legs], counts, axis=0),
        offset_m=np.repeat([each.mirror.offset_m for each in legs], counts),
        material=np.repeat([each.mirror.material for each in legs], counts),
    )
    heights = [rays.height_m(rays.antenna), rays.height_m(rays.seen)]
    front = np.minimum(*heights) > NEAREST_M
    shares = np.zeros(len(front))
    if front.any():
        ahead, count = rays.take(front), _ZONE_POINTS if exact else _FEW_POINTS
        shares[front] = _free_share(ahead, _zone(ahead, count, wavelength_m), ray_scene)
    return np.split(shares, np.cumsum(counts)[:-1])


@dataclass(frozen=True, kw_only=True)
class _LegRays:
    """N legs from `antenna` to `seen` (N, 3) [m] at `azimuth` (N,), by way of mirrors.

    normal (N, 3), offset_m (N,) and material (N,) are those of the mirrors.
    """

    antenna: Vectors
    seen: Vectors
    azimuth: NDArray[np.int64]
    normal: Vectors
    offset_m: NDArray[np.float64]
    material: NDArray[np.int64]

    def take(self, keep: NDArray) -> "_LegRays":
        """Return some of the legs (a mask or an index)."""
        return _LegRays(**{name: value[keep] for name, value in vars(self).items()})

    def height_m(self, points: Vectors) -> NDArray[np.float64]:
        """Return the height of a point (N, 3) over the mirror of each leg (N,) [m]."""
        return np.einsum("nk,nk->n", points, self.normal) - self.offset_m


def _zone(rays: _LegRays, count: int, wavelength_m: float) -> NDArray[np.float64]:
    """Return points (N, Z, 3) [m] that divide the weighted Fresnel zones of legs evenly."""
    normal = rays.normal
    middle = specular_points(normal, rays.offset_m, rays.antenna, rays.seen)
    out = middle - rays.antenna
    out_m, back_m = np.linalg.norm(out, axis=1), np.linalg.norm(rays.seen - middle, axis=1)
    spread_m = np.sqrt(wavelength_m * out_m * back_m / (out_m + back_m) / (2 * math.pi))
    height_m = rays.height_m(rays.antenna)
    along = out + height_m[:, None] * normal
    square = np.linalg.norm(along, axis=1) < 1e-6 * out_m  # all directions are alike
    least = np.eye(3)[np.argmin(np.abs(normal[square]), axis=1)]
    along[square] = np.cross(normal[square], least)
    along /= np.linalg.norm(along, axis=1)[:, None]
    across = np.cross(normal, along)
    u, v = _zone_pattern(count)
    along *= (spread_m * out_m / height_m)[:, None]
    across *= spread_m[:, None]
    return middle[:, None] + u[:, None] * along[:, None] + v[:, None] * across[:, None]


def _zone_pattern(count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return points (Z,) each of which stands for an even share of a Gaussian of unit width: a sunflower."""
    number = np.arange(count) + 0.5
    radius = np.sqrt(-2 * np.log1p(-number / count))
    angle = number * (math.pi * (3 - math.sqrt(5)))
    return radius * np.cos(angle), radius * np.sin(angle)


def _nearest_points(target: Target, images: Vectors) -> Vectors:
    """Return the points (A, 3) [m] that stand for a target as seen from images of the antenna (A, 3)."""
    middle = np.broadcast_to(np.array(target.position_m), images.shape)
    away = images - middle
    if target.kind == "sphere":
        return middle + away * (target.size_m[0] / np.linalg.norm(away, axis=1))[:, None]
    if target.kind == "cylinder":
        radius_m, height_m = target.size_m
        flat_m = np.maximum(np.hypot(away[:, 0], away[:, 1]), 1e-9)[:, None]
        level = np.clip(away[:, 2:], -0.4 * height_m, 0.4 * height_m)  # off the ground that it stands on
        return middle + np.hstack([away[:, :2] * radius_m / flat_m, level])
    # The apex of a corner and the middle of an edge or plate are seen from everywhere, by their own target.
    return middle.copy()


def _free_share(rays: _LegRays, zone: NDArray[np.float64], ray_scene: RayScene) -> NDArray[np.float64]:
    """Return the share (N,) of points (N, Z, 3) at which a ray meets the mirror and goes on to the target."""
    count = zone.shape[1]
    points, each = zone.reshape(-1, 3), rays.take(np.repeat(np.arange(len(zone)), count))
    azimuth = mi.UInt32(each.azimuth.astype(np.uint32))
    out_m, direction = _lengths_and_directions(points - each.antenna)
    always = dr.full(mi.Bool, True, len(points))
    reach = _dr_lengths(out_m + _SKIN_M * out_m)
    hits = ray_scene.intersect(_dr_points(each.antenna), _dr_vectors(direction), azimuth, reach, always)
    dr.eval(hits)
    met = hits.active.numpy() & (hits.material.numpy() == each.material)
    met &= np.abs(np.einsum("nk,nk->n", each.normal, hits.normal.numpy().T)) > SAME_NORMAL
    met &= np.abs(each.height_m(hits.point.numpy().T)) < SAME_PLANE_M
    back_m, direction = _lengths_and_directions(points - each.seen)
    start = each.seen + direction * _SKIN_M
    reach = _dr_lengths(np.maximum(back_m - 2 * _SKIN_M, _SKIN_M))
    hidden = ray_scene.occluded(_dr_points(start), _dr_vectors(direction), azimuth, reach, mi.Bool(met))
    return (met & ~hidden.numpy()).reshape(-1, count).mean(axis=1)


def _lengths_and_directions(vectors: Vectors) -> tuple[NDArray[np.float64], Vectors]:
    length = np.linalg.norm(vectors, axis=1)
    return length, vectors / length[:, None]


def _dr_points(points: Vectors) -> "mi.Point3d":
    return mi.Point3d(np.ascontiguousarray(points.T))


def _dr_vectors(vectors: Vectors) -> "mi.Vector3d":
    return mi.Vector3d(np.ascontiguousarray(vectors.T))


def _dr_lengths(length_m: NDArray[np.float64]) -> "mi.Float":
    return mi.Float(length_m.astype(np.float32))
