"""Patches hold the power of all rays in them, and their phase is that of a scatterer fixed in the world."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from echoscape.sim.raytracing.bounces import ReturnPaths
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.raytracing.patches import LEAST_SHARE, LEAST_SOLID_SR, Footprints, PatchSums
from echoscape.sim.raytracing.surface.speckle import (
    PATCH_HEIGHT,
    PATCH_STEPS,
    TRANSITION,
    patch_edge_m,
    patch_key,
    reflectivity,
    scatterer_offset,
)

AZIMUTHS, RAYS, SEED = 400, 512, 5
ANTENNA = np.array([0.3, -0.2, 2.0])
POSITION = np.tile(ANTENNA, AZIMUTHS)
WAVELENGTH_M = 299792458 / 76.5e9
Array = NDArray[np.float64]


def floats(values: Array) -> "mi.Float":
    return mi.Float(np.asarray(values, np.float32))


def doubles(points: Array) -> "mi.Point3d":
    return mi.Point3d(np.ascontiguousarray(points.T))


def footprints(points: Array, power: Array | float = 1.0, **changes: Any) -> Footprints:
    """Small footprints (N, 3) of direct returns at rest, seen from `ANTENNA`."""
    count = len(points)
    zero, none = dr.zeros(mi.Float, count), dr.zeros(mi.UInt32, count)
    at = doubles(points)
    length = np.linalg.norm(points - ANTENNA, axis=1)
    made: dict[str, Any] = {
        "out": at,
        "back": at,
        "power": floats(np.broadcast_to(power, count)),
        "drift": zero,
        "length": floats(length),
        "across": mi.Vector3f(zero, zero, zero),
        "along": mi.Vector3f(zero, zero, zero),
        "density": dr.full(mi.Float, 1e6, count),
        "azimuth": none,
        "number": dr.arange(mi.UInt32, count),
        "moving": dr.zeros(mi.Bool, count),
        "chain": none,
        "planes": none,
        "unfold_x": mi.Vector3f(zero + 1, zero, zero),
        "unfold_y": mi.Vector3f(zero, zero + 1, zero),
        "unfold_z": mi.Vector3f(zero, zero, zero + 1),
        "local": at,
        "cosine": dr.full(mi.Float64, 1, count),
        "sine": dr.zeros(mi.Float64, count),
        "owner": none,
        "material": none,
        "instance": none + 1,
        "bounces": 1,
    }
    prints = Footprints(**(made | changes))
    dr.eval(prints)
    return prints


def summed(prints: Footprints, *, floor_w: float = 1e-30) -> ReturnPaths:
    paths = PatchSums(azimuths=AZIMUTHS, rays=RAYS, floor_w=floor_w, seed=SEED).paths(
        prints, mi.Float64(POSITION)
    )
    assert paths is not None
    dr.eval(paths)
    return paths


def wall(seed: int, count: int = 3000, *, x: float = 30.0) -> Array:
    """Points on a wall across x, some 4 m x 3 m."""
    y, z = np.random.default_rng(seed).uniform([[-2], [0.5]], [[2], [3.5]], (2, count))
    return np.column_stack([np.full(count, x), y, z])


def keys(points: Array) -> NDArray[np.uint32]:
    """Hash of the patch of each point, by the function of the lattice alone."""
    edge = patch_edge_m(floats(np.linalg.norm(points - ANTENNA, axis=1)))
    owner = dr.zeros(mi.UInt32, len(points))
    return patch_key(doubles(points), edge, owner, dr.full(mi.UInt32, SEED, len(points))).numpy()


def half_paths(paths: ReturnPaths) -> Array:
    """Half the length of the path by way of each scatterer [m]."""
    legs = [np.linalg.norm(end.numpy().T - ANTENNA, axis=1) for end in (paths.out, paths.back)]
    return (legs[0] + legs[1]) / 2 + paths.beyond.numpy()


def by_scatterer(paths: ReturnPaths, values: Array) -> dict[tuple[float, float], float]:
    """Values by the reflectivity of the patch, which is its own."""
    found = zip(paths.real.numpy().tolist(), paths.imag.numpy().tolist(), strict=True)
    return dict(zip(found, np.asarray(values, np.float64).tolist(), strict=True))


@given(st.integers(0, 1000), st.integers(1, 400), st.floats(0.0, 1.5), st.floats(5.0, 150.0))
@settings(max_examples=40, deadline=None)
def test_patches_hold_the_power_of_all_rays(seed: int, count: int, wide_m: float, range_m: float) -> None:
    rng = np.random.default_rng(seed)
    points, power = wall(seed, count, x=range_m), rng.exponential(1e-12, count)
    zero = dr.zeros(mi.Float, count)
    paths = summed(
        footprints(
            points,
            power,
            across=mi.Vector3f(zero, zero + wide_m, zero),
            along=mi.Vector3f(zero, zero, zero + 2 * wide_m),
        )
    )
    assert paths.power.numpy().sum(dtype=np.float64) == pytest.approx(power.sum(), rel=1e-5)
    # And its place: footprints are divided evenly about the points where rays met the wall.
    out, shares = paths.out.numpy().T, paths.power.numpy()[:, None].astype(np.float64)
    np.testing.assert_allclose(
        (out * shares).sum(axis=0) / shares.sum(), power @ points / power.sum(), rtol=1e-5, atol=2e-5
    )


def test_rays_of_a_patch_are_one_path_at_their_mean_place() -> None:
    points = wall(1)
    power = np.random.default_rng(2).uniform(1e-12, 3e-12, len(points))
    key, patch = np.unique(keys(points), return_inverse=True)
    paths = summed(footprints(points, power))
    assert dr.width(paths.power) == len(key) > 20
    expected = np.bincount(patch, power)
    np.testing.assert_allclose(np.sort(paths.power.numpy()), np.sort(expected), rtol=1e-5)
    mean = np.stack([np.bincount(patch, power * axis) / expected for axis in points.T], axis=1)
    by_power = np.argsort(expected), np.argsort(paths.power.numpy())
    np.testing.assert_allclose(paths.out.numpy().T[by_power[1]], mean[by_power[0]], atol=1e-5)
    real, imag = reflectivity(mi.UInt32(key))
    np.testing.assert_allclose(paths.real.numpy()[by_power[1]], real.numpy()[by_power[0]], atol=1e-6)
    np.testing.assert_allclose(paths.imag.numpy()[by_power[1]], imag.numpy()[by_power[0]], atol=1e-6)


def test_other_rays_give_a_patch_the_same_reflectivity_and_phase() -> None:
    first, second = (summed(footprints(wall(seed, count))) for seed, count in ((1, 3000), (2, 400)))
    one, two = (by_scatterer(paths, half_paths(paths)) for paths in (first, second))
    common = one.keys() & two.keys()
    assert len(common) > 0.9 * len(one) > 20
    cycles = np.array([(one[each] - two[each]) * 2 / WAVELENGTH_M for each in common])
    assert np.abs(cycles).max() < 0.01  # single precision of an offset of a metre: 1e-4 cycles
    # Yet rays met each elsewhere: by the mean point alone there would be no phase in common.
    near, far = (
        by_scatterer(paths, np.linalg.norm(paths.out.numpy().T - ANTENNA, axis=1))
        for paths in (first, second)
    )
    assert np.std([(near[each] - far[each]) * 2 / WAVELENGTH_M for each in common]) > 0.5


@pytest.mark.parametrize("end_m", [until_m for until_m, _ in PATCH_STEPS[:-1]])
@pytest.mark.parametrize("step_m", [0.05, 0.25])
def test_scatterers_pass_gradually_into_those_of_larger_patches(end_m: float, step_m: float) -> None:
    # The field of the same wall at neighbouring ranges, but for the phases of the paths: scatterers of both
    # count with the root of their powers.
    points = wall(8)
    start_m = end_m * (1 - TRANSITION)
    power = []
    for range_m in (*np.linspace(start_m - step_m, end_m + step_m, 20), end_m - step_m / 2):
        for here in (range_m, range_m + step_m):
            paths = summed(footprints(points, length=floats(np.full(len(points), here))))
            power.append(by_scatterer(paths, paths.power.numpy()))
    for one, two in zip(power[::2], power[1::2], strict=True):
        correlation = sum(math.sqrt(value * two.get(each, 0.0)) for each, value in one.items()) / len(points)
        assert correlation >= math.cos(math.pi / 2 * step_m / (TRANSITION * end_m)) - 1e-3


@pytest.mark.parametrize("range_m", [5.4, 8.0, 10.2, 11.0, 22.5, 30.0, 41.0, 45.0, 49.5, 90.0])
def test_fields_are_circular_gaussian_at_any_range(range_m: float) -> None:
    # A wall of 10,000 cells of 1 m, in each some 20 rays of unequal power.
    rng = np.random.default_rng(9)
    y, z = rng.uniform([[0], [0]], [[200], [50]], (2, 200_000))
    points = np.column_stack([np.full(len(y), 30.0), y, z])
    length = floats(np.full(len(points), range_m))
    paths = summed(footprints(points, rng.exponential(1e-12, len(points)), length=length))
    place = np.floor(paths.out.numpy().T[:, 1:]).astype(int)
    cell, power = place[:, 0] * 50 + place[:, 1], paths.power.numpy().astype(np.float64)
    real, imag, mean = (
        np.bincount(cell, value, 10_000)
        for value in (np.sqrt(power) * paths.real.numpy(), np.sqrt(power) * paths.imag.numpy(), power)
    )
    field = (real + 1j * imag)[mean > 0] / np.sqrt(mean[mean > 0])
    assert len(field) > 4000
    intensity = np.abs(field) ** 2
    # Standard errors of the moments of an exponential variable: 1.6 %, 7 %; of a circular one: 1.6 %.
    assert intensity.mean() == pytest.approx(1, abs=0.05)
    assert np.mean(intensity**2) == pytest.approx(2, abs=0.22)
    assert abs(np.mean(field**2)) < 0.06
    assert abs(np.mean(field)) < 0.04


def scatterers(points: Array) -> Array:
    """Where the scatterer of the patch of each point is (N, 3) [m]."""
    edge = patch_edge_m(floats(np.linalg.norm(points - ANTENNA, axis=1)))
    offset = scatterer_offset(doubles(points), edge, mi.UInt32(keys(points)))
    return points + mi.Vector3d(offset).numpy().T


def expected_by_scatterer(points: Array, values: Array) -> dict[tuple[float, float], float]:
    real, imag = reflectivity(mi.UInt32(keys(points)))
    return dict(zip(zip(real.numpy().tolist(), imag.numpy().tolist(), strict=True), values, strict=True))


def compare(found: dict, expected: dict) -> None:
    """Check the paths of patches; a few at the edge of the wall hold too few rays for a ghost."""
    assert found.keys() <= expected.keys()
    assert len(found) > 0.9 * len(expected) > 20
    for each, value in found.items():
        assert value == pytest.approx(expected[each], abs=2e-6)  # a thousandth of a cycle


def test_path_leads_by_way_of_the_scatterer() -> None:
    points = wall(3)
    paths = summed(footprints(points))
    compare(
        by_scatterer(paths, half_paths(paths)),
        expected_by_scatterer(points, np.linalg.norm(scatterers(points) - ANTENNA, axis=1)),
    )


def mirrored(points: Array, x: float) -> Array:
    """Images of points behind a mirror across the x axis at `x`."""
    return points * [-1, 1, 1] + [2 * x, 0, 0]


def behind_a_mirror(points: Array, x: float, **changes: Any) -> Footprints:
    zero = dr.zeros(mi.Float, len(points))
    image = doubles(mirrored(points, x))
    given: dict[str, Any] = {
        "out": image,
        "back": image,
        "length": floats(np.linalg.norm(points - ANTENNA, axis=1)),
        "unfold_x": mi.Vector3f(zero - 1, zero, zero),
        "bounces": 3,
    }
    return footprints(points, **(given | changes))


def test_mirrored_patches_have_the_phase_of_the_unfolded_path() -> None:
    points = wall(4, 30000)
    paths = summed(behind_a_mirror(points, 45.0))
    image = mirrored(scatterers(points), 45.0)
    compare(
        by_scatterer(paths, half_paths(paths)),
        expected_by_scatterer(points, np.linalg.norm(image - ANTENNA, axis=1)),
    )


def test_loops_have_the_phase_of_both_their_legs() -> None:
    points = wall(5, 30000)
    paths = summed(behind_a_mirror(points, 45.0, back=doubles(points), bounces=2))
    there = scatterers(points)
    legs = [np.linalg.norm(end - ANTENNA, axis=1) for end in (mirrored(there, 45.0), there)]
    compare(by_scatterer(paths, half_paths(paths)), expected_by_scatterer(points, (legs[0] + legs[1]) / 2))


def test_patches_of_a_turned_object_are_its_own() -> None:
    # The same points of an object, which stands elsewhere and turned.
    local, angle, shift = wall(6), 0.7, np.array([3.0, -8.0, 0.0])
    cosine, sine = math.cos(angle), math.sin(angle)
    turn = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    owner = dr.full(mi.UInt32, 9, len(local))
    length = floats(np.full(len(local), 30.0))
    here = summed(footprints(local, owner=owner, length=length))
    there = summed(
        footprints(
            local @ turn.T + shift,
            owner=owner,
            length=length,
            local=doubles(local),
            cosine=dr.full(mi.Float64, cosine, len(local)),
            sine=dr.full(mi.Float64, sine, len(local)),
        )
    )
    # The scatterer turns with the object: where it is from three antennas tells its place.
    assert by_scatterer(here, here.power.numpy()) == by_scatterer(there, there.power.numpy())
    edge = dr.full(mi.Float64, 0.4, len(local))
    key = patch_key(doubles(local), edge, owner, dr.full(mi.UInt32, SEED, len(local)))
    scatterer = local + mi.Vector3d(scatterer_offset(doubles(local), edge, key)).numpy().T
    real, imag = reflectivity(key)
    away = np.linalg.norm(scatterer @ turn.T + shift - ANTENNA, axis=1)
    expected = dict(zip(zip(real.numpy().tolist(), imag.numpy().tolist(), strict=True), away, strict=True))
    compare(by_scatterer(there, half_paths(there)), expected)


def test_footprints_are_divided_in_the_frame_of_their_object() -> None:
    # A footprint three patches wide, on an object as it is and on the same turned to the left.
    local = np.array([[30.0, 0.2, 1.5], [30.0, 3.1, 1.5]])
    cosine, sine = math.cos(0.7), math.sin(0.7)
    wide, none = dr.full(mi.Float, 1.2, 2), dr.zeros(mi.Float, 2)
    given: dict[str, Any] = {"owner": dr.full(mi.UInt32, 9, 2), "length": floats(np.full(2, 30.0))}
    here = summed(footprints(local, across=mi.Vector3f(none, wide, none), **given))
    turn = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    there = summed(
        footprints(
            local @ turn.T,
            across=mi.Vector3f(-sine * wide, cosine * wide, none),
            local=doubles(local),
            cosine=dr.full(mi.Float64, cosine, 2),
            sine=dr.full(mi.Float64, sine, 2),
            **given,
        )
    )
    assert dr.width(here.power) >= 6
    assert by_scatterer(here, here.power.numpy()) == by_scatterer(there, there.power.numpy())


@pytest.mark.parametrize("name", ["planes", "instance", "azimuth", "owner"])
def test_rays_of_different_paths_or_objects_share_no_patch(name: str) -> None:
    # Half of the rays by way of another mirror, on another object, at the end of the scan, on another mover.
    points = wall(7)
    other = (np.arange(len(points)) % 2).astype(np.uint32) * np.uint32(300) + 1
    alone, split = (
        summed(footprints(points, 1e-12, **{name: mi.UInt32(values)})) for values in (other * 0 + 1, other)
    )
    assert 1.9 * dr.width(alone.power) < dr.width(split.power) <= 2.2 * dr.width(alone.power)
    total = [paths.power.numpy().sum(dtype=np.float64) for paths in (alone, split)]
    assert total[0] == pytest.approx(total[1], rel=1e-6)


@pytest.mark.parametrize(
    ("rays", "density"), [(200, 1e6), (90, 1e6), (40, 1e6), (20, 1e6), (4, 1e5), (6, 4e4), (12, 4e4)]
)
def test_small_ghosts_fade_and_echoes_do_not(rays: int, density: float) -> None:
    points = np.column_stack([np.full(rays, 30.0), np.linspace(0.1, 1.2, rays), np.full(rays, 1.5)])
    given = {"density": dr.full(mi.Float, density, rays)}
    direct = summed(footprints(points, 1e-12, **given)).power.numpy().sum(dtype=np.float64)
    assert direct == pytest.approx(rays * 1e-12, rel=1e-5)
    solid_sr = rays / density
    # None below the least, all from twice the least on.
    kept = np.clip([solid_sr / LEAST_SOLID_SR - 1, rays / (LEAST_SHARE * RAYS) - 1], 0, 1).prod()
    sums = PatchSums(azimuths=AZIMUTHS, rays=RAYS, floor_w=1e-30, seed=SEED)
    paths = sums.paths(
        behind_a_mirror(points, 45.0, **given, power=floats(np.full(rays, 1e-12))), mi.Float64(POSITION)
    )
    if kept == 0:
        assert paths is None
    else:
        assert paths is not None
        assert paths.power.numpy().sum(dtype=np.float64) == pytest.approx(kept * direct, rel=1e-5)


@pytest.mark.parametrize("range_m", [30.0, 60.0, 90.0, 150.0])
def test_ghost_of_a_large_surface_keeps_its_power_at_any_range(range_m: float) -> None:
    # A wall of 20 m x 6 m that 2e5 rays per steradian meet squarely, wherever the cells of the lattice end.
    density = 2e5
    step = range_m / np.sqrt(density)
    across, up = np.meshgrid(np.arange(-10, 10, step), np.arange(0, 6, step))
    points = np.column_stack([np.full(across.size, 20.0), across.ravel(), up.ravel()])
    given = {
        "density": dr.full(mi.Float, density, len(points)),
        "length": dr.full(mi.Float, range_m, len(points)),
    }
    sums = PatchSums(azimuths=AZIMUTHS, rays=RAYS, floor_w=1e-30, seed=SEED)
    paths = sums.paths(
        behind_a_mirror(points, 45.0, **given, power=floats(np.full(len(points), 1e-12))),
        mi.Float64(POSITION),
    )
    assert paths is not None
    total = paths.power.numpy().sum(dtype=np.float64)
    assert total == pytest.approx(len(points) * 1e-12, rel=0.05)


def test_footprints_of_the_size_of_several_patches_fill_them() -> None:
    # At 30 m patches are 0.4 m wide: a footprint of 1.6 m x 1.2 m has the power of 4 columns, evenly.
    centre = np.array([[30.0, 1.6 - 0.0211, 2.4 - 0.0173 - 0.6]])
    zero = dr.zeros(mi.Float, 1)
    paths = summed(
        footprints(
            centre, across=mi.Vector3f(zero, zero + 1.59, zero), along=mi.Vector3f(zero, zero, zero + 1.19)
        )
    )
    np.testing.assert_allclose(paths.power.numpy(), 0.25, rtol=1e-6)
    places = np.sort(paths.out.numpy()[1])
    np.testing.assert_allclose(places, 1.6 - 0.0211 + 0.3975 * (np.arange(4) - 1.5), atol=1e-5)
    assert PATCH_HEIGHT == 3.0


def test_many_weak_rays_make_a_path_and_few_do_not() -> None:
    point = np.tile([[30.0, 0.1, 1.5]], (40, 1))
    assert dr.width(summed(footprints(point, 1e-13), floor_w=1e-12).power) == 1
    sums = PatchSums(azimuths=AZIMUTHS, rays=RAYS, floor_w=1e-12, seed=SEED)
    assert sums.paths(footprints(point[:9], 1e-13), mi.Float64(POSITION)) is None


def test_sums_do_not_depend_on_other_patches() -> None:
    # The order of samples is that of their rays, whatever else is in the scan: the same bits.
    points = wall(8)
    power = np.random.default_rng(3).uniform(1e-12, 3e-12, len(points))
    whole = summed(footprints(points, power))
    left = points[:, 1] < -0.5
    part = summed(footprints(points[left], power[left]))
    one, two = (by_scatterer(paths, paths.power.numpy()) for paths in (whole, part))
    inner = np.isin(keys(points), keys(points[~left]), invert=True)
    complete = expected_by_scatterer(points[inner], np.zeros(inner.sum()))
    assert len(complete) > 5
    assert all(one[each] == two[each] for each in complete)
