"""Walls and fences: size, material and openings."""

import numpy as np
import pytest

from echoscape.scenes.assets.walls_fences import FenceKind, fence, wall
from echoscape.scenes.geometry.meshes import areas


def test_wall_keeps_to_its_height_and_line() -> None:
    part = wall(np.array([[0.0, 0.0], [10.0, 0.0]]), height_m=1.2, thickness_m=0.22)
    low, high = part.vertices.min(axis=0), part.vertices.max(axis=0)
    np.testing.assert_allclose([low[2], high[2]], [0.0, 1.27], atol=1e-6)
    assert np.abs(part.vertices[:, 1]).max() < 0.22
    assert areas(part.vertices, part.faces).min() > 1e-4


@pytest.mark.parametrize(
    ("kind", "material"), [("boards", "wood"), ("railing", "metal"), ("chain_link", "metal")]
)
def test_fences_are_of_their_material_and_let_rays_through_where_open(kind: FenceKind, material: str) -> None:
    parts = fence(np.array([[0.0, 0.0], [9.0, 0.0], [9.0, 5.0]]), height_m=1.5, kind=kind)
    assert set(parts) == {material}
    assert parts[material].vertices[:, 2].max() < 1.6
    facing = areas(parts[material].vertices, parts[material].faces).sum()
    assert (facing > 40.0) == (kind == "boards")
