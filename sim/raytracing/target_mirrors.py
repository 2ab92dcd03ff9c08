"""Plane mirrors in which coherent targets are seen: the method of images.

A mirror images the antenna. A leg of a path by way of it is as long as from the image, and carries the
complex Fresnel coefficient of a vertically polarised wave times the root of the mirror part of the reflected
power (`sim.raytracing.surface.scattering`). Mirrors are found by geometry, not by rays that meet them by
chance: they are the flat faces of the scene on which the specular point may lie.

A mirror that does not fill the first Fresnel zone reflects less. The share that it fills, of a zone weighted
with exp(-pi u^2 / b^2), b^2 = lambda d1 d2 / (d1 + d2), is the factor on the amplitude: 1 for a large mirror,
1/2 at the edge of a half plane, and area / b^2 for a small one, as the Fresnel integral has them (Born &
Wolf, Principles of Optics, 8.7) without its ripple.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.materials import MATERIAL_NAMES, MATERIALS
from echoscape.scenes.core.scene import Mesh, Scene
from echoscape.scenes.core.targets import Target
from echoscape.sim.raytracing.intersection import RayScene
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.raytracing.surface.fresnel import permittivity, vertical_reflection
from echoscape.sim.raytracing.surface.scattering import roughened
from echoscape.sim.settings.surfaces import SurfaceSettings

VOLUMES = ("foliage", "person")
"""Materials whose faces stand for leaves or cloth in all directions: no plane mirrors."""
LEAST_AREA_M2 = 3.0
"""Smallest plane that is taken as a mirror [m^2]."""
_LEAST_FACE_M2 = 0.02
_LEAST_WIDTH_M = 0.05
"""Faces of less area, or narrower, are far smaller than a Fresnel zone."""
_NORMAL_STEP, _OFFSET_STEP_M = 1e-3, 1e-2
"""Steps of normal and distance from the origin by which faces are gathered in planes."""
_SAME_NORMAL, _SAME_PLANE_M = 1 - 1e-6, 2e-3
"""Faces of one mirror: cosine between their normals, and distance from its plane."""
_NEAREST_M = 1e-2
"""Antenna and target lie at least this far in front of a mirror [m]."""
_SKIN_M = 5e-3
_MAIN_SHARE = 0.05
"""Share of the turn in which a beam's main lobe passes a target."""
_ZONE_POINTS, _FEW_POINTS = 32, 8
"""Points in which a zone is divided, and those that decide whether it is worth more."""
_ZONE_RADII = 1.2
"""Radii b of the Fresnel zone within which a face adds to its share."""

Vectors = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class MirrorFaces:
    """The F flat faces of a scene that may be mirrors, in order of the G planes that they lie in.

    Attributes:
        corners: Corners of each face (F, 3, 3) float64 [m].
        normal: Unit normal of each face (F, 3) float64.
        material: Material id of each face (F,) int64.
        instance: Instance id of each face (F,) int64.
        middle: Mean of the corners of each face (F, 3) float64 [m].
        reach_m: Distance of the farthest corner from it (F,) float64 [m].
        first: First face of each plane, and F at the end (G + 1,) int64.
        centre: Centre of a sphere about the faces of each plane (G, 3) float64 [m].
        radius_m: Its radius (G,) float64 [m].
    """

    corners: NDArray[np.float64]
    normal: Vectors
    material: NDArray[np.int64]
    instance: NDArray[np.int64]
    middle: Vectors
    reach_m: NDArray[np.float64]
    first: NDArray[np.int64]
    centre: Vectors
    radius_m: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Mirror:
    """One plane mirror.

    Attributes:
        normal: Unit normal (3,) float64, on the side of antenna and target.
        offset_m: Distance of the plane from the origin along the normal [m].
        material: Material id.
        instance: Instance id of the face nearest to the specular point.
    """

    normal: NDArray[np.float64]
    offset_m: float
    material: int
    instance: int

    def image(self, points: Vectors) -> Vectors:
        """Return the mirror images of points.

        Args:
            points: Points (..., 3) [m].

        Returns:
            Their images (..., 3) [m].
        """
        return points - 2 * (points @ self.normal - self.offset_m)[..., None] * self.normal


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


