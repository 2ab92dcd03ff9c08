"""The plane of a map against the ellipsoid's own geometry: distances near the origin, and there and back."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from echoscape.scenes.io.osm.elements.projection import LocalProjection

A_M, F = 6_378_137.0, 1 / 298.257223563
E2 = F * (2 - F)
LATITUDE = st.floats(-80.0, 80.0)


def east_north(origin_deg: tuple[float, float], lat_deg: float, lon_deg: float) -> NDArray[np.float64]:
    """Return east and north (2,) in the plane that touches the ellipsoid at the origin [m]."""

    def cartesian(lat: float, lon: float) -> NDArray[np.float64]:
        radius = A_M / np.sqrt(1 - E2 * np.sin(lat) ** 2)
        flat = radius * np.cos(lat)
        return np.array([flat * np.cos(lon), flat * np.sin(lon), radius * (1 - E2) * np.sin(lat)])

    lat, lon = np.deg2rad(origin_deg)
    away = cartesian(*np.deg2rad([lat_deg, lon_deg])) - cartesian(lat, lon)
    east = np.array([-np.sin(lon), np.cos(lon), 0.0])
    north = np.array([-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)])
    return np.array([east @ away, north @ away])


@given(LATITUDE, st.floats(-179.0, 179.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_places_near_the_origin_are_east_and_north_of_it(
    lat: float, lon: float, up: float, right: float
) -> None:
    origin = (lat, lon)
    place = lat + 0.01 * up, lon + 0.01 * right / np.cos(np.deg2rad(lat))
    wanted = east_north(origin, *place)
    # The touching plane is shorter than the ellipsoid by d^3 / (6 R^2), 0.1 mm at 1.5 km; the conformal plane
    # bends by the same order.
    assert LocalProjection(origin_deg=origin).to_plane(*place) == pytest.approx(wanted, abs=2e-4)


@given(LATITUDE, st.floats(-180.0, 180.0), st.floats(-5e3, 5e3), st.floats(-5e3, 5e3))
def test_places_come_back(lat: float, lon: float, x: float, y: float) -> None:
    projection = LocalProjection(origin_deg=(lat, lon))
    there = projection.to_wgs84([x, y])
    assert projection.to_plane(*there) == pytest.approx([x, y], abs=1e-6)


def test_the_meridian_has_its_length() -> None:
    # A tenth of the way from the equator to the pole, by quadrature of the radius of curvature.
    lat = np.deg2rad(np.linspace(0.0, 9.0, 100_001))
    radius = A_M * (1 - E2) / (1 - E2 * np.sin(lat) ** 2) ** 1.5
    wanted = np.sum((radius[1:] + radius[:-1]) / 2 * np.diff(lat))
    found = LocalProjection(origin_deg=(0.0, 0.0)).to_plane(9.0, 0.0)
    assert found == pytest.approx([0.0, wanted], abs=1e-3)


def test_angles_are_kept_far_from_the_origin() -> None:
    # A conformal map has equal scales along both axes, which the touching plane lacks beyond some kilometres.
    projection = LocalProjection(origin_deg=(52.0, 0.0))
    lat, lon, step = 52.4, 1.5, 1e-5
    at = projection.to_plane(lat, lon)
    north = projection.to_plane(lat + step, lon) - at
    east = projection.to_plane(lat, lon + step) - at
    radius = A_M / np.sqrt(1 - E2 * np.sin(np.deg2rad(lat)) ** 2)
    scale_east = np.hypot(*east) / (np.deg2rad(step) * radius * np.cos(np.deg2rad(lat)))
    meridian = A_M * (1 - E2) / (1 - E2 * np.sin(np.deg2rad(lat)) ** 2) ** 1.5
    scale_north = np.hypot(*north) / (np.deg2rad(step) * meridian)
    assert scale_east == pytest.approx(scale_north, rel=1e-6)
    assert north @ east == pytest.approx(0.0, abs=1e-6)
