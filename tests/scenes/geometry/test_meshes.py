"""Moving, mirroring and joining keep volume, orientation and normals."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from echoscape.scenes.geometry.meshes import merge, mirrored, moved
from echoscape.scenes.geometry.primitives import box, ellipsoid
from tests.scenes.geometry.solids import as_trimesh


@given(yaw=st.floats(-np.pi, np.pi), x=st.floats(-50, 50))
@settings(max_examples=30, deadline=None)
def test_moving_and_mirroring_keep_volume_and_outside(yaw: float, x: float) -> None:
    turned = moved(box((1, 2, 3)), (x, 0, 0), yaw_rad=yaw)
    for part in (turned, mirrored(turned)):
        np.testing.assert_allclose(as_trimesh(part).volume, 6.0, rtol=1e-4)


def test_merge_keeps_every_face_and_dtype() -> None:
    merged = merge([box((1, 1, 1)), box((1, 1, 1), (5, 0, 0))])
    assert merged.vertices.dtype == np.float32
    assert merged.faces.dtype == np.uint32
    np.testing.assert_allclose(as_trimesh(merged).volume, 2.0)


@pytest.mark.parametrize("change", ["moved", "mirrored", "merged"])
def test_normals_follow_their_faces(change: str) -> None:
    ball = ellipsoid((0.5, 0.4, 0.3), sides=18, rows=10)
    turn = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    changed = {
        "moved": lambda: moved(ball, (1, 2, 3), yaw_rad=0.6, rotation=turn),
        "mirrored": lambda: mirrored(ball),
        "merged": lambda: merge([box((1, 1, 1)), ball]),
    }[change]()
    assert changed.normals is not None
    assert len(changed.normals) == len(changed.faces)
    curved = changed.normals.any(axis=(1, 2))
    assert curved.sum() == len(ball.faces)
    corners = changed.vertices[changed.faces].astype(np.float64)
    plane = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[curved]
    plane /= np.linalg.norm(plane, axis=1, keepdims=True)
    # Normals at the corners of a facet lie around that of its plane.
    assert np.sum(changed.normals[curved].mean(axis=1) * plane, axis=1).min() > 0.85
