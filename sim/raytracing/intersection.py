"""Where rays meet the scene: static surfaces, placed objects, and moving objects at the time of each azimuth.

The ray tracer finds the face that a ray meets. Point, distance and normal are then computed from the plane of
that face in double precision, so that phases (4 pi r / lambda) are good to a fraction of a wavelength at any
range. Faces that stand for a curved surface have a normal that varies over them, so that a round body has the
cross-section of its curvature and no glint of a facet.
"""

from dataclasses import dataclass

import numpy as np

from echoscape.sim.kinematics.rolling_scan import MoverStates
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.raytracing.mitsuba_scene import MitsubaScene
from echoscape.sim.raytracing.surface.speckle import hash32

_FAR_M = 1e30
_NO_MOVER = 0xFFFFFFFF
_LEAST_EXIT = 1e-3
"""A ray reflected at a curved face leaves the plane of the face with this cosine to its normal or more."""


@dataclass
class Hits:
    """What N rays met, as Dr.Jit arrays.

    Attributes:
        active: Whether anything was met.
        distance: Distance along the ray from its origin, double [m].
        point: Where the surface was met, double [m].
        normal: Unit normal on the side of the ray, double: interpolated over faces that stand for a curved
            surface.
        curvature: Elements xx, yy, zz of C = M M^T, M the derivative of the normal by place [1/m^2].
        twist: Elements xy, xz, yz of C [1/m^2].
        material: Material id.
        instance: Instance id.
        local: The point in the frame of the object, double [m].
        cosine: Cosine of the angle that rotates this frame into the world, double.
        sine: Sine of the same angle, double.
        owner: Tells apart the speckle lattices of moving objects; 0 for all that is at rest.
        velocity: Velocity of the surface at the point [m/s].
        width: Width of a slender metal facet, at which rays are aimed; 0 for all others [m].
    """

    active: "mi.Bool"
    distance: "mi.Float64"
    point: "mi.Point3d"
    normal: "mi.Vector3d"
    curvature: "mi.Vector3f"
    twist: "mi.Vector3f"
    material: "mi.UInt32"
    instance: "mi.UInt32"
    local: "mi.Point3d"
    cosine: "mi.Float64"
    sine: "mi.Float64"
    owner: "mi.UInt32"
    velocity: "mi.Vector3f"
    width: "mi.Float"


