"""Ray paths: how a bundle of rays goes on from surface to surface and what comes back from each.

Each ray carries a share of the outgoing power, so a return falls with 1/R^2 in a ray and the spreading of
the other way lies in how few rays meet a distant thing. With BRDF f, gain G and density p of rays [1/sr]:

    P = Pt lambda^2 / (4 pi)^2  G(out) G(back) |Gamma_1|^2 ... |Gamma_k|^2  f cos / R_back^2  / p

R_back is the unfolded length of the way back (radar equation for distributed targets; Ulaby & Long 2014).
"""

import math
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from echoscape.sim.raytracing.intersection import Hits, turned
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.raytracing.surface.scattering import Surfaces
from echoscape.sim.raytracing.surface.speckle import (
    PATCH_M,
    patch_key,
    patch_step,
    reflectivity,
    scatterer_offset,
)
from echoscape.sim.raytracing.surface.texture import Texture

_SKIN_M = 1e-3
"""A ray goes on this far above the surface that it left."""


@dataclass
class RayBatch:
    """N rays on their way, as Dr.Jit arrays.

    origin [m], direction (double); travelled: unfolded length so far [m] (double); weight: product of mirror
    power reflectivities; row: home row; number: of the ray in its scan; density [1/sr]; gain: one-way
    elevation gain towards the first leg; start and heading: the first leg's origin and direction;
    only_targets: no surface so far was anything but a coherent target.
    """

    origin: "mi.Point3d"
    direction: "mi.Vector3d"
    travelled: "mi.Float64"
    weight: "mi.Float"
    row: "mi.UInt32"
    number: "mi.UInt32"
    density: "mi.Float"
    gain: "mi.Float"
    drift: "mi.Float"
    moved: "mi.Bool"
    start: "mi.Point3d"
    heading: "mi.Vector3d"
    only_targets: "mi.Bool"


@dataclass
class ReturnPaths:
    """Paths that come back, as Dr.Jit arrays.

    out, back: where the path's two ends seem to lie, unfolded [m] (double); power: mean received power but
    for the azimuth gain [W]; real, imag: unit-mean-power complex Gaussian of the scatterer; drift: rate of
    the half path by the things' own motion [m/s]; row: home row; number: of the ray; material, instance,
    moving: of the last thing met.
    """

    out: "mi.Point3d"
    back: "mi.Point3d"
    power: "mi.Float"
    real: "mi.Float"
    imag: "mi.Float"
    drift: "mi.Float"
    row: "mi.UInt32"
    number: "mi.UInt32"
    material: "mi.UInt32"
    instance: "mi.UInt32"
    moving: "mi.Bool"
    bounces: int


_Bundle = TypeVar("_Bundle", RayBatch, ReturnPaths, Hits)
_Vector = TypeVar("_Vector", "mi.Vector3f", "mi.Vector3d")


def picked(arrays: _Bundle, index: "mi.UInt32") -> _Bundle:
    """Return a dataclass of evaluated Dr.Jit arrays with only the entries at `index`.

    A field that is the same object as another stays so. (Sources that are not evaluated yet would each cost a
    kernel of their own: call `dr.eval` on the dataclass first.)
    """
    taken: dict[int, Any] = {}
    for value in vars(arrays).values():
        if id(value) not in taken:
            taken[id(value)] = dr.gather(type(value), value, index) if dr.is_array_v(value) else value
    return type(arrays)(**{name: taken[id(value)] for name, value in vars(arrays).items()})


def _unit(vector: "_Vector") -> "_Vector":
    """Return vectors of length 1, by exact root and division: reciprocal estimates differ by processor."""
    return vector / dr.sqrt(dr.squared_norm(vector))


