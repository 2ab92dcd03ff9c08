"""The lobe of a ray on a curved surface: widths by the footprint, and the energy that it holds."""

import math

import numpy as np
import pytest

from echoscape.scenes.core.materials import MATERIAL_NAMES
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.raytracing.surface.curvature import MOST_VARIANCE, slope_spread
from echoscape.sim.raytracing.surface.scattering import Surfaces

CARRIER_HZ, WAVELENGTH_M = 76.5e9, 299792458 / 76.5e9


def spread_of(normal: np.ndarray, bend: np.ndarray, half: np.ndarray, footprint_m2: float):
    """The spread of slopes for a derivative of the normal by place (3, 3) [1/m]."""
    c = bend @ bend.T
    return slope_spread(
        mi.Vector3f(*(float(c[k, k]) for k in range(3))),
        mi.Vector3f(float(c[0, 1]), float(c[0, 2]), float(c[1, 2])),
        mi.Vector3f(*normal.tolist()),
        mi.Vector3f(*half.T.tolist()),
        mi.Float(footprint_m2),
    )


@pytest.mark.parametrize("normal", [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (0.6, -0.64, 0.48)])
def test_normals_of_a_sphere_turn_by_the_footprint_over_its_radius(normal: tuple[float, ...]) -> None:
    n, radius_m, side_m = np.array(normal), 0.5, 0.1
    bend = (np.eye(3) - np.outer(n, n)) / radius_m
    found = spread_of(n, bend, n[None], side_m**2)
    # A Gaussian of half the side of the footprint, over the radius.
    expected = (side_m / 2 / radius_m) ** 2
    np.testing.assert_allclose([found.variance_u[0], found.variance_v[0]], expected, rtol=1e-5)
    np.testing.assert_allclose(found.covariance[0], 0.0, atol=1e-7)


def test_normals_of_a_cylinder_turn_in_one_direction_only() -> None:
    n, axis = np.array([0.8, 0.6, 0.0]), np.array([0.0, 0.0, 1.0])
    around = np.cross(axis, n)
    found = spread_of(n, np.outer(around, around) / 0.2, n[None], 0.05**2)
    total = np.array([[found.variance_u[0], found.covariance[0]], [found.covariance[0], found.variance_v[0]]])
    np.testing.assert_allclose(np.linalg.eigvalsh(total), [0.0, (0.05 / 2 / 0.2) ** 2], atol=1e-7)


def test_spread_of_a_wide_footprint_is_bounded() -> None:
    n = np.array([0.0, 0.6, 0.8])
    found = spread_of(n, (np.eye(3) - np.outer(n, n)) / 0.01, n[None], 1.0)
    np.testing.assert_allclose(found.variance_u[0] + found.variance_v[0], MOST_VARIANCE, rtol=1e-5)


@pytest.mark.parametrize("footprint_m2", [0.0, 0.01])
def test_lobe_of_a_curved_surface_holds_its_share(footprint_m2: float) -> None:
    # Head on: the integral of D(h) / (4 cos_out) cos_out over the exit directions, in slopes x, y of the half
    # vector: dw_out = 4 cos_half dw_half, dw_half = cos_half^3 dx dy.
    x, y = np.meshgrid(np.linspace(-1.2, 1.2, 481), np.linspace(-1.2, 1.2, 481))
    half = np.stack([x.ravel(), y.ravel(), np.ones(x.size)], axis=1)
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    bend = np.array([[2.0, 0.5, 0.0], [0.3, 1.0, 0.0], [0.0, 0.0, 0.0]])
    spread = spread_of(np.array([0.0, 0.0, 1.0]), bend, half, footprint_m2)
    cos_half = mi.Float(half[:, 2].astype(np.float32))
    cos_out = dr.maximum(2 * dr.square(cos_half) - 1, 1e-3)
    material = dr.full(mi.UInt32, MATERIAL_NAMES.index("fittings"), x.size)
    lobe = Surfaces(CARRIER_HZ, WAVELENGTH_M).mirror_lobe(
        material, cos_half, mi.Float(1.0), cos_out, dr.full(mi.Bool, True, x.size), spread
    )
    share = lobe * cos_out * 4 * dr.square(dr.square(cos_half))
    assert math.isclose(float(np.sum(share.numpy())) * (2.4 / 480) ** 2, 1.0, rel_tol=0.02)