class RayScene:
    """A scene with its moving objects at the azimuths of one scan, for rays to be intersected with."""

    def __init__(self, scene: MitsubaScene, movers: MoverStates, azimuths: int) -> None:
        """Copy the states of the moving objects into Dr.Jit arrays.

        Args:
            scene: The scene in the ray tracer.
            movers: The moving objects in reach, at each azimuth.
            azimuths: Number of azimuths.
        """
        self._scene = scene
        self._azimuths = azimuths
        self._count = dr.opaque(mi.UInt32, len(movers.movers))
        # One object of zeros where there is none, so that gathers have a source.
        blank = np.zeros((1, azimuths, 4))
        state = movers.state if len(movers.movers) else blank
        rate = movers.rate if len(movers.movers) else blank
        self._position = mi.Float64(np.ascontiguousarray(state[..., :3]).ravel())
        self._cos = mi.Float64(np.cos(state[..., 3]).ravel())
        self._sin = mi.Float64(np.sin(state[..., 3]).ravel())
        self._velocity = mi.Float(rate[..., :3].astype(np.float32).ravel())
        self._yaw_rate = mi.Float(rate[..., 3].astype(np.float32).ravel())
        extents = np.array([mover.prototype.extent_m for mover in movers.movers] or [(0.0, 0.0, 0.0)])
        self._radius = mi.Float((np.linalg.norm(extents, axis=1) / 2 + 0.05).astype(np.float32))
        self._half_height = mi.Float((extents[:, 2] / 2).astype(np.float32))
        offsets = [scene.mover_shape_offset[mover.prototype.name] for mover in movers.movers] or [np.zeros(3)]
        self._shape_offset = mi.Float64(np.array(offsets).ravel())
        self._instance = mi.UInt32(np.array([mover.instance for mover in movers.movers] or [0], np.uint32))

    def intersect(
        self,
        origin: "mi.Point3d",
        direction: "mi.Vector3d",
        azimuth: "mi.UInt32",
        reach: "mi.Float",
        active: "mi.Bool",
    ) -> Hits:
        """Return the first surface that each ray meets.

        Args:
            origin: Origins (N) [m].
            direction: Unit directions (N).
            azimuth: Number of the azimuth at whose time each ray is sent (N).
            reach: Largest distances (N) [m].
            active: Which rays to trace (N).

        Returns:
            What the rays met within `reach`.
        """
        scene = self._scene
        ray = mi.Ray3f(mi.Point3f(origin), mi.Vector3f(direction), reach, 0.0, [])
        met = scene.static.ray_intersect_preliminary(ray, False, active)
        valid = active & met.is_valid()
        limit = dr.select(valid, met.t, reach)
        _, mover, mover_face = self._nearest_mover(origin, direction, azimuth, limit, active)
        moving = active & (mover != mi.UInt32(_NO_MOVER))
        valid |= moving
        placed = dr.reinterpret_array(mi.UInt32, met.instance)
        shape = dr.reinterpret_array(mi.UInt32, met.shape)
        still = valid & ~moving
        placement = dr.gather(mi.UInt32, scene.placement, placed, still)
        face = met.prim_index + dr.select(
            placement > 0,
            dr.gather(mi.UInt32, scene.placement_face, placement, still),
            dr.gather(mi.UInt32, scene.shape_face, dr.select(placement > 0, 0, shape), still),
        )
        face = dr.select(moving, mover_face + scene.mover_shape_face, face)
        return self._on_face(origin, direction, azimuth, face, placement, mover, moving, valid)

    def occluded(
        self,
        origin: "mi.Point3d",
        direction: "mi.Vector3d",
        azimuth: "mi.UInt32",
        reach: "mi.Float",
        active: "mi.Bool",
    ) -> "mi.Bool":
        """Return whether a surface lies on each ray.

        Args:
            origin: Origins (N) [m].
            direction: Unit directions (N).
            azimuth: Number of the azimuth at whose time each ray is sent (N).
            reach: Lengths of the rays (N) [m].
            active: Which rays to trace (N).

        Returns:
            Whether anything was met within `reach` (N).
        """
        ray = mi.Ray3f(mi.Point3f(origin), mi.Vector3f(direction), reach, 0.0, [])
        static = self._scene.static.ray_test(ray, False, active)
        _, mover, _ = self._nearest_mover(origin, direction, azimuth, reach, active & ~static)
        return static | (mover != mi.UInt32(_NO_MOVER))

    def _mover_frame(
        self, mover: "mi.UInt32", azimuth: "mi.UInt32", active: "mi.Bool"
    ) -> "tuple[mi.Vector3d, mi.Float64, mi.Float64]":
        """Return position, cosine and sine of the frame of a moving object at an azimuth."""
        index = mover * self._azimuths + azimuth
        position = dr.gather(mi.Vector3d, self._position, index, active)
        return (
            position,
            dr.gather(mi.Float64, self._cos, index, active),
            dr.gather(mi.Float64, self._sin, index, active),
        )

    def mover_points(
        self, point: "mi.Vector3d", mover: "mi.UInt32", azimuth: "mi.UInt32"
    ) -> "tuple[mi.Point3d, mi.Float64, mi.Float64]":
        """Return points of moving objects in the world at given azimuths.

        Args:
            point: Points in the frames of the objects (N) [m].
            mover: Numbers of the moving objects in reach (N).
            azimuth: Azimuths (N).

        Returns:
            The points (N) [m], cosine and sine of the angle that rotates each frame into the world (N).
        """
        active = dr.full(mi.Bool, True, dr.width(azimuth))
        position, cosine, sine = self._mover_frame(mover, azimuth, active)
        return mi.Point3d(position + rotated_about_z(point, cosine, sine)), cosine, sine

    def _nearest_mover(
        self,
        origin: "mi.Point3d",
        direction: "mi.Vector3d",
        azimuth: "mi.UInt32",
        limit: "mi.Float",
        active: "mi.Bool",
    ) -> "tuple[mi.Float, mi.UInt32, mi.UInt32]":
        """Return distance, number and face of the nearest moving object nearer than `limit`."""
        shapes, offsets = self._scene.mover_shapes, self._shape_offset

        def body(mover, best, who, face):
            position, cosine, sine = self._mover_frame(mover, azimuth, active)
            lift = mi.Float64(dr.gather(mi.Float, self._half_height, mover, active))
            radius = dr.gather(mi.Float, self._radius, mover, active)
            away = mi.Vector3f(position + mi.Vector3d(0, 0, lift) - origin)
            along = dr.dot(away, mi.Vector3f(direction))
            aside = dr.squared_norm(away) - along * along
            near = active & (aside <= radius * radius) & (along >= -radius) & (along - radius <= best)

            def inside(best, who, face):
                # Only within the sphere about the object: other shapes stand before and behind it.
                begin = dr.maximum(along - radius, 0)
                offset = dr.gather(mi.Vector3d, offsets, mover, near)
                start = origin + direction * mi.Float64(begin) - position
                start = rotated_about_z(start, cosine, -sine) + offset
                local_direction = mi.Vector3f(rotated_about_z(direction, cosine, -sine))
                length = dr.minimum(best, along + radius) - begin
                ray = mi.Ray3f(mi.Point3f(start), local_direction, length, 0.0, [])
                met = shapes.ray_intersect_preliminary(ray, False, near)
                distance = met.t + begin
                nearer = near & met.is_valid() & (distance < best)
                return (
                    dr.select(nearer, distance, best),
                    dr.select(nearer, mover, who),
                    dr.select(nearer, met.prim_index, face),
                )

            best, who, face = dr.if_stmt(
                (best, who, face), near, inside, lambda best, who, face: (best, who, face)
            )
            return mover + 1, best, who, face

        _, best, who, face = dr.while_loop(
            state=(mi.UInt32(0), mi.Float(limit), mi.UInt32(_NO_MOVER), mi.UInt32(0)),
            cond=lambda mover, best, who, face: active & (mover < self._count),
            body=body,
            label="movers",
        )
        return best, who, face

    def _on_face(
        self,
        origin: "mi.Point3d",
        direction: "mi.Vector3d",
        azimuth: "mi.UInt32",
        face: "mi.UInt32",
        placement: "mi.UInt32",
        mover: "mi.UInt32",
        moving: "mi.Bool",
        valid: "mi.Bool",
    ) -> Hits:
        """Compute the point from the plane of the face that was met, and the normal there."""
        scene = self._scene
        position, cosine, sine = self._mover_frame(mover, azimuth, moving)
        placed = valid & ~moving
        position = dr.select(
            moving, position, dr.gather(mi.Vector3d, scene.placement_position, placement, placed)
        )
        cosine = dr.select(moving, cosine, dr.gather(mi.Float64, scene.placement_cos, placement, placed))
        sine = dr.select(moving, sine, dr.gather(mi.Float64, scene.placement_sin, placement, placed))
        scale = dr.select(moving, 1.0, dr.gather(mi.Float64, scene.placement_scale, placement, placed))
        corner = mi.Vector3d(dr.gather(mi.Vector3f, scene.face_corner, face, valid)) * scale
        corner = rotated_about_z(corner, cosine, sine) + position
        normal = mi.Vector3d(dr.gather(mi.Vector3f, scene.face_normal, face, valid))
        normal = rotated_about_z(normal, cosine, sine)
        facing = dr.dot(normal, direction)
        valid &= dr.abs(facing) > 1e-9
        distance = dr.select(valid, dr.dot(normal, corner - origin) / facing, _FAR_M)
        point = origin + direction * distance
        curved = dr.gather(mi.UInt32, scene.face_curved, face, valid)
        across = mi.Vector3f(rotated_about_z(point - corner, cosine, -sine) / scale)
        normal = dr.select(facing > 0, -normal, normal)
        smooth, columns = self._curved(curved, across)
        smooth = rotated_about_z(smooth, cosine, sine)
        smooth = _tilted_to_the_ray(dr.select(facing > 0, -smooth, smooth), normal, direction)
        turn = mi.Float(cosine / scale), mi.Float(sine / scale), mi.Float(1 / scale)
        columns = [_turned(each, *turn) for each in columns]
        local = dr.select(moving, rotated_about_z(point - position, cosine, -sine), point)
        instance = dr.gather(mi.UInt32, scene.face_instance, face, valid)
        instance = dr.select(
            placement > 0, dr.gather(mi.UInt32, scene.placement_instance, placement, placed), instance
        )
        instance = dr.select(moving, dr.gather(mi.UInt32, self._instance, mover, moving), instance)
        return Hits(
            active=valid,
            distance=distance,
            point=point,
            normal=dr.select(curved > 0, smooth, normal),
            curvature=dr.select(curved > 0, mi.Vector3f(sum(each * each for each in columns)), 0),
            twist=dr.select(curved > 0, mi.Vector3f(sum(_mixed(each) for each in columns)), 0),
            material=dr.gather(mi.UInt32, scene.face_material, face, valid),
            instance=dr.select(valid, instance, 0),
            local=mi.Point3d(local),
            cosine=dr.select(moving, cosine, 1.0),
            sine=dr.select(moving, sine, 0.0),
            owner=dr.select(moving, hash32(instance), 0),
            velocity=self._velocity_at(mi.Vector3f(point - position), mover, azimuth, moving),
            width=dr.gather(mi.Float, scene.face_width, face, valid) * mi.Float(scale),
        )

    def _curved(self, curved: "mi.UInt32", across: "mi.Vector3f") -> "tuple[mi.Vector3d, list[mi.Vector3f]]":
        """Return the normals of curved faces (rows from 1) at `across` [m] from their corners, object frame.

        And the columns of their derivatives by place [1/m].
        """
        rows = [dr.gather(mi.Vector4f, self._scene.bend, curved * 3 + k, curved > 0) for k in range(3)]
        first, *slopes = (mi.Vector3f(*(row[k] for row in rows)) for k in range(4))
        normal = first + slopes[0] * across.x + slopes[1] * across.y + slopes[2] * across.z
        length = dr.sqrt(dr.squared_norm(normal))
        return mi.Vector3d(normal / length), [slope / length for slope in slopes]

    def _velocity_at(
        self, arm: "mi.Vector3f", mover: "mi.UInt32", azimuth: "mi.UInt32", moving: "mi.Bool"
    ) -> "mi.Vector3f":
        """Return the velocity of a point at `arm` [m] from the origin of its object: v + w x arm."""
        index = mover * self._azimuths + azimuth
        velocity = dr.gather(mi.Vector3f, self._velocity, index, moving)
        yaw_rate = dr.gather(mi.Float, self._yaw_rate, index, moving)
        return dr.select(moving, velocity + mi.Vector3f(-yaw_rate * arm.y, yaw_rate * arm.x, 0), 0)


