"""Normals where rays meet curved and flat faces of static, placed and moving objects."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from echoscape.scenes.core.scene import CLASSES, Mesh, Placements, Prototype, Scene
from echoscape.scenes.geometry.meshes import moved, prototype
from echoscape.scenes.geometry.primitives import box, ellipsoid
from echoscape.scenes.geometry.smooth_normals import smoothed
from echoscape.sim.kinematics.rolling_scan import MoverStates
from echoscape.sim.raytracing.intersection import Hits, RayScene
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.raytracing.mitsuba_scene import MitsubaScene
from tests.sim.worlds import mover, standing, world

RADIUS_M = 0.5
BALL = prototype("ball", "target", {"metal": ellipsoid((RADIUS_M,) * 3, sides=16, rows=10)})
CENTRE = np.array([7.0, 3.0, 0.6])
YAW, SCALE = 0.7, 1.3


def rays_towards(centre: NDArray[np.float64], radius_m: float) -> tuple[NDArray, NDArray]:
    """Origins and directions of rays from the origin that meet a ball at all places of its near side."""
    rng = np.random.default_rng(4)
    aim = centre + 0.9 * radius_m * rng.uniform(-0.55, 0.55, (400, 3))
    return np.zeros_like(aim), aim / np.linalg.norm(aim, axis=1, keepdims=True)


def hits_in(scene: Scene, origin: NDArray, direction: NDArray, movers=()) -> Hits:
    state = np.array([[each.track.pose(np.zeros(1))[0]] for each in movers]).reshape(len(movers), 1, 4)
    states = MoverStates(movers=tuple(movers), state=state, rate=np.zeros_like(state))
    return RayScene(MitsubaScene(scene, movers), states, 1).intersect(
        mi.Point3d(*origin.T),
        mi.Vector3d(*direction.T),
        dr.zeros(mi.UInt32, len(origin)),
        dr.full(mi.Float, 100.0, len(origin)),
        dr.full(mi.Bool, True, len(origin)),
    )


def placed(shape: Prototype) -> Scene:
    return Scene(
        **{
            **vars(world()),
            "prototypes": (shape,),
            "placements": Placements(
                prototype=np.zeros(1, np.uint32),
                instance=np.ones(1, np.uint32),
                position=CENTRE[None] - [0.0, 0.0, SCALE * RADIUS_M],
                yaw=np.array([YAW]),
                scale=np.array([SCALE]),
            ),
            "instance_class": np.array([0, CLASSES.index("target")], np.uint8),
        }
    )


def ball_hits(kind: str) -> tuple[Hits, NDArray, float]:
    """Hits on a ball that is a static mesh, a placement, or a moving object; directions; its radius."""
    radius_m = RADIUS_M * (SCALE if kind == "placed" else 1.0)
    origin, direction = rays_towards(CENTRE, radius_m)
    if kind == "static":
        still = moved(BALL.parts["metal"], (CENTRE - [0, 0, RADIUS_M]).tolist(), yaw_rad=YAW)
        return hits_in(world(("metal", "target", still)), origin, direction), direction, radius_m
    if kind == "placed":
        return hits_in(placed(BALL), origin, direction), direction, radius_m
    ride = standing(CENTRE[0], CENTRE[1], YAW)
    track = ride.trajectory
    track.state[:, 2] = CENTRE[2] - RADIUS_M
    return hits_in(world(), origin, direction, (mover(1, BALL, ride),)), direction, radius_m


@pytest.mark.parametrize("kind", ["static", "placed", "moving"])
def test_normals_of_a_faceted_ball_are_radial(kind: str) -> None:
    hits, _, radius_m = ball_hits(kind)
    active = hits.active.numpy()
    assert active.mean() > 0.9
    radial = (hits.point.numpy().T - CENTRE)[active]
    radial /= np.linalg.norm(radial, axis=1, keepdims=True)
    cosine = np.sum(hits.normal.numpy().T[active] * radial, axis=1)
    # Facets of 22 by 18 deg turn by up to 15 deg from corner to middle; interpolated normals by 1-2.
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).max() < 3.0
    # The trace of M M^T of a ball is 2 / r^2.
    trace = hits.curvature.numpy().T[active].sum(axis=1)
    assert abs(np.median(trace) / (2 / radius_m**2) - 1) < 0.25


def test_reflected_rays_leave_the_faces_of_a_coarse_ball() -> None:
    coarse = ellipsoid((RADIUS_M,) * 3, CENTRE.tolist(), sides=5, rows=3)
    origin, direction = rays_towards(CENTRE, 2 * RADIUS_M)
    smooth = hits_in(world(("metal", "target", coarse)), origin, direction)
    bare = Mesh(vertices=coarse.vertices, faces=coarse.faces)
    flat = hits_in(world(("metal", "target", bare)), origin, direction)
    active = smooth.active.numpy()
    np.testing.assert_array_equal(active, flat.active.numpy())
    normal, face = smooth.normal.numpy().T[active], flat.normal.numpy().T[active]
    incoming = direction[active]
    reflected = incoming - 2 * np.sum(incoming * normal, axis=1, keepdims=True) * normal
    assert np.sum(reflected * face, axis=1).min() > 0
    assert np.sum(incoming * normal, axis=1).max() < 0
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0, rtol=1e-6)
    np.testing.assert_array_equal(smooth.point.numpy(), flat.point.numpy())


def test_box_keeps_the_normals_of_its_faces() -> None:
    sides = smoothed(box((1.0, 1.0, 1.0), CENTRE.tolist()), crease_rad=math.radians(40))
    origin, direction = rays_towards(CENTRE, RADIUS_M)
    hits = hits_in(world(("metal", "wall", sides)), origin, direction)
    normal = hits.normal.numpy().T[hits.active.numpy()]
    assert set(np.round(np.abs(normal).max(axis=1), 9)) == {1.0}
    assert not hits.curvature.numpy().any()
    assert not hits.twist.numpy().any()


def test_a_moving_object_is_sought_within_its_sphere_only() -> None:
    # The shapes of moving objects stand side by side in a scene of their own. A ray over the low one goes on
    # to where the high one stands there, before or behind it, and meets neither.
    low = prototype("low", "car", {"metal": box((4.0, 4.0, 0.4))})
    high = prototype("high", "car", {"metal": box((4.0, 4.0, 6.0))})
    elsewhere = np.array([0.0, 80.0])
    for ahead, sign in (([10.0, 0.0], 1.0), ([80.0, 0.0], -1.0)):
        for shapes in ((low, high), (high, low)):
            places = [elsewhere if shape is high else ahead for shape in shapes]
            movers = [
                mover(5 + k, shape, standing(x=float(x), y=float(y), yaw=0.0 if sign > 0 else math.pi))
                for k, (shape, (x, y)) in enumerate(zip(shapes, places, strict=True))
            ]
            hits = hits_in(world(), np.array([[0.0, 0.0, 1.0]]), np.array([[1.0, 0.0, 0.0]]), movers)
            assert not hits.active.numpy().any()
