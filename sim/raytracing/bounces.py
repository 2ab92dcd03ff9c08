"""Bounces: the power that returns from each surface that rays meet, and the rays reflected onwards.

Each ray carries a share of the transmitted power, so the power of its return falls with 1/R^2; the spreading
on the outward path shows in the number of rays that meet a distant object. With BRDF f, gain G and density p
of rays [1/sr]:

    P = Pt lambda^2 / (4 pi)^2  G(out) G(back) |Gamma_1|^2 ... |Gamma_k|^2  f cos / R_back^2  / p

R_back is the unfolded length of the return path (radar equation for distributed targets; Ulaby & Long 2014).
"""

import math
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from echoscape.sim.raytracing.intersection import Hits
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.raytracing.surface.curvature import SlopeSpread, slope_spread
from echoscape.sim.raytracing.surface.scattering import Surfaces
from echoscape.sim.raytracing.surface.speckle import hash32

_SKIN_M = 1e-3
"""Reflected rays start this far above the surface [m]."""


@dataclass
class RayBatch:
    """N rays, as Dr.Jit arrays.

    Attributes:
        origin: Origins, double [m].
        direction: Unit directions, double.
        travelled: Unfolded length so far, double [m].
        weight: Product of the mirror power reflectivities so far.
        azimuth: Number of the azimuth that the ray was sent for.
        number: Number of the ray in its scan.
        density: Rays per solid angle [1/sr].
        gain: One-way elevation gain towards the first leg.
        drift: Rate of change of the path length by moving surfaces so far [m/s].
        moved: Whether a surface so far moves.
        start: Origin of the first leg, double [m].
        heading: Direction of the first leg, double.
        only_targets: Whether all surfaces so far were coherent targets.
        chain: Hash of the objects that reflected the ray so far.
        planes: Hash of the planes in which it was reflected.
        slopes: Sum of the variances of the slopes of the mirrors so far [rad^2].
        unfold_x: Image of the world's x axis behind the mirrors so far; likewise `unfold_y`, `unfold_z`.
    """

    origin: "mi.Point3d"
    direction: "mi.Vector3d"
    travelled: "mi.Float64"
    weight: "mi.Float"
    azimuth: "mi.UInt32"
    number: "mi.UInt32"
    density: "mi.Float"
    gain: "mi.Float"
    drift: "mi.Float"
    moved: "mi.Bool"
    start: "mi.Point3d"
    heading: "mi.Vector3d"
    only_targets: "mi.Bool"
    chain: "mi.UInt32"
    planes: "mi.UInt32"
    slopes: "mi.Float"
    unfold_x: "mi.Vector3f"
    unfold_y: "mi.Vector3f"
    unfold_z: "mi.Vector3f"

    def unfolded(self, vector: "mi.Vector3f") -> "mi.Vector3d":
        """Return the images of vectors behind the mirrors that the rays met.

        Args:
            vector: Vectors at the ends of the rays (N) [m].

        Returns:
            What they are seen as along the first leg (N) [m].
        """
        return mi.Vector3d(self.unfold_x * vector.x + self.unfold_y * vector.y + self.unfold_z * vector.z)


@dataclass
class RayReturns:
    """What N rays return, as Dr.Jit arrays.

    Attributes:
        out: Image of the reflecting point along the first leg, unfolded, double [m].
        back: Its image along the last leg, double [m]; the same array where both legs coincide.
        power: Mean received power before the azimuth gain [W].
        drift: Rate of change of half the path length by moving surfaces [m/s].
        bounces: Surfaces met out and back.
    """

    out: "mi.Point3d"
    back: "mi.Point3d"
    power: "mi.Float"
    drift: "mi.Float"
    bounces: int


@dataclass
class ReturnPaths:
    """N paths that return to the antenna, one per patch of surface, as Dr.Jit arrays.

    Attributes:
        out: Mean image of the reflecting points along the first leg, unfolded, double [m].
        back: Its image along the last leg, double [m]; the same array where both legs coincide.
        beyond: Half the path length by way of the scatterer, less that by way of `out` and `back` [m].
        power: Mean received power before the azimuth gain [W].
        real: Real part of the scatterer's unit-power circular Gaussian.
        imag: Imaginary part.
        drift: Rate of change of half the path length by moving surfaces [m/s].
        azimuth: Number of the azimuth that the ray was sent for.
        number: Number of the ray in its scan.
        material: Material id of the last surface.
        instance: Instance id of the last surface.
        moving: Whether a surface on the path moves.
        bounces: Surfaces met out and back.
    """

    out: "mi.Point3d"
    back: "mi.Point3d"
    beyond: "mi.Float"
    power: "mi.Float"
    real: "mi.Float"
    imag: "mi.Float"
    drift: "mi.Float"
    azimuth: "mi.UInt32"
    number: "mi.UInt32"
    material: "mi.UInt32"
    instance: "mi.UInt32"
    moving: "mi.Bool"
    bounces: int


