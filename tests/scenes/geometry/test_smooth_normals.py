"""Normals of smoothed facets."""

import numpy as np
import pytest

from echoscape.scenes.core.scene import Mesh
from echoscape.scenes.geometry.primitives import box, ellipsoid
from echoscape.scenes.geometry.smooth_normals import smoothed


def test_normals_of_smoothed_facets_are_those_of_the_sphere() -> None:
    facets = ellipsoid((0.5, 0.5, 0.5), sides=16, rows=12)
    found = smoothed(Mesh(vertices=facets.vertices, faces=facets.faces), crease_rad=np.radians(40))
    corners = facets.vertices[facets.faces] / 0.5
    assert found.normals is not None
    assert facets.normals is not None
    cosine = np.sum(found.normals * corners, axis=2)
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).max() < 6.0
    np.testing.assert_allclose(np.sum(facets.normals * corners, axis=2), 1.0, atol=1e-5)


@pytest.mark.parametrize("crease_deg", [40.0, 89.0])
def test_smoothing_leaves_a_box_flat(crease_deg: float) -> None:
    found = smoothed(box((1.0, 2.0, 3.0)), crease_rad=np.radians(crease_deg))
    assert found.normals is not None
    assert not found.normals.any()
