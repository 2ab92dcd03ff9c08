"""What a sensor can reach on its way stays in the scene, whatever its shape; all else may go."""

import itertools
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from numpy.typing import NDArray

from echoscape.scenes.core.scene import Placements, Scene, StaticMesh
from echoscape.scenes.core.surroundings import Area, reached_area, surroundings
from echoscape.scenes.core.trajectory import Trajectory
from echoscape.scenes.town.build import build_town
from tests.sim.worlds import box_prototype

COORDINATES = st.floats(-100, 100)


def triangles(seed: int, count: int = 200) -> StaticMesh:
    """Triangles of 0.1 to 100 m about random places, some of their corners shared."""
    rng = np.random.default_rng(seed)
    size = 10 ** rng.uniform(-1, 2, (count, 1, 1))
    corners = rng.uniform(-100, 100, (count, 1, 3)) + size * rng.uniform(-1, 1, (count, 3, 3))
    faces = np.arange(3 * count, dtype=np.uint32).reshape(count, 3)
    faces[::7, 0] = faces[1, 0]
    return StaticMesh(
        vertices=corners.reshape(-1, 3).astype(np.float32),
        faces=faces,
        instance=np.arange(count, dtype=np.uint32),
        normals=rng.normal(size=(count, 3, 3)).astype(np.float32),
    )


@lru_cache(maxsize=1)
def empty() -> Scene:
    return build_town("empty", seed=0)


def scene_of(mesh: StaticMesh, **changes: Any) -> Scene:
    return replace(empty(), static={"brick": mesh}, **changes)


def inside(points: NDArray[np.floating], area: Area) -> NDArray[np.bool_]:
    x, y = points[..., 0], points[..., 1]
    return (x >= area[0]) & (x <= area[2]) & (y >= area[1]) & (y <= area[3])


@settings(deadline=None)  # the first one builds a world
@given(seed=st.integers(0, 1000), x=COORDINATES, y=COORDINATES, size=st.floats(0.1, 80))
def test_every_face_with_a_point_in_the_area_stays_as_it_is(
    seed: int, x: float, y: float, size: float
) -> None:
    mesh, area = triangles(seed), (x, y, x + size, y + size / 2)
    kept = surroundings(scene_of(mesh), area).static["brick"]
    corners = mesh.vertices[mesh.faces]
    assert_array_equal(kept.vertices[kept.faces], corners[kept.instance])
    assert kept.normals is not None
    assert mesh.normals is not None
    assert_array_equal(kept.normals, mesh.normals[kept.instance])
    assert np.all(np.diff(kept.instance.astype(int)) > 0)
    weights = np.random.default_rng(seed).dirichlet([0.5] * 3, 300)
    touching = inside(np.einsum("wc,fcx->fwx", weights, corners.astype(np.float64)), area).any(axis=1)
    assert set(np.flatnonzero(touching)) <= set(kept.instance.tolist())
    assert len(np.unique(kept.faces)) == len(kept.vertices)


def test_faces_beyond_one_side_go() -> None:
    mesh = triangles(3)
    area = (-20.0, -10.0, 10.0, 20.0)
    kept = surroundings(scene_of(mesh), area).static["brick"]
    low, high = (getattr(mesh.vertices[mesh.faces][..., :2], name)(axis=1) for name in ("min", "max"))
    touching = np.all((high >= area[:2]) & (low <= area[2:]), axis=1)
    assert 10 < touching.sum() < 150
    assert_array_equal(kept.instance, np.flatnonzero(touching))


@settings(deadline=None)
@given(x=COORDINATES, y=COORDINATES, yaw=st.floats(-4, 4), scale=st.floats(0.2, 3))
def test_a_placement_that_touches_the_area_stays(x: float, y: float, yaw: float, scale: float) -> None:
    prototype = box_prototype("box", (8.0, 2.0, 1.0), "metal")
    placements = Placements(
        prototype=np.zeros(1, np.uint32),
        instance=np.ones(1, np.uint32),
        position=np.array([[x, y, 0.0]]),
        yaw=np.array([yaw]),
        scale=np.array([scale]),
    )
    area = (-30.0, -20.0, 20.0, 30.0)
    scene = scene_of(triangles(0), prototypes=(prototype,), placements=placements)
    kept = surroundings(scene, area).placements
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    along = np.linspace(0, 1, 30)[:, None]
    corners = np.array([[4, 1], [-4, 1], [-4, -1], [4, -1], [4, 1]])
    outline = np.concatenate([a + along * (b - a) for a, b in itertools.pairwise(corners)])
    if inside(scale * outline @ turn.T + [x, y], area).any():
        assert len(kept.prototype) == 1
    middle = np.clip([x, y], area[:2], area[2:])
    if np.hypot(*(middle - [x, y])) > 1.5 * scale * np.hypot(4, 1):
        assert len(kept.prototype) == 0


@given(st.lists(st.tuples(*[COORDINATES] * 4), min_size=2, max_size=6), st.floats(0, 50))
def test_the_area_holds_the_whole_motion_and_what_is_in_reach(knots: list, reach_m: float) -> None:
    count = len(knots)
    place, rate = np.zeros((count, 4)), np.zeros((count, 4))
    place[:, :2], rate[:, :2] = np.array(knots)[:, :2], np.array(knots)[:, 2:]
    track = Trajectory(time_s=2.0 * np.arange(count, dtype=np.float64), state=place, rate=rate)
    x0, y0, x1, y1 = reached_area(track, reach_m=reach_m)
    poses = track.pose(np.linspace(-1, 2 * count, 500))[:, :2]
    assert np.all(poses.min(axis=0) - reach_m >= [x0 - 1e-9, y0 - 1e-9])
    assert np.all(poses.max(axis=0) + reach_m <= [x1 + 1e-9, y1 + 1e-9])


def test_the_area_of_an_object_at_rest_is_a_square_of_twice_the_reach() -> None:
    state = np.tile([3.0, -4.0, 0.0, 1.0], (2, 1))
    track = Trajectory(time_s=np.array([0.0, 9.0]), state=state, rate=np.zeros((2, 4)))
    assert reached_area(track, reach_m=10.0) == pytest.approx((-7.0, -14.0, 13.0, 6.0))


def test_what_the_area_holds_whole_is_not_copied() -> None:
    scene = scene_of(triangles(1))
    assert surroundings(scene, (-1e4, -1e4, 1e4, 1e4)).static["brick"] is scene.static["brick"]
    nothing = surroundings(scene, (5e3, 5e3, 6e3, 6e3)).static["brick"]
    assert nothing.faces.shape == (0, 3)
    assert nothing.vertices.shape == (0, 3)