_Bundle = TypeVar("_Bundle")
_Vector = TypeVar("_Vector", "mi.Vector3f", "mi.Vector3d")


def picked(arrays: _Bundle, index: "mi.UInt32") -> _Bundle:
    """Return some entries of a batch of rays, paths or hits.

    Fields that are one array stay one array, and constants stay constants. Call `dr.eval` on the batch first:
    each array that is not evaluated yet would cost another kernel. Fields of the result that nothing asks for
    cost nothing.

    Args:
        arrays: Dataclass of evaluated Dr.Jit arrays (N).
        index: Entries to take (K).

    Returns:
        The same dataclass with arrays (K).
    """
    taken: dict[int, Any] = {}
    for value in vars(arrays).values():
        if id(value) not in taken:
            taken[id(value)] = dr.gather(type(value), value, index) if dr.is_array_v(value) else value
    return type(arrays)(**{name: taken[id(value)] for name, value in vars(arrays).items()})


def joined(first: _Bundle, second: _Bundle) -> _Bundle:
    """Return two batches of rays, paths or hits as one; fields that are one array stay one array.

    Args:
        first: Dataclass of evaluated Dr.Jit arrays (N).
        second: The same (M).

    Returns:
        The same dataclass with arrays (N + M).
    """
    taken: dict[int, Any] = {}
    for name, value in vars(first).items():
        if id(value) not in taken:
            both = dr.is_array_v(value)
            taken[id(value)] = _concatenated(value, getattr(second, name)) if both else value
    return type(first)(**{name: taken[id(value)] for name, value in vars(first).items()})


def _concatenated(first: Any, second: Any) -> Any:
    """Return two Dr.Jit arrays, or arrays of vectors, as one; a constant of both stays a constant."""
    if dr.depth_v(first) > 1:
        return type(first)(*(_concatenated(first[k], second[k]) for k in range(len(first))))
    constant = first.state == second.state == dr.VarState.Literal
    if constant and first[0] == second[0]:
        return dr.full(type(first), first[0], len(first) + len(second))
    return dr.concat((first, second))


def primary_batch(
    *,
    origin: "mi.Point3d",
    direction: "mi.Vector3d",
    azimuth: "mi.UInt32",
    number: "mi.UInt32",
    density: "mi.Float",
    gain: "mi.Float",
) -> RayBatch:
    """Return rays on their first leg.

    Args:
        origin: Positions of the antenna (N) [m].
        direction: Unit directions (N).
        azimuth: Azimuth that each ray is sent for (N).
        number: Number of each ray in its scan (N).
        density: Rays per solid angle (N) [1/sr].
        gain: One-way elevation gains (N).

    Returns:
        The rays (N).
    """
    count = dr.width(azimuth)
    one, zero = dr.full(mi.Float, 1, count), dr.zeros(mi.Float, count)
    return RayBatch(
        origin=origin,
        direction=direction,
        travelled=dr.zeros(mi.Float64, count),
        weight=one,
        azimuth=azimuth,
        number=number,
        density=density,
        gain=gain,
        drift=zero,
        moved=dr.zeros(mi.Bool, count),
        start=origin,
        heading=direction,
        only_targets=dr.full(mi.Bool, True, count),
        chain=dr.zeros(mi.UInt32, count),
        planes=dr.zeros(mi.UInt32, count),
        slopes=dr.zeros(mi.Float, count),
        unfold_x=mi.Vector3f(one, zero, zero),
        unfold_y=mi.Vector3f(zero, one, zero),
        unfold_z=mi.Vector3f(zero, zero, one),
    )


def _unit(vector: "_Vector") -> "_Vector":
    """Return unit vectors, by exact root and division: reciprocal estimates differ between processors."""
    return vector / dr.sqrt(dr.squared_norm(vector))