def mirror_faces(scene: Scene) -> MirrorFaces:
    """Gather the flat faces of a scene by planes, but for those of its coherent targets.

    Args:
        scene: The scene.

    Returns:
        Faces of all planes of `LEAST_AREA_M2` or more.
    """
    own = [each.instance for each in scene.targets if each.target.coherent]
    parts = [(np.zeros((0, 3, 3)), np.zeros(0, np.int64), np.zeros(0, np.int64))]
    parts += [
        _flat_faces(mesh, material, mesh.instance.astype(np.int64), np.isin(mesh.instance, own))
        for material, mesh in scene.static.items()
    ]
    places = scene.placements
    for index in np.unique(places.prototype).tolist():
        placed = np.flatnonzero(places.prototype == index)
        for material, mesh in scene.prototypes[index].parts.items():
            none = np.zeros(len(mesh.faces), np.bool_)
            corners, number, _ = _flat_faces(mesh, material, np.zeros(len(mesh.faces), np.int64), none)
            cosine, sine = (each[:, None, None] for each in (np.cos(places.yaw), np.sin(places.yaw)))
            for at in placed.tolist():
                x, y, z = np.moveaxis(corners * places.scale[at], -1, 0)
                turned = np.stack([cosine[at] * x - sine[at] * y, sine[at] * x + cosine[at] * y, z], axis=-1)
                instance = np.full(len(corners), int(places.instance[at]))
                parts.append((turned + places.position[at], number, instance))
    return _by_planes(*(np.concatenate(each) for each in zip(*parts, strict=True)))


def _flat_faces(
    mesh: Mesh, material: str, instance: NDArray[np.int64], left_out: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Return corners (F, 3, 3), material and instance (F,) of the faces that may be part of a mirror."""
    if material in VOLUMES:
        left_out = np.ones_like(left_out)
    if mesh.normals is not None:
        left_out = left_out | mesh.normals.any(axis=(1, 2))
    keep = np.flatnonzero(~left_out)
    corners = mesh.vertices[mesh.faces[keep]].astype(np.float64)
    edges = np.roll(corners, -1, axis=1) - corners
    twice_m2 = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    longest_m = np.linalg.norm(edges, axis=2).max(axis=1, initial=0.0)
    large = (twice_m2 > 2 * _LEAST_FACE_M2) & (twice_m2 > _LEAST_WIDTH_M * longest_m)
    number = np.full(int(large.sum()), MATERIAL_NAMES.index(material), np.int64)
    return corners[large], number, instance[keep[large]]


def _by_planes(
    corners: NDArray[np.float64], material: NDArray[np.int64], instance: NDArray[np.int64]
) -> MirrorFaces:
    """Sort faces by planes and leave out those of small planes."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area_m2 = np.linalg.norm(normal, axis=1) / 2
    normal /= 2 * area_m2[:, None]
    offset_m = np.einsum("fk,fk->f", normal, corners[:, 0])
    _, plane = np.unique(_plane_keys(normal, offset_m, material), return_inverse=True)
    large = np.bincount(plane, area_m2)[plane] >= LEAST_AREA_M2 if len(plane) else plane.astype(np.bool_)
    order = np.flatnonzero(large)[np.argsort(plane[large], kind="stable")]
    corners, plane = corners[order], plane[order]
    first = np.flatnonzero(np.diff(plane, prepend=-1))
    middle = corners.mean(axis=1)
    counts = np.diff(first, append=len(plane))
    centre = np.add.reduceat(middle, first) / counts[:, None] if len(first) else np.zeros((0, 3))
    away_m = np.linalg.norm(corners - np.repeat(centre, counts, axis=0)[:, None], axis=2).max(
        axis=1, initial=0
    )
    return MirrorFaces(
        corners=corners,
        normal=normal[order],
        material=material[order],
        instance=instance[order],
        middle=middle,
        reach_m=np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1, initial=0),
        first=np.append(first, len(plane)),
        centre=centre,
        radius_m=np.maximum.reduceat(away_m, first) if len(first) else np.zeros(0),
    )


