"""Phase sums with separate ends: bistatic cross-sections and images, against closed forms."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from echoscape.scenes.core.materials import MATERIALS
from echoscape.scenes.core.targets import Target
from echoscape.sim.raytracing.surface.fresnel import permittivity
from echoscape.sim.raytracing.targets.physical_optics import largest_sum, surface_paths

WAVELENGTH_M = 299_792_458 / 76.5e9
METAL = permittivity(MATERIALS["metal"], 76.5e9)
FAR_M = 400.0


def total(target: Target, radar: NDArray, receiver: NDArray | None = None) -> complex:
    paths = surface_paths(target, radar, receiver=receiver, wavelength_m=WAVELENGTH_M, epsilon=METAL)
    return complex(paths.amplitude.sum())


def around(bearing_deg: float, range_m: float, elevation_deg: float = 0.0) -> NDArray[np.float64]:
    bearing, elevation = np.radians([bearing_deg, elevation_deg])
    level = range_m * math.cos(elevation)
    return np.array([level * np.cos(bearing), level * np.sin(bearing), range_m * math.sin(elevation)])


def cross_section_m2(target: Target, bistatic_deg: float) -> float:
    """4 pi |sum|^2 R1^2 R2^2 / lambda^2, ends half the angle to each side of x."""
    ends = (around(side * bistatic_deg / 2, FAR_M) for side in (-1, 1))
    return 4 * math.pi * abs(total(target, *ends)) ** 2 * FAR_M**4 / WAVELENGTH_M**2


@pytest.mark.parametrize("bistatic_deg", [0.0, 30.0, 90.0, 140.0])
def test_bistatic_cross_section_of_a_sphere_is_its_disc_at_all_angles(bistatic_deg: float) -> None:
    sphere = Target(kind="sphere", position_m=(0.0, 0.0, 0.0), size_m=(0.1,))
    assert cross_section_m2(sphere, bistatic_deg) == pytest.approx(math.pi * 0.01, rel=0.01)


@pytest.mark.parametrize("bistatic_deg", [0.0, 30.0, 90.0, 140.0])
def test_bistatic_cross_section_of_a_cylinder_falls_with_the_cosine(bistatic_deg: float) -> None:
    cylinder = Target(kind="cylinder", position_m=(0.0, 0.0, 0.0), size_m=(0.05, 0.3))
    half = math.cos(math.radians(bistatic_deg / 2))
    expected = 2 * math.pi * 0.05 * 0.3**2 / WAVELENGTH_M * half  # geometrical optics across the axis
    assert cross_section_m2(cylinder, bistatic_deg) == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("incidence_deg", [0.0, 20.0, 40.0])
def test_large_plate_between_two_ends_is_an_image(incidence_deg: float) -> None:
    radar, receiver = around(-incidence_deg, 12.0), around(incidence_deg, 20.0)
    # The specular point lies at the origin; edges ripple, so the mean over sizes counts.
    sizes = np.linspace(2.5, 3.5, 7)
    plates = [
        Target(kind="plate", position_m=(0.0, 0.0, 0.0), size_m=(float(size), float(size))) for size in sizes
    ]
    powers = [abs(total(plate, radar, receiver)) ** 2 for plate in plates]
    assert math.sqrt(np.mean(powers)) == pytest.approx(WAVELENGTH_M / (12.0 + 20.0), rel=0.06)


def test_corner_sends_back_to_where_it_came_from() -> None:
    corner = Target(kind="trihedral", position_m=(0.0, 0.0, 0.0), size_m=(0.2,))
    retro = abs(total(corner, around(10.0, 50.0)))
    aside = abs(total(corner, around(10.0, 50.0), around(-10.0, 50.0)))
    assert retro > 30 * aside


TARGETS = [
    Target(kind="point", position_m=(0.0, 0.0, 0.0)),
    Target(kind="sphere", position_m=(0.0, 0.0, 0.0), size_m=(0.2,)),
    Target(kind="cylinder", position_m=(0.0, 0.0, 0.0), size_m=(0.1, 0.5)),
]


@settings(max_examples=30, deadline=None)
@given(
    target=st.sampled_from(TARGETS),
    bearing_deg=st.floats(-60, 60),
    elevation_deg=st.floats(-20, 20),
    ranges_m=st.tuples(st.floats(3, 50), st.floats(3, 50)),
)
def test_both_directions_of_a_path_are_alike(
    target: Target, bearing_deg: float, elevation_deg: float, ranges_m: tuple[float, float]
) -> None:
    if target.kind == "cylinder":  # off its specular cone physical optics is reciprocal in phase alone
        elevation_deg = 0.0
    ends = around(0.0, ranges_m[0]), around(bearing_deg, ranges_m[1], elevation_deg)
    there, back = total(target, *ends), total(target, *ends[::-1])
    assert there == pytest.approx(back, rel=1e-3)


FLAT = [
    Target(kind="plate", position_m=(0.0, 0.0, 0.0), size_m=(0.3, 0.2)),
    Target(kind="dihedral", position_m=(0.0, 0.0, 0.0), size_m=(0.2, 0.3)),
    Target(kind="trihedral", position_m=(0.0, 0.0, 0.0), size_m=(0.2,)),
]


@settings(max_examples=60, deadline=None)
@given(
    target=st.sampled_from([*TARGETS, *FLAT]),
    bearings_deg=st.tuples(st.floats(-85, 85), st.floats(-85, 85)),
    range_m=st.floats(2, 50),
    monostatic=st.booleans(),
)
def test_no_sum_exceeds_its_bound(
    target: Target, bearings_deg: tuple[float, float], range_m: float, monostatic: bool
) -> None:
    ends = [around(bearing, range_m) for bearing in bearings_deg]
    if monostatic:
        ends[1] = ends[0]
    bound = largest_sum(target, WAVELENGTH_M) / (range_m - target.reach_m) ** 2
    assert abs(total(target, *ends)) <= bound * 1.001


def test_same_ends_are_a_monostatic_radar() -> None:
    radar = around(5.0, 20.0, 4.0)
    for target in (*TARGETS, Target(kind="plate", position_m=(0.0, 0.0, 0.0), size_m=(0.3, 0.3))):
        assert total(target, radar, radar.copy()) == total(target, radar)
