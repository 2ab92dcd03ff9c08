import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from echoscape.scenes.assets.walls_fences import FenceKind, fence, wall
from echoscape.scenes.core.scene import Mesh
from echoscape.scenes.geometry import primitives as solids

L_SHAPE = np.array([[0, 0], [3, 0], [3, 1], [1, 1], [1, 2], [0, 2.0]])  # area 4

CLOSED = {
    "box": (solids.box((1, 2, 3), (4, 5, 6)), 6.0),
    "prism": (solids.prism(L_SHAPE, bottom_m=1.0, top_m=3.0), 8.0),
    "cylinder": (solids.cylinder(2.0, 3.0, sides=6), 3 * 1.5 * np.sqrt(3) * 4),
    "cone": (solids.cylinder(2.0, 3.0, sides=6, top_radius_m=0.0), 1.5 * np.sqrt(3) * 4),
    "tube": (solids.tube((1, 2, 3), (4, 6, 3), 0.5, sides=4), 5 * 2 * 0.25),
}


def as_trimesh(part: Mesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(part.vertices.astype(np.float64), part.faces.astype(np.int64), process=True)


@pytest.mark.parametrize("name", CLOSED)
def test_closed_solids_face_outwards_and_hold_their_volume(name: str) -> None:
    part, volume = CLOSED[name]
    solid = as_trimesh(part)
    assert solid.is_volume
    np.testing.assert_allclose(solid.volume, volume, rtol=1e-5)  # float32 vertices


def test_ellipsoid_faces_outwards_and_nears_its_volume() -> None:
    solid = as_trimesh(solids.ellipsoid((1, 2, 3), (5, 5, 5), sides=40, rows=40))
    assert solid.is_volume
    np.testing.assert_allclose(solid.volume, 4 / 3 * np.pi * 6, rtol=0.02)  # inscribed facets


@given(yaw=st.floats(-np.pi, np.pi), x=st.floats(-50, 50))
@settings(max_examples=30, deadline=None)
def test_moving_and_mirroring_keep_volume_and_outside(yaw: float, x: float) -> None:
    moved = solids.moved(solids.box((1, 2, 3)), (x, 0, 0), yaw_rad=yaw)
    for part in (moved, solids.mirrored(moved)):
        np.testing.assert_allclose(as_trimesh(part).volume, 6.0, rtol=1e-4)


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
    corners = outline[solids.polygon_triangles(outline)]
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = 0.5 * (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    x, y = outline.T
    assert np.all(area > -1e-12)
    np.testing.assert_allclose(area.sum(), 0.5 * (x * np.roll(y, -1) - np.roll(x, -1) * y).sum(), rtol=1e-9)


def test_merge_keeps_every_face_and_dtype() -> None:
    merged = solids.merge([solids.box((1, 1, 1)), solids.box((1, 1, 1), (5, 0, 0))])
    assert merged.vertices.dtype == np.float32
    assert merged.faces.dtype == np.uint32
    np.testing.assert_allclose(as_trimesh(merged).volume, 2.0)


def test_wall_keeps_to_its_height_and_line() -> None:
    part = wall(np.array([[0.0, 0.0], [10.0, 0.0]]), height_m=1.2, thickness_m=0.22)
    low, high = part.vertices.min(axis=0), part.vertices.max(axis=0)
    np.testing.assert_allclose([low[2], high[2]], [0.0, 1.27], atol=1e-6)
    assert np.abs(part.vertices[:, 1]).max() < 0.22
    assert solids.areas(part.vertices, part.faces).min() > 1e-4


@pytest.mark.parametrize(
    ("kind", "material"), [("boards", "wood"), ("railing", "metal"), ("chain_link", "metal")]
)
def test_fences_are_of_their_material_and_let_rays_through_where_open(kind: FenceKind, material: str) -> None:
    parts = fence(np.array([[0.0, 0.0], [9.0, 0.0], [9.0, 5.0]]), height_m=1.5, kind=kind)
    assert set(parts) == {material}
    assert parts[material].vertices[:, 2].max() < 1.6
    facing = solids.areas(parts[material].vertices, parts[material].faces).sum()
    assert (facing > 40.0) == (kind == "boards")


def test_normals_of_smoothed_facets_are_those_of_the_sphere() -> None:
    facets = solids.ellipsoid((0.5, 0.5, 0.5), sides=16, rows=12)
    found = solids.smoothed(Mesh(vertices=facets.vertices, faces=facets.faces), crease_rad=np.radians(40))
    corners = facets.vertices[facets.faces] / 0.5
    assert found.normals is not None
    assert facets.normals is not None
    cosine = np.sum(found.normals * corners, axis=2)
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).max() < 6.0
    np.testing.assert_allclose(np.sum(facets.normals * corners, axis=2), 1.0, atol=1e-5)


@pytest.mark.parametrize("crease_deg", [40.0, 89.0])
def test_smoothing_leaves_a_box_flat(crease_deg: float) -> None:
    found = solids.smoothed(solids.box((1.0, 2.0, 3.0)), crease_rad=np.radians(crease_deg))
    assert found.normals is not None
    assert not found.normals.any()


def test_sides_of_a_tube_are_round_and_its_ends_flat() -> None:
    cone = solids.tube((0, 0, 0), (0, 0, 2), 0.5, 0.3, sides=7)
    assert cone.normals is not None
    ends = ~cone.normals.any(axis=(1, 2))
    assert ends.sum() == 2 * 5
    corners, normals = cone.vertices[cone.faces][~ends], cone.normals[~ends]
    outwards = np.stack([corners[..., 0], corners[..., 1], np.zeros(corners.shape[:2])], axis=2)
    outwards /= np.linalg.norm(outwards, axis=2, keepdims=True)
    # The slant of the wall, 0.2 m in 2 m, tilts the normals up by atan(0.1).
    expected = (outwards + np.array([0.0, 0.0, 0.1])) / np.sqrt(1.01)
    np.testing.assert_allclose(normals, expected, atol=1e-5)


@pytest.mark.parametrize("change", ["moved", "mirrored", "merged"])
def test_normals_follow_their_faces(change: str) -> None:
    ball = solids.ellipsoid((0.5, 0.4, 0.3), sides=18, rows=10)
    turn = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    changed = {
        "moved": lambda: solids.moved(ball, (1, 2, 3), yaw_rad=0.6, rotation=turn),
        "mirrored": lambda: solids.mirrored(ball),
        "merged": lambda: solids.merge([solids.box((1, 1, 1)), ball]),
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