def _te_share(direction: "mi.Vector3f", normal: "mi.Vector3f") -> "mi.Float":
    """Return the share of a vertically polarised wave's power that is TE at a surface."""
    across = dr.cross(direction, normal)
    up = mi.Vector3f(0, 0, 1) - direction * direction.z
    scale = dr.squared_norm(across) * dr.squared_norm(up)
    share = dr.square(dr.dot(across, up)) / dr.maximum(scale, 1e-12)
    return dr.select(scale > 1e-8, dr.clip(share, 0, 1), 0.5)


class BounceSampler:
    """Turns hits into returns and into rays that go on; holds what does not change from scan to scan."""

    def __init__(
        self,
        *,
        surfaces: Surfaces,
        link: float,
        elevation_gain: np.ndarray,
        seed: int,
    ) -> None:
        """`link`: Pt lambda^2 G0^2 / ((4 pi)^2 L) [W m^2]; `elevation_gain`: one-way table, even in angle."""
        self._surfaces = surfaces
        self._link = link
        self._elevation = mi.Float(elevation_gain.astype(np.float32))
        self._steps = len(elevation_gain) - 1
        self._seed = dr.opaque(mi.UInt32, seed & 0xFFFFFFFF)
        self._texture = Texture()

    def _gain_towards(self, direction: "mi.Vector3f", active: "mi.Bool") -> "mi.Float":
        """Return the one-way elevation gain of unit directions, looked up in even steps of the angle."""
        place = (dr.asin(dr.clip(direction.z, -1, 1)) / math.pi + 0.5) * self._steps
        return dr.gather(mi.Float, self._elevation, dr.minimum(mi.UInt32(place + 0.5), self._steps), active)

    def _reflected(self, rays: RayBatch, hits: Hits) -> "tuple[mi.Float, mi.Float, mi.Float]":
        """Return cosine of incidence, reflected power |Gamma|^2 and its mirror share."""
        direction, normal = mi.Vector3f(rays.direction), mi.Vector3f(hits.normal)
        cosine = dr.clip(-dr.dot(direction, normal), 0, 1)
        power = self._surfaces.reflected_power(
            hits.material, cosine, _te_share(direction, normal), hits.active
        )
        return cosine, power, self._surfaces.mirror_share(hits.material, cosine, hits.active)

    def _speckled(
        self, rays: RayBatch, hits: Hits, mean_rays: "mi.Float"
    ) -> "tuple[mi.Float64, mi.Float, mi.Float]":
        """Return how much farther along the ray the patch's scatterer lies [m], and its reflectivity.

        Several rays that meet one patch add in phase: k rays where k' are expected give k^2 times the power
        of one, so the reflectivity falls by E[k^2] / k' = k' + variance / k'. Rays are more even than random
        ones: variance / k' is close to 1 / (1 + k' / 2), as a test counts on drawn sets.
        """
        step = patch_step(mean_rays)
        key = patch_key(hits.local, step, hits.owner, self._seed)
        real, imag = reflectivity(key)
        mean_rays *= dr.square(mi.Float(step))
        scale = 1 / dr.sqrt(mean_rays + 1 / (1 + mean_rays / 2))
        scale *= self._texture.amplitude(hits.material, hits.local, hits.owner, self._seed, hits.active)
        offset = turned(scatterer_offset(hits.local, step, key), hits.cosine, hits.sine)
        flat = offset - hits.normal * dr.dot(offset, hits.normal)
        return dr.dot(flat, rays.direction), real * scale, imag * scale

    def same_path(self, rays: RayBatch, hits: Hits, *, depth: int) -> ReturnPaths:
        """Return the power that goes back the way it came: direct at depth 1, mirror ghosts beyond."""
        cosine, power, share = self._reflected(rays, hits)
        lobe = self._surfaces.mirror_lobe(hits.material, cosine, cosine, cosine, hits.active)
        cosines = (cosine, cosine, mi.Float(1))
        brdf = share * lobe + self._surfaces.diffuse_lobe(1 - share, hits.material, cosines, hits.active)
        length = rays.travelled + hits.distance
        length32 = mi.Float(length)
        received = self._link * dr.square(rays.gain * rays.weight) * power * brdf * cosine
        received /= dr.square(length32) * rays.density
        mean_rays = rays.density * (PATCH_M * PATCH_M) * cosine / dr.square(length32)
        farther, real, imag = self._speckled(rays, hits, mean_rays)
        place = rays.start + rays.heading * (length + farther)
        return ReturnPaths(
            out=place,
            back=place,
            power=dr.select(hits.active & ~rays.only_targets, received, 0),
            real=real,
            imag=imag,
            drift=rays.drift + dr.dot(hits.velocity, mi.Vector3f(rays.direction)),
            row=rays.row,
            number=rays.number,
            material=hits.material,
            instance=hits.instance,
            moving=rays.moved | (hits.owner != 0),
            bounces=2 * depth - 1,
        )

    def loop(self, rays: RayBatch, hits: Hits, sensor: "mi.Point3d", *, depth: int) -> ReturnPaths:
        """Return the power that leaves the last surface straight for the radar at `sensor` (N) [m].

        A diffuse last surface sends as much the other way round the loop, in phase: twice the amplitude. The
        other way round of a mirror part is a ray of its own.
        """
        cosine, power, share = self._reflected(rays, hits)
        home = sensor - hits.place
        length = dr.norm(home)
        towards = home / length
        cos_out = mi.Float(dr.dot(hits.normal, towards))
        half = _unit(mi.Vector3f(towards - rays.direction))
        cos_half = dr.dot(half, mi.Vector3f(hits.normal))
        active = hits.active & (cos_out > 1e-3)
        lobe = self._surfaces.mirror_lobe(hits.material, cos_half, cosine, cos_out, active)
        cosines = (cosine, cos_out, mi.Float(-dr.dot(rays.direction, towards)))
        brdf = share * lobe + self._surfaces.diffuse_lobe(4 * (1 - share), hits.material, cosines, active)
        gains = rays.gain * self._gain_towards(mi.Vector3f(-towards), active)
        received = self._link * gains * rays.weight * power * brdf * cos_out
        received /= dr.square(mi.Float(length)) * rays.density
        unfolded = rays.travelled + hits.distance
        mean_rays = rays.density * (PATCH_M * PATCH_M) * cosine / dr.square(mi.Float(unfolded))
        _, real, imag = self._speckled(rays, hits, mean_rays)
        away = mi.Vector3f(rays.direction - towards) * 0.5
        return ReturnPaths(
            out=rays.start + rays.heading * unfolded,
            back=mi.Point3d(hits.place),
            power=dr.select(active & ~rays.only_targets, received, 0),
            real=real,
            imag=imag,
            drift=rays.drift * 0.5 + dr.dot(hits.velocity, away),
            row=rays.row,
            number=rays.number,
            material=hits.material,
            instance=hits.instance,
            moving=rays.moved | (hits.owner != 0),
            bounces=depth,
        )

    def mirrored(self, rays: RayBatch, hits: Hits) -> RayBatch:
        """Return the rays that go on from the hits as from mirrors."""
        _, power, share = self._reflected(rays, hits)
        onward = rays.direction - 2 * dr.dot(rays.direction, hits.normal) * hits.normal
        direction = _unit(onward)
        swept = dr.dot(hits.velocity, mi.Vector3f(rays.direction - direction))
        return RayBatch(
            origin=mi.Point3d(hits.place + hits.normal * _SKIN_M),
            direction=direction,
            travelled=rays.travelled + hits.distance,
            weight=dr.select(hits.active, rays.weight * power * share, 0),
            row=rays.row,
            number=rays.number,
            density=rays.density,
            gain=rays.gain,
            drift=rays.drift + swept,
            moved=rays.moved | (hits.owner != 0),
            start=rays.start,
            heading=rays.heading,
            only_targets=rays.only_targets,
        )