def _plane_key(hits: Hits) -> "mi.UInt32":
    """Return a hash of the planes that were hit, by steps of normal and distance from the origin."""
    normal = hits.normal
    key = dr.zeros(mi.UInt32, dr.width(hits.instance))
    for value, step in (
        (normal.x, 0.13),
        (normal.y, 0.13),
        (normal.z, 0.13),
        (dr.dot(normal, hits.point), 0.03),
    ):
        cell = mi.Int32(dr.floor(value * (1 / step) + 0.37))
        key = hash32(key ^ dr.reinterpret_array(mi.UInt32, cell))
    return key


def _te_share(direction: "mi.Vector3f", normal: "mi.Vector3f") -> "mi.Float":
    """Return the share of the power of a vertically polarised wave that is TE at a surface."""
    across = dr.cross(direction, normal)
    up = mi.Vector3f(0, 0, 1) - direction * direction.z
    scale = dr.squared_norm(across) * dr.squared_norm(up)
    share = dr.square(dr.dot(across, up)) / dr.maximum(scale, 1e-12)
    return dr.select(scale > 1e-8, dr.clip(share, 0, 1), 0.5)


def _slope_spread(hits: Hits, half: "mi.Vector3f", density: "mi.Float", length_m: "mi.Float") -> SlopeSpread:
    """Return the slopes of the surfaces within the footprints of rays of a density [1/sr] at a distance."""
    return slope_spread(
        hits.curvature, hits.twist, mi.Vector3f(hits.normal), half, dr.square(length_m) / density
    )


