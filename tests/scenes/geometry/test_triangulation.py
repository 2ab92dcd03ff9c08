"""Ear clipping."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from echoscape.scenes.geometry.triangulation import polygon_triangles


@given(
    angles=st.lists(st.floats(0.1, 1.0), min_size=4, max_size=9),
    radii=st.lists(st.floats(0.3, 1.0), min_size=9, max_size=9),
)
@settings(max_examples=50, deadline=None)
def test_ear_clipping_fills_star_shaped_polygons_exactly(angles: list[float], radii: list[float]) -> None:
    turn = 2 * np.pi * np.cumsum(angles) / np.sum(angles)
    if np.diff(np.r_[0.0, turn]).max() > 0.9 * np.pi:
        return
    outline = np.array(radii[: len(angles)])[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    corners = outline[polygon_triangles(outline)]
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = 0.5 * (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    x, y = outline.T
    assert np.all(area > -1e-12)
    np.testing.assert_allclose(area.sum(), 0.5 * (x * np.roll(y, -1) - np.roll(x, -1) * y).sum(), rtol=1e-9)