def _plane_keys(
    normal: Vectors, offset_m: NDArray[np.float64], material: NDArray[np.int64]
) -> NDArray[np.uint64]:
    """Return a number (F,) that faces of one plane and material share."""
    steps = [*np.rint(normal / _NORMAL_STEP).T, np.rint(offset_m / _OFFSET_STEP_M), material]
    key = np.zeros(len(material), np.uint64)
    for step in steps:
        key = (key ^ np.asarray(step, np.int64).astype(np.uint64)) * np.uint64(0x9E3779B97F4A7C15)
        key ^= key >> np.uint64(29)
    return key


def specular_points(normal: Vectors, offset_m: NDArray[np.float64], a: Vectors, b: Vectors) -> Vectors:
    """Return the points of planes at which they mirror a point into another.

    Args:
        normal: Unit normals (N, 3).
        offset_m: Distances of the planes from the origin along them (N,) [m].
        a: Points in front of the planes (N, 3) [m].
        b: Other points in front of them (N, 3) [m].

    Returns:
        Specular points (N, 3) [m].
    """
    height_a = np.einsum("nk,nk->n", normal, a) - offset_m
    height_b = np.einsum("nk,nk->n", normal, b) - offset_m
    share = (height_a / (height_a + height_b))[:, None]
    return a + share * (b - 2 * height_b[:, None] * normal - a)