class BounceSampler:
    """Turns hits into return paths and reflected rays, by the scattering of the materials."""

    def __init__(
        self,
        *,
        surfaces: Surfaces,
        link: float,
        elevation_gain: np.ndarray,
    ) -> None:
        """Load the tables.

        Args:
            surfaces: Scattering of the materials.
            link: Pt lambda^2 G0^2 / ((4 pi)^2 L) [W m^2].
            elevation_gain: One-way elevation gain at even steps of the angle from -pi/2 to pi/2.
        """
        self._surfaces = surfaces
        self._link = link
        self._elevation = mi.Float(elevation_gain.astype(np.float32))
        self._steps = len(elevation_gain) - 1

    def _gain_towards(self, direction: "mi.Vector3f", axis: "mi.Vector3f", active: "mi.Bool") -> "mi.Float":
        """Return the one-way elevation gain of unit directions, looked up in even steps of the angle."""
        step = (dr.asin(dr.clip(dr.dot(direction, axis), -1, 1)) / math.pi + 0.5) * self._steps
        return dr.gather(mi.Float, self._elevation, dr.minimum(mi.UInt32(step + 0.5), self._steps), active)

    def _reflected(self, rays: RayBatch, hits: Hits) -> "tuple[mi.Float, mi.Float, mi.Float]":
        """Return cosine of incidence, reflected power |Gamma|^2 and its mirror share."""
        direction, normal = mi.Vector3f(rays.direction), mi.Vector3f(hits.normal)
        cosine = dr.clip(-dr.dot(direction, normal), 0, 1)
        power = self._surfaces.reflected_power(
            hits.material, cosine, _te_share(direction, normal), hits.active
        )
        return cosine, power, self._surfaces.mirror_share(hits.material, cosine, hits.active)

    def same_path_returns(self, rays: RayBatch, hits: Hits, *, depth: int) -> RayReturns:
        """Return the power that returns along their outward path: direct at depth 1, mirror ghosts beyond.

        Args:
            rays: Rays (N) that met something.
            hits: What they met (N).
            depth: Number of surfaces on the outward path.

        Returns:
            Returns (N) of bounce order 2 depth - 1.
        """
        cosine, power, share = self._reflected(rays, hits)
        length = rays.travelled + hits.distance
        spread = _slope_spread(hits, -mi.Vector3f(rays.direction), rays.density, mi.Float(length))
        # A mirror that is tilted by d turns the ray by 2 d, out and back alike.
        tilt = 4 * rays.slopes
        lobe = self._surfaces.mirror_lobe(hits.material, cosine, cosine, cosine, hits.active, spread, tilt)
        cosines = (cosine, cosine, mi.Float(1))
        brdf = share * lobe + self._surfaces.diffuse_lobe(1 - share, hits.material, cosines, hits.active)
        length32 = mi.Float(length)
        received = self._link * dr.square(rays.gain * rays.weight) * power * brdf * cosine
        received /= dr.square(length32) * rays.density
        point = rays.start + rays.heading * length
        return RayReturns(
            out=point,
            back=point,
            power=dr.select(hits.active & ~rays.only_targets, received, 0),
            drift=rays.drift + dr.dot(hits.velocity, mi.Vector3f(rays.direction)),
            bounces=2 * depth - 1,
        )

    def loop_returns(
        self,
        rays: RayBatch,
        hits: Hits,
        antenna: "mi.Point3d",
        axis: "mi.Vector3f",
        *,
        mirrored: "mi.Bool",
        depth: int,
    ) -> RayReturns:
        """Return the power that comes from the last surface straight back to the antenna.

        The diffuse part of the last surface returns as much around the loop in the other direction, in phase:
        twice the amplitude. The reversed path of its mirror part is another ray.

        Args:
            rays: Rays (N) that met something.
            hits: What they met (N).
            antenna: Position of the antenna for each ray (N) [m].
            axis: Unit vector along the axis of the antenna for each ray (N).
            mirrored: Whether the mirror part of the last surface counts (N).
            depth: Number of surfaces on the outward path.

        Returns:
            Returns (N) of bounce order `depth`; whether the last leg is free is not in them.
        """
        cosine, power, share = self._reflected(rays, hits)
        home = antenna - hits.point
        length = dr.norm(home)
        towards = home / length
        cos_out = mi.Float(dr.dot(hits.normal, towards))
        half = _unit(mi.Vector3f(towards - rays.direction))
        cos_half = dr.dot(half, mi.Vector3f(hits.normal))
        active = hits.active & (cos_out > 1e-3)
        unfolded = rays.travelled + hits.distance
        spread = _slope_spread(hits, half, rays.density, mi.Float(unfolded))
        # A mirror that is tilted by d turns the ray by 2 d, and the half vector by d.
        lobe = self._surfaces.mirror_lobe(
            hits.material, cos_half, cosine, cos_out, active, spread, rays.slopes
        )
        cosines = (cosine, cos_out, mi.Float(-dr.dot(rays.direction, towards)))
        brdf = self._surfaces.diffuse_lobe(4 * (1 - share), hits.material, cosines, active)
        brdf += dr.select(mirrored, share * lobe, 0)
        gains = rays.gain * self._gain_towards(mi.Vector3f(-towards), axis, active)
        received = self._link * gains * rays.weight * power * brdf * cos_out
        received /= dr.square(mi.Float(length)) * rays.density
        away = mi.Vector3f(rays.direction - towards) * 0.5
        return RayReturns(
            out=rays.start + rays.heading * unfolded,
            back=mi.Point3d(hits.point),
            power=dr.select(active & ~rays.only_targets, received, 0),
            drift=rays.drift * 0.5 + dr.dot(hits.velocity, away),
            bounces=depth,
        )

    def mirror_rays(self, rays: RayBatch, hits: Hits) -> RayBatch:
        """Return the rays reflected at the hits as at mirrors.

        Args:
            rays: Rays (N) that met something.
            hits: What they met (N).

        Returns:
            The reflected rays (N), with the weight of what they met.
        """
        _, power, share = self._reflected(rays, hits)
        onward = rays.direction - 2 * dr.dot(rays.direction, hits.normal) * hits.normal
        direction = _unit(onward)
        swept = dr.dot(hits.velocity, mi.Vector3f(rays.direction - direction))
        normal = mi.Vector3f(hits.normal)
        across = 2 * mi.Vector3f(rays.unfolded(normal))
        spread = _slope_spread(hits, normal, rays.density, mi.Float(rays.travelled + hits.distance))
        turned = (spread.variance_u + spread.variance_v) * 0.5
        return RayBatch(
            origin=mi.Point3d(hits.point + hits.normal * _SKIN_M),
            direction=direction,
            travelled=rays.travelled + hits.distance,
            weight=dr.select(hits.active, rays.weight * power * share, 0),
            azimuth=rays.azimuth,
            number=rays.number,
            density=rays.density,
            gain=rays.gain,
            drift=rays.drift + swept,
            moved=rays.moved | (hits.owner != 0),
            start=rays.start,
            heading=rays.heading,
            only_targets=rays.only_targets,
            chain=hash32(rays.chain ^ hits.instance),
            planes=hash32(rays.planes ^ _plane_key(hits)),
            slopes=rays.slopes + self._surfaces.slope_variance(hits.material, hits.active) + turned,
            unfold_x=rays.unfold_x - across * normal.x,
            unfold_y=rays.unfold_y - across * normal.y,
            unfold_z=rays.unfold_z - across * normal.z,
        )
