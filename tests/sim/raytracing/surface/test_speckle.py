"""Patches of surface: their sizes by range, the passage from one size to the next, and their numbers."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.raytracing.surface.speckle import (
    PATCH_STEPS,
    TRANSITION,
    coarser_edge_m,
    coarser_share,
    patch_edge_m,
    patch_key,
    patch_number,
)

Array = NDArray[np.float64]
ENDS_M = [until_m for until_m, _ in PATCH_STEPS[:-1]]


def shares(range_m: Array) -> Array:
    return coarser_share(mi.Float(range_m.astype(np.float32))).numpy().astype(np.float64)


@pytest.mark.parametrize("end_m", ENDS_M)
def test_power_passes_into_larger_patches_before_each_step(end_m: float) -> None:
    start_m = end_m * (1 - TRANSITION)
    passed = np.array([-0.5, -0.01, 0.0, 0.25, 0.5, 0.75, 0.9999])
    expected = [0, 0, 0, 0.1464, 0.5, 0.8536, 1]  # sin^2 of 0, 22.5, 45, 67.5 and 90 deg
    found = shares(start_m + passed * (end_m - start_m))
    np.testing.assert_allclose(found, expected, atol=2e-4)
    assert shares(np.array([end_m * 1.001])) == 0


@given(st.floats(0.5, 163.0), st.floats(0.0, 0.25))
def test_ranges_correlate_by_the_cosine_of_the_passage_between_them(range_m: float, step_m: float) -> None:
    # Powers of each size of patch at both ranges: amplitudes of the same patches correlate, others do not.
    ranges = np.array([range_m, range_m + step_m])
    share = shares(ranges)
    edge, coarser = (f(mi.Float(ranges.astype(np.float32))).numpy() for f in (patch_edge_m, coarser_edge_m))
    power = [{edge[k]: 1 - share[k]} | ({coarser[k]: share[k]} if share[k] else {}) for k in (0, 1)]
    correlation = sum(np.sqrt(each * power[1].get(size, 0.0)) for size, each in power[0].items())
    end_m = min((each for each in ENDS_M if each > range_m), default=np.inf)
    assert correlation >= np.cos(np.pi / 2 * step_m / (TRANSITION * end_m)) - 1e-3


def test_sizes_follow_each_other() -> None:
    ranges = mi.Float([3, 8, 20, 40, 100])
    np.testing.assert_allclose(patch_edge_m(ranges).numpy(), [0.05, 0.1, 0.2, 0.4, 0.8])
    np.testing.assert_allclose(coarser_edge_m(ranges).numpy(), [0.1, 0.2, 0.4, 0.8, 0.8])
    assert shares(np.array([60.0, 100.0, 163.0])).max() == 0


def test_numbers_of_patches_are_independent_of_their_keys() -> None:
    # 2^18 patches of a plane: by 32 random bits 8 pairs share one, by 64 none.
    across, along = np.meshgrid(np.arange(512) * 0.4, np.arange(512) * 0.4)
    count = across.size
    point = mi.Point3d(across.ravel() + 0.1, along.ravel() + 0.1, np.zeros(count))
    edge, owner = dr.full(mi.Float64, 0.4, count), dr.zeros(mi.UInt32, count)
    key = patch_key(point, edge, owner, dr.full(mi.UInt32, 5, count)).numpy().astype(np.uint64)
    number = patch_number(point, edge, owner).numpy().astype(np.uint64)
    for bits in (key, number):
        assert count - len(np.unique(bits)) < 8 + 4 * np.sqrt(8)
    assert len(np.unique(key << np.uint64(32) | number)) == count
    # The upper bits, which tell patches with the same key apart, are even.
    assert abs(np.corrcoef(key, number)[0, 1]) < 5 / np.sqrt(count)
    sixteenths = np.bincount((number >> np.uint64(28)).astype(np.int64), minlength=16)
    assert np.abs(sixteenths - count / 16).max() < 5 * np.sqrt(count / 16)


def test_other_sizes_and_owners_have_other_numbers() -> None:
    point = mi.Point3d(mi.Float64([1.0, 1.0, 1.0]), mi.Float64([2.0, 2.0, 2.0]), mi.Float64([0.0, 0.0, 0.0]))
    edge, owner = mi.Float64([0.4, 0.8, 0.4]), mi.UInt32([0, 0, 7])
    assert len(np.unique(patch_number(point, edge, owner).numpy())) == 3