class TargetMirrors:
    """Finds the mirrors of coherent targets in a scene, and what legs by way of them carry."""

    def __init__(
        self,
        faces: MirrorFaces,
        *,
        carrier_hz: float,
        wavelength_m: float,
        reach_m: float,
        surfaces: SurfaceSettings | None = None,
    ) -> None:
        """Tabulate the materials.

        Args:
            faces: The faces that may be mirrors.
            carrier_hz: Carrier frequency [Hz].
            wavelength_m: Its wavelength [m].
            reach_m: Longest leg [m].
            surfaces: Changes to the roughness of the materials; None is none.
        """
        self._faces, self._wavelength_m, self._reach_m = faces, wavelength_m, reach_m
        self._materials = [roughened(each, surfaces or SurfaceSettings()) for each in MATERIALS.values()]
        self._epsilon = [permittivity(each, carrier_hz) for each in self._materials]
        plane = faces.first[:-1]
        self._plane_normal = faces.normal[plane]
        self._plane_offset_m = np.einsum("gk,gk->g", self._plane_normal, faces.corners[plane, 0])

    def mirrors(
        self, target: Vectors, positions: Vectors, nearest_azimuth: Callable[[Vectors], NDArray[np.int64]]
    ) -> list[Mirror]:
        """Return the mirrors that may show a target to the azimuths that point at it or at its image.

        Args:
            target: Reference point of the target (3,) [m].
            positions: Position of the antenna at each azimuth of a scan (A, 3) [m].
            nearest_azimuth: Returns the azimuths (N,) that point at directions (N, 3).

        Returns:
            The mirrors, not yet tested for what hides them.
        """
        middle = positions[len(positions) // 2]
        moved_m = float(np.linalg.norm(positions - middle, axis=1).max())
        face = self._faces_near(target, middle, slack_m=moved_m)
        face = face[self._reflects(face, target, np.broadcast_to(middle, (len(face), 3)), slack_m=moved_m)]
        normal = self._faces.normal[face]
        height_m = np.einsum("fk,fk->f", normal, target - self._faces.corners[face, 0])
        images = target - 2 * height_m[:, None] * normal
        slack_m = moved_m * _MAIN_SHARE
        shown = np.zeros(len(face), np.bool_)
        for towards in (images - middle, np.broadcast_to(target - middle, images.shape)):
            antenna = positions[nearest_azimuth(towards)]
            shown |= self._reflects(face, target, antenna, slack_m=slack_m)
        found: list[Mirror] = []
        for index in face[shown].tolist():
            mirror, corner = self._mirror(index, middle), self._faces.corners[index, 0]
            if not any(_same(each, mirror, corner) for each in found):
                found.append(mirror)
        return found

    def _mirror(self, face: int, antenna: Vectors) -> Mirror:
        """Return the mirror that a face is part of, its normal on the side of the antenna."""
        normal, corner = self._faces.normal[face], self._faces.corners[face, 0]
        if (antenna - corner) @ normal < 0:
            normal = -normal
        return Mirror(
            normal=normal,
            offset_m=float(corner @ normal),
            material=int(self._faces.material[face]),
            instance=int(self._faces.instance[face]),
        )

    def _faces_near(self, target: Vectors, antenna: Vectors, *, slack_m: float) -> NDArray[np.int64]:
        """Return the faces near the specular points of their planes, target and antenna in front of these."""
        normal, offset_m, faces = self._plane_normal, self._plane_offset_m, self._faces
        height_t, height_a = normal @ target - offset_m, normal @ antenna - offset_m
        plane = np.flatnonzero(height_t * height_a > 0)
        height_t, height_a, normal = height_t[plane], height_a[plane], normal[plane]
        step = (height_a / (height_a + height_t))[:, None]
        image = target - 2 * height_t[:, None] * normal
        leg_m = np.linalg.norm(image - antenna, axis=1)
        point = antenna + step * (image - antenna)
        # The normals of a plane's faces differ by up to a step, which moves the point with distance.
        allowed_m = slack_m + leg_m * (2 * _NORMAL_STEP) + self._zone_m(leg_m, height_a + height_t)
        aside_m = np.linalg.norm(point - faces.centre[plane], axis=1) - faces.radius_m[plane]
        near = (aside_m <= allowed_m) & (leg_m <= self._reach_m)
        plane, point, allowed_m = plane[near], point[near], allowed_m[near]
        count = faces.first[plane + 1] - faces.first[plane]
        start = faces.first[plane] - (np.cumsum(count) - count)
        face = np.arange(int(count.sum())) + np.repeat(start, count)
        aside_m = np.linalg.norm(faces.middle[face] - np.repeat(point, count, axis=0), axis=1)
        return face[aside_m <= faces.reach_m[face] + np.repeat(allowed_m, count)]

    def _zone_m(self, leg_m: NDArray[np.float64], height_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the largest reach of Fresnel zones along mirrors [m]: half way, elongated by the slant."""
        radius_m = np.sqrt(self._wavelength_m * leg_m) / 2
        return _ZONE_RADII * radius_m * leg_m / np.maximum(np.abs(height_m), _NEAREST_M)

    def _reflects(
        self, face: NDArray[np.int64], target: Vectors, antenna: Vectors, *, slack_m: float
    ) -> NDArray[np.bool_]:
        """Return whether the Fresnel zones of legs from antennas (N, 3) reach faces (N,)."""
        corners, normal = self._faces.corners[face], self._faces.normal[face]
        offset_m = np.einsum("fk,fk->f", normal, corners[:, 0])
        height_t = normal @ target - offset_m
        height_a = np.einsum("fk,fk->f", normal, antenna) - offset_m
        front = (height_t * height_a > 0) & (np.minimum(np.abs(height_t), np.abs(height_a)) > _NEAREST_M)
        height_m = np.where(front, height_a + height_t, 1.0)
        image = target - 2 * height_t[:, None] * normal
        point = antenna + (height_a / height_m)[:, None] * (image - antenna)
        allowed_m = slack_m + self._zone_m(np.linalg.norm(image - antenna, axis=1), height_m)
        edges = np.roll(corners, -1, axis=1) - corners
        inside_m = np.einsum("fek,fek->fe", point[:, None] - corners, np.cross(normal[:, None], edges))
        inside_m /= np.linalg.norm(edges, axis=2)
        return front & (inside_m.min(axis=1, initial=np.inf) >= -allowed_m)

    def coefficient(self, mirror: Mirror, image: Vectors, points: Vectors) -> NDArray[np.complex128]:
        """Return the amplitude factor of legs by way of a mirror.

        Args:
            mirror: The mirror.
            image: Image of the antenna in it (3,) [m].
            points: Where the legs meet the target (S, 3) [m].

        Returns:
            Fresnel coefficient times the root of the mirror's share of the reflected power (S,).
        """
        away = points - image
        direction = away / np.linalg.norm(away, axis=1)[:, None]
        cosine = direction @ mirror.normal
        incident = direction - 2 * cosine[:, None] * mirror.normal
        material = self._materials[mirror.material]
        gamma = vertical_reflection(self._epsilon[mirror.material], incident, mirror.normal)
        rough = 4 * math.pi * material.rms_height_m * cosine / self._wavelength_m
        return gamma * np.sqrt(1 - material.scattering**2) * np.exp(-np.square(rough) / 2)

    def filled_shares(
        self, legs: Sequence[MirrorLegs], positions: Vectors, ray_scene: RayScene, *, exact: bool
    ) -> list[NDArray[np.float64]]:
        """Return the shares of the Fresnel zones of legs that their mirrors fill and nothing hides.

        Args:
            legs: Legs, each by way of one mirror at several azimuths.
            positions: Position of the antenna at every azimuth of the scan (A, 3) [m].
            ray_scene: The scene at these azimuths.
            exact: Whether by 32 rays a leg, or by 8 to find those that are worth it.

        Returns:
            The share at each azimuth of each of `legs`, 0 to 1.
        """
        antenna = [positions[each.azimuth] for each in legs]
        seen = [
            _nearest_points(each.target, each.mirror.image(at))
            for each, at in zip(legs, antenna, strict=True)
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
        front = np.minimum(*heights) > _NEAREST_M
        shares = np.zeros(len(front))
        if front.any():
            ahead = rays.take(front)
            shares[front] = _free_share(
                ahead, self._zone(ahead, _ZONE_POINTS if exact else _FEW_POINTS), ray_scene
            )
        return np.split(shares, np.cumsum(counts)[:-1])

    def _zone(self, rays: "_LegRays", count: int) -> NDArray[np.float64]:
        """Return points (N, Z, 3) [m] that divide the weighted Fresnel zones of legs evenly."""
        normal = rays.normal
        middle = specular_points(normal, rays.offset_m, rays.antenna, rays.seen)
        out = middle - rays.antenna
        out_m, back_m = np.linalg.norm(out, axis=1), np.linalg.norm(rays.seen - middle, axis=1)
        spread_m = np.sqrt(self._wavelength_m * out_m * back_m / (out_m + back_m) / (2 * math.pi))
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


def _same(mirror: Mirror, other: Mirror, corner: NDArray[np.float64]) -> bool:
    """Whether two mirrors, the second with this corner (3,) [m], are one."""
    return (
        mirror.material == other.material
        and abs(float(mirror.normal @ other.normal)) > _SAME_NORMAL
        and abs(float(corner @ mirror.normal) - mirror.offset_m) < _SAME_PLANE_M
    )


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
    met &= np.abs(np.einsum("nk,nk->n", each.normal, hits.normal.numpy().T)) > _SAME_NORMAL
    met &= np.abs(each.height_m(hits.point.numpy().T)) < _SAME_PLANE_M
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
