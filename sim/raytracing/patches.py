"""Patches: the pieces of surface that scatter as one, and the sum of the power that rays found in each.

Rays are samples of the mean power only. What interferes in a resolution cell are its patches, which are fixed
in the world: each is one scatterer with a hashed place and a circular complex Gaussian reflectivity (see
`surface.speckle`), whose power is the sum of what all rays in the patch return. So speckle does not depend on
which rays were drawn, as long as some of them meet each patch. Where a ray stands for more surface than a
patch, on ground and on walls seen along, its power is divided evenly over the patches of its footprint. Up to
each range at which patches become larger, a growing share of the power goes to the larger ones.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.raytracing.bounces import RayBatch, RayReturns, ReturnPaths
from echoscape.sim.raytracing.intersection import Hits, rotated_about_z
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.raytracing.surface.speckle import (
    PATCH_HEIGHT,
    by_range,
    coarser_edge_m,
    coarser_share,
    hash32,
    lattice_key,
    patch_edge_m,
    patch_key,
    patch_number,
    reflectivity,
    scatterer_offset,
)
from echoscape.sim.raytracing.surface.texture import Texture

MOST_ACROSS = 4
MOST_ALONG = 8
"""Most patches over which a footprint is divided, across and along the elevation of the ray; below 16."""
OVERLAP = 1.5
"""Edges of a footprint over the distance between rays: footprints that overlap leave no patch out."""
LEAST_SOLID_SR = 6e-5
"""Solid angle that the reflecting surfaces of a ghost must fill, some 0.3 m x 0.3 m at 40 m; those of twice
as much keep all of their power [sr]. No facade is plane and true enough for the chain of mirrors by which a
smaller spot returns, and rays meet such spots by chance only: ghosts by way of them depend on the draw."""
LEAST_SHARE = 1 / 64
"""The same as a number of rays over those of an azimuth, 8 of 512, for directions in which rays are few: as a
share, so that the power of ghosts does not depend on how many rays are sent."""
REGIONS_M: tuple[tuple[float, float], ...] = ((40.0, 2.0), (80.0, 4.0), (math.inf, 8.0))
"""Edge of the cells of the last surface in which rays count for the same ghost [m], up to each range [m]:
some 0.1 rad, so that a large surface fills them at any range."""
LEAST_INDEX_BITS = 20
"""Lower bits of a sorting key, which number the samples; more where samples are more. The other 44 hash the
patch: n^2 / 2^45 pairs of n patches share them all, one in a thousand scans, and are summed as one patch at a
place between both."""


@dataclass
class Footprints:
    """What N rays return, and the surface that each of them stands for, as Dr.Jit arrays.

    Attributes:
        out: Image of the reflecting point along the first leg, unfolded, double [m].
        back: Its image along the last leg, double [m]; the same array where both legs coincide.
        power: Mean received power before the azimuth gain [W].
        drift: Rate of change of half the path length by moving surfaces [m/s].
        length: Length of the path out to the surface, unfolded [m].
        across: Edge of the footprint across the elevation of the ray [m].
        along: Its edge along the elevation of the ray [m].
        density: Rays per solid angle [1/sr].
        azimuth: Number of the azimuth that the ray was sent for.
        number: Number of the ray in its scan.
        moving: Whether a surface on the path moves.
        chain: Hash of the objects that reflected the ray.
        planes: Hash of the planes in which it was reflected.
        unfold_x: Image of the world's x axis behind the mirrors; likewise `unfold_y`, `unfold_z`.
        local: Where the surface was met in the frame of its object, double [m].
        cosine: Cosine of the angle that rotates this frame into the world, double.
        sine: Sine of the same angle, double.
        owner: Tells apart the speckle lattices of moving objects; 0 for all that is at rest.
        material: Material id of the surface.
        instance: Instance id of the surface.
        bounces: Surfaces met out and back.
    """

    out: "mi.Point3d"
    back: "mi.Point3d"
    power: "mi.Float"
    drift: "mi.Float"
    length: "mi.Float"
    across: "mi.Vector3f"
    along: "mi.Vector3f"
    density: "mi.Float"
    azimuth: "mi.UInt32"
    number: "mi.UInt32"
    moving: "mi.Bool"
    chain: "mi.UInt32"
    planes: "mi.UInt32"
    unfold_x: "mi.Vector3f"
    unfold_y: "mi.Vector3f"
    unfold_z: "mi.Vector3f"
    local: "mi.Point3d"
    cosine: "mi.Float64"
    sine: "mi.Float64"
    owner: "mi.UInt32"
    material: "mi.UInt32"
    instance: "mi.UInt32"
    bounces: int


@dataclass(frozen=True, kw_only=True)
class _Samples:
    """K samples of footprints: the ray of each, and its place relative to where the ray met the surface.

    Attributes:
        ray: Index of the ray (K,).
        offset: Place in the world relative to the hit (K) [m]; zero where a footprint is not divided.
        power: Mean received power (K) [W].
        edge: Edge of the patch that it belongs to (K) [m].
    """

    ray: "mi.UInt32"
    offset: "mi.Vector3f"
    power: "mi.Float"
    edge: "mi.Float64"


@dataclass(frozen=True, kw_only=True)
class _Groups:
    """Samples summed by patch (P).

    Attributes:
        first: Index of the first sample of each patch.
        power: Sum of their powers [W].
        out: Mean of their images along the first leg, weighted by power, double [m].
        back: The same along the last leg, double [m]; None where both legs coincide.
    """

    first: "mi.UInt32"
    power: "mi.Float"
    out: "mi.Point3d"
    back: "mi.Point3d | None"


class PatchSums:
    """Sums what rays return by patch, and gives each patch its speckle."""

    def __init__(self, *, azimuths: int, rays: int, floor_w: float, seed: int) -> None:
        """Prepare the texture of all materials.

        Args:
            azimuths: Number of azimuths of a scan.
            rays: Number of rays that are sent for each.
            floor_w: Power below which a patch is left out [W].
            seed: Decides speckle and texture.
        """
        self._row_rad = 2 * math.pi / azimuths
        self._middle_azimuth = azimuths // 2
        self._least_rays = LEAST_SHARE * rays
        self._floor_w = floor_w
        self._seed = dr.opaque(mi.UInt32, seed & 0xFFFFFFFF)
        self._texture = Texture()

    def footprints(self, found: RayReturns, rays: RayBatch, hits: Hits) -> Footprints:
        """Return the footprints of rays that return something.

        Args:
            found: What the rays return (N).
            rays: The rays (N).
            hits: What they met (N).

        Returns:
            Their footprints (N), evaluated.
        """
        length = mi.Float(rays.travelled + hits.distance)
        across, along = _edges(rays, hits, length, self._row_rad)
        prints = Footprints(
            out=found.out,
            back=found.back,
            power=found.power,
            drift=found.drift,
            length=length,
            across=across,
            along=along,
            density=rays.density,
            azimuth=rays.azimuth,
            number=rays.number,
            moving=rays.moved | (hits.owner != 0),
            chain=rays.chain,
            planes=rays.planes,
            unfold_x=rays.unfold_x,
            unfold_y=rays.unfold_y,
            unfold_z=rays.unfold_z,
            local=hits.local,
            cosine=hits.cosine,
            sine=hits.sine,
            owner=hits.owner,
            material=hits.material,
            instance=hits.instance,
            bounces=found.bounces,
        )
        dr.eval(prints)
        return prints

    def paths(self, prints: Footprints, position: "mi.Float64") -> ReturnPaths | None:
        """Return the paths of all patches.

        Args:
            prints: What rays return (N).
            position: Positions of the antenna, x, y, z of each azimuth in turn (3 A,) [m].

        Returns:
            A path per patch, in no order that matters but the same one always; None where nothing returns.
        """
        if prints.bounces > 1:
            prints = replace(prints, power=prints.power * mi.Float(self._supported(prints)))
        samples = self._samples(prints)
        groups = self._groups(samples, prints, position)
        return self._speckled(groups, samples, prints, position) if groups else None

    def _supported(self, prints: Footprints) -> NDArray[np.float32]:
        """Return the share of its power that each ray of a ghost keeps (N,), by the ghost's solid angle."""
        edge = by_range(prints.length, REGIONS_M)
        key = lattice_key(prints.local, edge, hash32(prints.instance ^ prints.chain))
        dr.eval(key)
        _, region, count = np.unique(key.numpy(), return_inverse=True, return_counts=True)
        solid_sr = np.bincount(region, 1 / prints.density.numpy().astype(np.float64))
        share = np.clip(solid_sr / LEAST_SOLID_SR - 1, 0, 1) * np.clip(count / self._least_rays - 1, 0, 1)
        return share[region].astype(np.float32)

    def _samples(self, prints: Footprints) -> _Samples:
        """Divide the footprint of each ray into samples, evenly across and along its elevation.

        Where power passes into the patches of the next size, it is divided among patches of either size.
        """
        across, along, length = prints.across, prints.along, prints.length
        fine = _division(across, along, mi.Float(patch_edge_m(length)))
        coarse = _division(across, along, mi.Float(coarser_edge_m(length)))
        count = fine.x * fine.y + dr.select(coarser_share(length) > 0, coarse.x * coarse.y, 0)
        # Four numbers below 16 in one word, which samples gather at once.
        packed = fine.x | fine.y << 4 | coarse.x << 8 | coarse.y << 12
        dr.eval(count, packed)
        counts = count.numpy()
        ray = np.repeat(np.arange(len(counts), dtype=np.uint32), counts)
        number = np.arange(len(ray), dtype=np.uint32) - (np.cumsum(counts) - counts).astype(np.uint32)[ray]
        return self._placed(prints, mi.UInt32(ray), mi.UInt32(number), packed)

    def _placed(
        self, prints: Footprints, ray: "mi.UInt32", number: "mi.UInt32", packed: "mi.UInt32"
    ) -> _Samples:
        """Return sample `number` of each ray: first those in finer patches, then those in coarser ones."""
        packed = dr.gather(mi.UInt32, packed, ray)
        fine_count = (packed & 15) * (packed >> 4 & 15)
        coarse = number >= fine_count
        number = dr.select(coarse, number - fine_count, number)
        packed = dr.select(coarse, packed >> 8, packed)
        # Lanes beyond the last sample gather zeros, and an integer must not be divided by one.
        columns, steps = dr.maximum(packed & 15, 1), dr.maximum(packed >> 4 & 15, 1)
        column, step = number % columns, number // columns
        right = (mi.Float(column) + 0.5) / mi.Float(columns) - 0.5
        up = (mi.Float(step) + 0.5) / mi.Float(steps) - 0.5
        across, along = (dr.gather(mi.Vector3f, each, ray) for each in (prints.across, prints.along))
        length = dr.gather(mi.Float, prints.length, ray)
        share = coarser_share(length)
        power = dr.gather(mi.Float, prints.power, ray) * dr.select(coarse, share, 1 - share)
        return _Samples(
            ray=ray,
            offset=across * right + along * up,
            power=power / mi.Float(columns * steps),
            edge=dr.select(coarse, coarser_edge_m(length), patch_edge_m(length)),
        )

    def _local(self, samples: _Samples, prints: Footprints) -> "mi.Point3d":
        """Return the samples in the frames of their objects [m]."""
        cosine, sine = (dr.gather(mi.Float64, value, samples.ray) for value in (prints.cosine, prints.sine))
        aside = rotated_about_z(mi.Vector3d(samples.offset), cosine, -sine)
        return dr.gather(mi.Point3d, prints.local, samples.ray) + aside

    def _images(self, samples: _Samples, prints: Footprints) -> "tuple[mi.Point3d, mi.Point3d | None]":
        """Return the images of samples along the first and the last leg [m]."""
        axes = (
            dr.gather(mi.Vector3f, axis, samples.ray)
            for axis in (prints.unfold_x, prints.unfold_y, prints.unfold_z)
        )
        x, y, z = axes
        unfolded = mi.Vector3d(x * samples.offset.x + y * samples.offset.y + z * samples.offset.z)
        out = mi.Point3d(dr.gather(type(prints.out), prints.out, samples.ray)) + unfolded
        if prints.back is prints.out:
            return out, None
        back = mi.Point3d(dr.gather(type(prints.back), prints.back, samples.ray))
        return out, back + mi.Vector3d(samples.offset)

    def _groups(self, samples: _Samples, prints: Footprints, position: "mi.Float64") -> _Groups | None:
        """Sum samples by patch: equal keys lie side by side once sorted, samples of one patch by number.

        None where no patch is above the floor.
        """
        bits = max((dr.width(samples.ray) - 1).bit_length(), LEAST_INDEX_BITS)
        key = self._sorting_key(samples, prints, bits)
        origin = dr.gather(mi.Vector3d, position, 0)
        images = [mi.Vector3f(each - origin) for each in self._images(samples, prints) if each is not None]
        dr.eval(key, *images, samples.power, samples.offset, samples.edge)
        keys = np.sort(key.numpy())
        patch = keys >> np.uint64(bits)
        starts = np.flatnonzero(np.concatenate([[True], patch[1:] != patch[:-1]])).astype(np.uint32)
        counts = np.diff(np.append(starts, np.uint32(len(keys))))
        order = (keys & np.uint64((1 << bits) - 1)).astype(np.uint32)
        return self._summed(samples.power, images, origin, order=order, starts=starts, counts=counts)

    def _sorting_key(self, samples: _Samples, prints: Footprints, bits: int) -> "mi.UInt64":
        """Return a hash of the path by way of each patch, its lower bits the number of the sample."""
        owner, instance, planes, azimuth = (
            dr.gather(mi.UInt32, value, samples.ray)
            for value in (prints.owner, prints.instance, prints.planes, prints.azimuth)
        )
        local = self._local(samples, prints)
        # Both ends of the scan see the same surfaces, a revolution apart.
        late = mi.UInt32(azimuth >= self._middle_azimuth)
        path = hash32(instance ^ planes) ^ late
        high = hash32(patch_key(local, samples.edge, owner, self._seed) ^ path)
        low = hash32(patch_number(local, samples.edge, owner) ^ path)
        key = (mi.UInt64(high) << 32) | mi.UInt64(low)
        return (key >> bits << bits) | mi.UInt64(dr.arange(mi.UInt32, dr.width(high)))

    def _summed(
        self,
        power: "mi.Float",
        images: "list[mi.Vector3f]",
        origin: "mi.Vector3d",
        *,
        order: NDArray[np.uint32],
        starts: NDArray[np.uint32],
        counts: NDArray[np.uint32],
    ) -> _Groups | None:
        """Sum powers and mean images of patches, each over its samples in order; images are from `origin`.

        Patches of about as many samples lie side by side, since a vector of patches takes as long as the
        largest of them.
        """
        by_count = np.argsort(counts.astype(np.uint16), kind="stable")
        starts, counts = starts[by_count], counts[by_count]
        order_, start, count = mi.UInt32(order), mi.UInt32(starts), mi.UInt32(counts)
        first = dr.gather(mi.UInt32, order_, start)
        zero = dr.zeros(mi.Float, len(starts))
        anchors = [_at(each, first) for each in images]

        def add(step, total, *means):
            sample = dr.gather(mi.UInt32, order_, start + step)
            weight = dr.gather(mi.Float, power, sample)
            # Relative to the first of a patch: sums of single precision keep a hundredth of a millimetre.
            moved = [
                mean + (_at(each, sample) - anchor) * weight
                for mean, each, anchor in zip(means, images, anchors, strict=True)
            ]
            return step + 1, total + weight, *moved

        state = (dr.zeros(mi.UInt32, len(starts)), zero, *[mi.Vector3f(zero, zero, zero) for _ in anchors])
        _, total, *sums = dr.while_loop(
            state=state, cond=lambda step, *_: step < count, body=add, label="patches"
        )
        means = [
            mi.Point3d(origin + mi.Vector3d(anchor + moved / total))
            for anchor, moved in zip(anchors, sums, strict=True)
        ]
        dr.eval(first, total, *means)
        index = dr.compress(total > self._floor_w)
        if len(index) == 0:
            return None
        first, power, *means = (dr.gather(type(each), each, index) for each in (first, total, *means))
        dr.eval(first, power, *means)
        return _Groups(first=first, power=power, out=means[0], back=means[1] if len(means) > 1 else None)

    def _speckled(
        self, groups: _Groups, samples: _Samples, prints: Footprints, position: "mi.Float64"
    ) -> ReturnPaths:
        """Return the path of each patch, with the phase and the reflectivity of its scatterer."""
        first = groups.first
        one = _Samples(
            ray=dr.gather(mi.UInt32, samples.ray, first),
            offset=dr.gather(mi.Vector3f, samples.offset, first),
            power=groups.power,
            edge=dr.gather(mi.Float64, samples.edge, first),
        )
        edge, local = one.edge, self._local(one, prints)
        ray = one.ray
        owner = dr.gather(mi.UInt32, prints.owner, ray)
        key = patch_key(local, edge, owner, self._seed)
        real, imag = reflectivity(key)
        aside = scatterer_offset(local, edge, key)
        material = dr.gather(mi.UInt32, prints.material, ray)
        texture = self._texture.amplitude(
            material, local + aside, owner, self._seed, dr.full(mi.Bool, True, dr.width(first))
        )
        cosine, sine = (dr.gather(mi.Float64, value, ray) for value in (prints.cosine, prints.sine))
        turned = mi.Vector3f(rotated_about_z(aside, cosine, sine))
        out, back = groups.out, groups.back
        scatterer = _Samples(ray=ray, offset=one.offset + turned, power=one.power, edge=edge)
        scatterer_out, scatterer_back = self._images(scatterer, prints)
        azimuth = dr.gather(mi.UInt32, prints.azimuth, ray)
        here = mi.Point3d(dr.gather(mi.Vector3d, position, azimuth))
        beyond = dr.norm(scatterer_out - here) - dr.norm(out - here)
        if back is not None:
            beyond = (beyond + dr.norm(scatterer_back - here) - dr.norm(back - here)) * 0.5
        return ReturnPaths(
            out=out,
            back=out if back is None else back,
            beyond=mi.Float(beyond),
            power=one.power,
            real=real * texture,
            imag=imag * texture,
            drift=dr.gather(mi.Float, prints.drift, ray),
            azimuth=azimuth,
            number=dr.gather(mi.UInt32, prints.number, ray),
            material=material,
            instance=dr.gather(mi.UInt32, prints.instance, ray),
            moving=dr.gather(mi.Bool, prints.moving, ray),
            bounces=prints.bounces,
        )


