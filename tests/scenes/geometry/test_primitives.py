"""Solids: volume, orientation and normals."""

import numpy as np
import pytest

from echoscape.scenes.geometry.primitives import box, cylinder, ellipsoid, prism, tube
from tests.scenes.geometry.solids import as_trimesh

L_SHAPE = np.array([[0, 0], [3, 0], [3, 1], [1, 1], [1, 2], [0, 2.0]])  # area 4

CLOSED = {
    "box": (box((1, 2, 3), (4, 5, 6)), 6.0),
    "prism": (prism(L_SHAPE, bottom_m=1.0, top_m=3.0), 8.0),
    "cylinder": (cylinder(2.0, 3.0, sides=6), 3 * 1.5 * np.sqrt(3) * 4),
    "cone": (cylinder(2.0, 3.0, sides=6, top_radius_m=0.0), 1.5 * np.sqrt(3) * 4),
    "tube": (tube((1, 2, 3), (4, 6, 3), 0.5, sides=4), 5 * 2 * 0.25),
}


@pytest.mark.parametrize("name", CLOSED)
def test_closed_solids_face_outwards_and_hold_their_volume(name: str) -> None:
    part, volume = CLOSED[name]
    solid = as_trimesh(part)
    assert solid.is_volume
    np.testing.assert_allclose(solid.volume, volume, rtol=1e-5)  # float32 vertices


def test_ellipsoid_faces_outwards_and_nears_its_volume() -> None:
    solid = as_trimesh(ellipsoid((1, 2, 3), (5, 5, 5), sides=40, rows=40))
    assert solid.is_volume
    np.testing.assert_allclose(solid.volume, 4 / 3 * np.pi * 6, rtol=0.02)  # inscribed facets


def test_sides_of_a_tube_are_round_and_its_ends_flat() -> None:
    cone = tube((0, 0, 0), (0, 0, 2), 0.5, 0.3, sides=7)
    assert cone.normals is not None
    ends = ~cone.normals.any(axis=(1, 2))
    assert ends.sum() == 2 * 5
    corners, normals = cone.vertices[cone.faces][~ends], cone.normals[~ends]
    outwards = np.stack([corners[..., 0], corners[..., 1], np.zeros(corners.shape[:2])], axis=2)
    outwards /= np.linalg.norm(outwards, axis=2, keepdims=True)
    # The slant of the wall, 0.2 m in 2 m, tilts the normals up by atan(0.1).
    expected = (outwards + np.array([0.0, 0.0, 0.1])) / np.sqrt(1.01)
    np.testing.assert_allclose(normals, expected, atol=1e-5)
