"""The mirrors that may show a target to the radar, found by geometry, not by rays that meet them by chance.

They are the flat faces of the scene on which the specular point may lie, or that its Fresnel zone reaches.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.raytracing.targets.mirror_faces import NORMAL_STEP, MirrorFaces
from echoscape.sim.raytracing.targets.mirrors import NEAREST_M, SAME_NORMAL, SAME_PLANE_M, Mirror, Vectors

_MAIN_SHARE = 0.05
"""Share of the turn in which a beam's main lobe passes a target."""
_ZONE_RADII = 1.2
"""Radii b of the Fresnel zone within which a face adds to its share."""


class MirrorSearch:
    """Finds the mirrors of targets in a scene."""

    def __init__(self, faces: MirrorFaces, *, wavelength_m: float, reach_m: float) -> None:
        """Take the faces.

        Args:
            faces: The faces that may be mirrors.
            wavelength_m: Wavelength [m].
            reach_m: Longest leg [m].
        """
        self._faces, self._wavelength_m, self._reach_m = faces, wavelength_m, reach_m
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
        allowed_m = slack_m + leg_m * (2 * NORMAL_STEP) + self._zone_m(leg_m, height_a + height_t)
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
        return _ZONE_RADII * radius_m * leg_m / np.maximum(np.abs(height_m), NEAREST_M)

    def _reflects(
        self, face: NDArray[np.int64], target: Vectors, antenna: Vectors, *, slack_m: float
    ) -> NDArray[np.bool_]:
        """Return whether the Fresnel zones of legs from antennas (N, 3) reach faces (N,)."""
        corners, normal = self._faces.corners[face], self._faces.normal[face]
        offset_m = np.einsum("fk,fk->f", normal, corners[:, 0])
        height_t = normal @ target - offset_m
        height_a = np.einsum("fk,fk->f", normal, antenna) - offset_m
        front = (height_t * height_a > 0) & (np.minimum(np.abs(height_t), np.abs(height_a)) > NEAREST_M)
        height_m = np.where(front, height_a + height_t, 1.0)
        image = target - 2 * height_t[:, None] * normal
        point = antenna + (height_a / height_m)[:, None] * (image - antenna)
        allowed_m = slack_m + self._zone_m(np.linalg.norm(image - antenna, axis=1), height_m)
        edges = np.roll(corners, -1, axis=1) - corners
        inside_m = np.einsum("fek,fek->fe", point[:, None] - corners, np.cross(normal[:, None], edges))
        inside_m /= np.linalg.norm(edges, axis=2)
        return front & (inside_m.min(axis=1, initial=np.inf) >= -allowed_m)


def _same(mirror: Mirror, other: Mirror, corner: NDArray[np.float64]) -> bool:
    """Whether two mirrors, the second with this corner (3,) [m], are one."""
    return (
        mirror.material == other.material
        and abs(float(mirror.normal @ other.normal)) > SAME_NORMAL
        and abs(float(corner @ mirror.normal) - mirror.offset_m) < SAME_PLANE_M
    )
