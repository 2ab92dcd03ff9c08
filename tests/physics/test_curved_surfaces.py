"""Cross-sections of curved surfaces and of road users, seen by rays in free space."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.cross_sections import cross_sections_m2
from echoscape.scenes.assets.vehicles import vehicle_prototypes
from echoscape.scenes.geometry.meshes import moved, prototype
from echoscape.scenes.geometry.primitives import ellipsoid
from tests.physics.laws import LawRecorder
from tests.physics.tracing import WAVELENGTH_M
from tests.sim.worlds import decibel

SECTION = "Curved surfaces and road users"
PROTOTYPES = {each.name: each for each in vehicle_prototypes()}
ANY_ASPECTS_DEG = tuple(range(0, 360, 45))
MIRROR = (1 - 0.15**2) * math.exp(-((4 * math.pi * 5e-5 / WAVELENGTH_M) ** 2))
"""Mirror share of metal: S = 0.15 and 0.05 mm of roughness."""
METAL = MIRROR + (1 - MIRROR) * 8 / 3
"""A metal sphere against pi r^2: its mirror part, and a Lambertian one of 8/3 pi r^2."""


def turned(seed: int) -> NDArray[np.float64]:
    """A rotation drawn evenly from all."""
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else -q


@pytest.mark.parametrize("range_m", [10.0, 80.0])
@pytest.mark.parametrize(("sides", "rows"), [(10, 6), (16, 10)])
def test_faceted_sphere_has_the_cross_section_of_a_sphere(
    sides: int, rows: int, range_m: float, law: LawRecorder
) -> None:
    ball = moved(ellipsoid((0.5, 0.5, 0.5), sides=sides, rows=rows), rotation=turned(sides))
    each = cross_sections_m2(
        prototype("ball", "target", {"metal": ball}),
        ANY_ASPECTS_DEG,
        range_m=range_m,
        rays=1024 if range_m > 20 else 256,
        bounces=1,
    )
    nearer = (range_m / (range_m - 0.5)) ** 2
    law(
        f"Metal sphere of 0.5 m in {sides} x {rows} facets at {range_m:g} m, mean over aspects",
        source="pi r^2, Knott, Radar Cross Section, 2012; 0.3 dB of diffuse scattering; its point is nearer",
        expected=float(decibel(math.pi * 0.25 * METAL * nearer)),
        simulated=float(decibel(each.mean())),
        tolerance=1.0,
        unit="dBsm",
        why="facets lie within the sphere: 0.5 dB of its area for 10 x 6",
    )
    law(
        f"The same: standard deviation from aspect to aspect, {sides} x {rows} at {range_m:g} m",
        source="a sphere has no aspects",
        expected=0.0,
        simulated=float(np.std(decibel(each))),
        tolerance=0.6,
        unit="dB",
        why="some ten rays hit it at 80 m; five aspects averaged",
    )


@pytest.mark.parametrize(("aspect_deg", "radii_m"), [(0.0, (0.5, 0.25, 0.6)), (90.0, (0.25, 0.5, 0.6))])
def test_ellipsoid_has_the_cross_section_of_its_radii_of_curvature(
    aspect_deg: float, radii_m: tuple[float, float, float], law: LawRecorder
) -> None:
    body = prototype("egg", "target", {"metal": ellipsoid((0.5, 0.25, 0.6), sides=16, rows=10)})
    found = cross_sections_m2(body, (aspect_deg,), range_m=40.0, rays=1024, bounces=1)[0]
    along, across, up = radii_m
    # Radii of curvature at the end of an axis a: b^2 / a and c^2 / a; the diffuse part is that of a sphere of
    # the same outline.
    diffuse = (1 - MIRROR) * 8 / 3 * across * up
    law(
        f"Metal ellipsoid of 0.5 x 0.25 x 0.6 m from {aspect_deg:g} deg at 40 m",
        source="pi rho_1 rho_2 = pi b^2 c^2 / a^2, Knott, Radar Cross Section, 2012",
        expected=float(decibel(math.pi * (MIRROR * (across * up / along) ** 2 + diffuse))),
        simulated=float(decibel(found)),
        tolerance=1.0,
        unit="dBsm",
        why="facets of 16 x 10: 0.5 dB; mean over 3 deg",
    )


ROAD_USERS = [
    ("car_saloon", "from the front", (0,), 15.0, 5.0, "3GPP TR 38.901 V19.4, Table 7.9.2.1-4: 15.5; 10-20"),
    ("car_saloon", "from the rear", (180,), 15.0, 5.0, "3GPP TR 38.901 V19.4, Table 7.9.2.1-4: 14.6; 10-20"),
    ("car_saloon", "from the side", (90,), 20.8, 4.0, "3GPP TR 38.901 V19.4, Table 7.9.2.1-4"),
    ("car_saloon", "20-40 deg from the front", (20, 30, 40), 0.0, 5.0, "-5 to 5 at 77 GHz; 3GPP: 7"),
]


@pytest.mark.parametrize("range_m", [20.0, 40.0])
@pytest.mark.parametrize(("name", "where", "aspects_deg", "dbsm", "tolerance_db", "source"), ROAD_USERS)
def test_road_user_has_its_measured_cross_section(
    name: str,
    where: str,
    aspects_deg: tuple[float, ...],
    dbsm: float,
    tolerance_db: float,
    source: str,
    range_m: float,
    law: LawRecorder,
) -> None:
    found = cross_sections_m2(PROTOTYPES[name], aspects_deg, range_m=range_m, bounces=1)
    law(
        f"{name} {where} at {range_m:g} m",
        source=source,
        expected=dbsm,
        simulated=float(decibel(found.mean())),
        tolerance=tolerance_db,
        unit="dBsm",
        why="published values of different cars and methods spread by as much",
    )


AROUND_DEG = (0, 30, 60, 90, 120, 150, 180)
"""Aspects of one side; the other is alike."""


@pytest.mark.parametrize(
    ("name", "dbsm", "tolerance_db", "source"),
    [
        ("cyclist_upright", -1.5, 1.7, "-3 to 0 at 76-79 GHz"),
        ("pedestrian_walking", -8.0, 2.0, "about -8 at 77 GHz, between methods -10 to -1"),
    ],
)
def test_rider_and_walker_have_their_measured_cross_sections(
    name: str, dbsm: float, tolerance_db: float, source: str, law: LawRecorder
) -> None:
    found = cross_sections_m2(PROTOTYPES[name], AROUND_DEG, range_m=20.0, bounces=1)
    law(
        f"{name} at 20 m, mean over aspects",
        source=source,
        expected=dbsm,
        simulated=float(decibel(found.mean())),
        tolerance=tolerance_db,
        unit="dBsm",
        why="published values of different persons spread by as much",
    )


@pytest.mark.parametrize("name", ["car_saloon", "cyclist_upright", "pedestrian_walking"])
def test_cross_section_is_steady_over_range(name: str, law: LawRecorder) -> None:
    # Beyond 20 deg from the normals of the long sides, whose Fresnel zones change with range.
    aspects_deg = (30, 60, 120, 150)
    near, far = (
        cross_sections_m2(PROTOTYPES[name], aspects_deg, range_m=range_m, bounces=1)
        for range_m in (10.0, 80.0)
    )
    law(
        f"{name}: cross-section at 10 m over that at 80 m, 30 to 150 deg",
        source="a cross-section is that of the object",
        expected=0.0,
        simulated=float(np.mean(decibel(near / far))),
        tolerance=3.0,
        unit="dB",
        why="a car of 4.6 m is seen from other sides at 10 m; few rays hit it at 80 m",
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", ["car_hatchback", "car_saloon", "car_estate", "car_suv"])
def test_no_aspect_of_a_car_is_dark(name: str) -> None:
    aspects_deg = tuple(range(0, 181, 10))
    by_range = [cross_sections_m2(PROTOTYPES[name], aspects_deg, range_m=each) for each in (10.0, 40.0)]
    level = decibel(np.array(by_range))
    assert level.min() > -5
    oblique = [
        index for index, aspect in enumerate(aspects_deg) if abs(aspect - 90) > 25 and 15 < aspect < 165
    ]
    assert np.abs(np.diff(level[:, oblique], axis=0)).mean() < 3