def _division(across: "mi.Vector3f", along: "mi.Vector3f", edge_m: "mi.Float") -> "mi.Vector2u":
    """Return into how many parts of a patch's size footprints are divided, across and along (N)."""
    wide = dr.maximum(dr.norm(mi.Vector2f(along.x, along.y)), dr.abs(along.z) * (1 / PATCH_HEIGHT))
    columns = dr.clip(dr.ceil(dr.norm(across) / edge_m), 1, MOST_ACROSS)
    return mi.Vector2u(mi.UInt32(columns), mi.UInt32(dr.clip(dr.ceil(wide / edge_m), 1, MOST_ALONG)))


def _at(points: "mi.Vector3f", index: "mi.UInt32") -> "mi.Vector3f":
    """Return some of the points as vectors."""
    return dr.gather(mi.Vector3f, points, index)


def _edges(
    rays: RayBatch, hits: Hits, length: "mi.Float", row_rad: float
) -> "tuple[mi.Vector3f, mi.Vector3f]":
    """Return the surface that each ray stands for, as its edges across and along elevation (N) [m].

    Of all rectangles of the solid angle 1 / density with which a net of rays tiles the sphere, it is the one
    that makes the footprint on the surface most nearly square.
    """
    direction, normal = mi.Vector3f(rays.direction), mi.Vector3f(hits.normal)
    level = dr.maximum(dr.norm(mi.Vector2f(direction.x, direction.y)), 1e-3)
    right = mi.Vector3f(direction.y, -direction.x, 0) / level
    up = dr.cross(right, direction)
    facing = dr.minimum(dr.dot(direction, normal), -1e-2)
    across = (right - direction * (dr.dot(right, normal) / facing)) * length
    along = (up - direction * (dr.dot(up, normal) / facing)) * length
    ratio = dr.norm(along) / dr.norm(across)
    azimuth_rad = dr.clip(dr.sqrt(ratio / rays.density), row_rad / 16, row_rad)
    return across * (OVERLAP * azimuth_rad), along * (OVERLAP / (rays.density * azimuth_rad))
