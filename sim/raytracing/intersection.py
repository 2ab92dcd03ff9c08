"""Where rays meet the world: the town, its placed objects, and movers at the time of each ray's row.

The ray tracer says which face a ray meets; place, distance and normal are then computed from that face's
plane in double precision, so that phases (4 pi r / lambda) are good to a fraction of a wavelength anywhere.
"""

from dataclasses import dataclass

import numpy as np

from echoscape.sim.kinematics.rolling_scan import MoverStates
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.raytracing.mitsuba_scene import MitsubaScene
from echoscape.sim.raytracing.surface.speckle import hash32

_FAR = 1e30


@dataclass
class Hits:
    """What N rays met, as Dr.Jit arrays.

    active: anything was met; distance [m] along the ray from its origin (double); place [m] (double);
    normal: unit, towards the ray's side (double); material, instance: ids; local: place in the frame of what
    was hit (double), turned into the world by the angle of `cosine` and `sine`; owner: tells its speckle
    lattice apart, 0 for all that stands still; velocity [m/s].
    """

    active: "mi.Bool"
    distance: "mi.Float64"
    place: "mi.Point3d"
    normal: "mi.Vector3d"
    material: "mi.UInt32"
    instance: "mi.UInt32"
    local: "mi.Point3d"
    cosine: "mi.Float64"
    sine: "mi.Float64"
    owner: "mi.UInt32"
    velocity: "mi.Vector3f"