def _tilted_to_the_ray(smooth: "mi.Vector3d", flat: "mi.Vector3d", direction: "mi.Vector3d") -> "mi.Vector3d":
    """Tilt interpolated normals towards those of their faces where a ray would be reflected into the face.

    Where a coarse facet is seen at grazing incidence the curved surface may face away from the ray. The
    normal is then that which reflects the ray along the face.
    """
    reflected = direction - 2 * dr.dot(direction, smooth) * smooth
    leaving = dr.dot(reflected, flat)
    lifted = _unit(reflected + (_LEAST_EXIT - leaving) * flat)
    return dr.select(leaving < _LEAST_EXIT, _unit(lifted - direction), smooth)


def _turned(vector: "mi.Vector3f", cosine: "mi.Float", sine: "mi.Float", scale: "mi.Float") -> "mi.Vector3f":
    """Return vectors turned about the vertical axis and scaled, by scaled cosines and sines."""
    return mi.Vector3f(
        cosine * vector.x - sine * vector.y, sine * vector.x + cosine * vector.y, scale * vector.z
    )


def _mixed(vector: "mi.Vector3f") -> "mi.Vector3f":
    """Return the products xy, xz, yz of the parts of vectors."""
    return mi.Vector3f(vector.x * vector.y, vector.x * vector.z, vector.y * vector.z)


def _unit(vector: "mi.Vector3d") -> "mi.Vector3d":
    """Return unit vectors, by exact root and division: reciprocal estimates differ between processors."""
    return vector / dr.sqrt(dr.squared_norm(vector))


def rotated_about_z(vector: "mi.Vector3d", cosine: "mi.Float64", sine: "mi.Float64") -> "mi.Vector3d":
    """Rotate vectors about the vertical axis.

    Args:
        vector: Vectors (N).
        cosine: Cosines of the angles (N).
        sine: Sines of the angles (N).

    Returns:
        The rotated vectors (N).
    """
    return mi.Vector3d(
        cosine * vector.x - sine * vector.y, sine * vector.x + cosine * vector.y, mi.Float64(vector.z)
    )