class RayScene:
    """A town scene with its movers at the rows of one scan; answers rays."""

    def __init__(self, scene: MitsubaScene, states: MoverStates, azimuths: int) -> None:
        self._scene = scene
        self._azimuths = azimuths
        self._count = dr.opaque(mi.UInt32, len(states.movers))
        # One row of zeros where there is no mover, so that gathers have a source.
        blank = np.zeros((1, azimuths, 4))
        state = states.state if len(states.movers) else blank
        rate = states.rate if len(states.movers) else blank
        self._position = mi.Float64(np.ascontiguousarray(state[..., :3]).ravel())
        self._cos = mi.Float64(np.cos(state[..., 3]).ravel())
        self._sin = mi.Float64(np.sin(state[..., 3]).ravel())
        self._velocity = mi.Float(rate[..., :3].astype(np.float32).ravel())
        self._yaw_rate = mi.Float(rate[..., 3].astype(np.float32).ravel())
        extents = np.array([mover.prototype.extent_m for mover in states.movers] or [(0.0, 0.0, 0.0)])
        self._radius = mi.Float((np.linalg.norm(extents, axis=1) / 2 + 0.05).astype(np.float32))
        self._half_height = mi.Float((extents[:, 2] / 2).astype(np.float32))
        places = [scene.garage_place[mover.prototype.name] for mover in states.movers] or [np.zeros(3)]
        self._garage = mi.Float64(np.array(places).ravel())
        self._instance = mi.UInt32(np.array([mover.instance for mover in states.movers] or [0], np.uint32))

    def _mover_frame(
        self, mover: "mi.UInt32", row: "mi.UInt32", active: "mi.Bool"
    ) -> "tuple[mi.Vector3d, mi.Float64, mi.Float64]":
        """Return position, cosine and sine of a mover's frame at a row."""
        index = mover * self._azimuths + row
        position = dr.gather(mi.Vector3d, self._position, index, active)
        return (
            position,
            dr.gather(mi.Float64, self._cos, index, active),
            dr.gather(mi.Float64, self._sin, index, active),
        )

    def _meet_movers(
        self,
        origin: "mi.Point3d",
        direction: "mi.Vector3d",
        row: "mi.UInt32",
        limit: "mi.Float",
        active: "mi.Bool",
    ) -> "tuple[mi.Float, mi.UInt32, mi.UInt32]":
        """Return distance, mover and garage face of the nearest mover nearer than `limit`."""
        garage, garage_places = self._scene.garage, self._garage

        def body(mover, best, who, face):
            position, cosine, sine = self._mover_frame(mover, row, active)
            lift = mi.Float64(dr.gather(mi.Float, self._half_height, mover, active))
            radius = dr.gather(mi.Float, self._radius, mover, active)
            away = mi.Vector3f(position + mi.Vector3d(0, 0, lift) - origin)
            along = dr.dot(away, mi.Vector3f(direction))
            aside = dr.squared_norm(away) - along * along
            near = active & (aside <= radius * radius) & (along >= -radius) & (along - radius <= best)

            def inside(best, who, face):
                slot = dr.gather(mi.Vector3d, garage_places, mover, near)
                start = turned(origin - position, cosine, -sine) + slot
                ray = mi.Ray3f(
                    mi.Point3f(start), mi.Vector3f(turned(direction, cosine, -sine)), best, 0.0, []
                )
                met = garage.ray_intersect_preliminary(ray, False, near)
                nearer = near & met.is_valid() & (met.t < best)
                return (
                    dr.select(nearer, met.t, best),
                    dr.select(nearer, mover, who),
                    dr.select(nearer, met.prim_index, face),
                )

            best, who, face = dr.if_stmt(
                (best, who, face), near, inside, lambda best, who, face: (best, who, face)
            )
            return mover + 1, best, who, face

        nobody = mi.UInt32(0xFFFFFFFF)
        _, best, who, face = dr.while_loop(
            state=(mi.UInt32(0), mi.Float(limit), nobody, mi.UInt32(0)),
            cond=lambda mover, best, who, face: active & (mover < self._count),
            body=body,
            label="movers",
        )
        return best, who, face

    def meet(
        self,
        origin: "mi.Point3d",
        direction: "mi.Vector3d",
        row: "mi.UInt32",
        reach: "mi.Float",
        active: "mi.Bool",
    ) -> Hits:
        """Return what rays from `origin` (N) [m] along unit `direction` meet within `reach` [m]."""
        scene = self._scene
        ray = mi.Ray3f(mi.Point3f(origin), mi.Vector3f(direction), reach, 0.0, [])
        met = scene.town.ray_intersect_preliminary(ray, False, active)
        valid = active & met.is_valid()
        limit = dr.select(valid, met.t, reach)
        _, mover, garage_face = self._meet_movers(origin, direction, row, limit, active)
        moving = active & (mover != mi.UInt32(0xFFFFFFFF))
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
        face = dr.select(moving, garage_face + scene.garage_face, face)
        return self._on_face(origin, direction, row, face, placement, mover, moving, valid)

    def _on_face(
        self,
        origin: "mi.Point3d",
        direction: "mi.Vector3d",
        row: "mi.UInt32",
        face: "mi.UInt32",
        placement: "mi.UInt32",
        mover: "mi.UInt32",
        moving: "mi.Bool",
        valid: "mi.Bool",
    ) -> Hits:
        """Compute place and normal from the plane of the face that was met."""
        scene = self._scene
        position, cosine, sine = self._mover_frame(mover, row, moving)
        placed = valid & ~moving
        position = dr.select(
            moving, position, dr.gather(mi.Vector3d, scene.placement_position, placement, placed)
        )
        cosine = dr.select(moving, cosine, dr.gather(mi.Float64, scene.placement_cos, placement, placed))
        sine = dr.select(moving, sine, dr.gather(mi.Float64, scene.placement_sin, placement, placed))
        scale = dr.select(moving, 1.0, dr.gather(mi.Float64, scene.placement_scale, placement, placed))
        corner = mi.Vector3d(dr.gather(mi.Vector3f, scene.face_corner, face, valid)) * scale
        normal = mi.Vector3d(dr.gather(mi.Vector3f, scene.face_normal, face, valid))
        normal = turned(normal, cosine, sine)
        corner = turned(corner, cosine, sine) + position
        facing = dr.dot(normal, direction)
        valid &= dr.abs(facing) > 1e-9
        distance = dr.select(valid, dr.dot(normal, corner - origin) / facing, _FAR)
        place = origin + direction * distance
        local = dr.select(moving, turned(place - position, cosine, -sine), place)
        instance = dr.gather(mi.UInt32, scene.face_instance, face, valid)
        instance = dr.select(
            placement > 0, dr.gather(mi.UInt32, scene.placement_instance, placement, placed), instance
        )
        instance = dr.select(moving, dr.gather(mi.UInt32, self._instance, mover, moving), instance)
        return Hits(
            active=valid,
            distance=distance,
            place=place,
            normal=dr.select(facing > 0, -normal, normal),
            material=dr.gather(mi.UInt32, scene.face_material, face, valid),
            instance=dr.select(valid, instance, 0),
            local=mi.Point3d(local),
            cosine=dr.select(moving, cosine, 1.0),
            sine=dr.select(moving, sine, 0.0),
            owner=dr.select(moving, hash32(instance), 0),
            velocity=self._velocity_at(mi.Vector3f(place - position), mover, row, moving),
        )

    def _velocity_at(
        self, arm: "mi.Vector3f", mover: "mi.UInt32", row: "mi.UInt32", moving: "mi.Bool"
    ) -> "mi.Vector3f":
        """Return the velocity of a point `arm` [m] away from its mover's origin: v + w x arm."""
        index = mover * self._azimuths + row
        velocity = dr.gather(mi.Vector3f, self._velocity, index, moving)
        turn = dr.gather(mi.Float, self._yaw_rate, index, moving)
        return dr.select(moving, velocity + mi.Vector3f(-turn * arm.y, turn * arm.x, 0), 0)

    def blocked(
        self,
        origin: "mi.Point3d",
        direction: "mi.Vector3d",
        row: "mi.UInt32",
        reach: "mi.Float",
        active: "mi.Bool",
    ) -> "mi.Bool":
        """Return whether anything stands within `reach` [m] along a ray."""
        ray = mi.Ray3f(mi.Point3f(origin), mi.Vector3f(direction), reach, 0.0, [])
        town = self._scene.town.ray_test(ray, False, active)
        _, mover, _ = self._meet_movers(origin, direction, row, reach, active & ~town)
        return town | (mover != mi.UInt32(0xFFFFFFFF))


def turned(vector: "mi.Vector3d", cosine: "mi.Float64", sine: "mi.Float64") -> "mi.Vector3d":
    """Return a vector turned about z by the angle of the given cosine and sine."""
    return mi.Vector3d(
        cosine * vector.x - sine * vector.y, sine * vector.x + cosine * vector.y, mi.Float64(vector.z)
    )
