"""Overlaps of moving boxes, against sampled points."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from echoscape.scenes.core.scene import Mover, Prototype
from echoscape.scenes.core.trajectory import Trajectory
from echoscape.scenes.driving.ego_drive import EGO_EXTENT_M
from echoscape.scenes.traffic.collisions import boxes_touch, overlaps


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_boxes_touch_as_sampled_points_do(seed: int) -> None:
    rng = np.random.default_rng(seed)
    pose = np.column_stack([rng.uniform(-4, 4, (2, 2)), rng.uniform(-4, 4, 2)])
    extent = rng.uniform(1, 5, (2, 2))
    share = np.stack(np.meshgrid(*[np.linspace(-0.5, 0.5, 60)] * 2), -1).reshape(-1, 2)

    def corners(box: int) -> np.ndarray:
        cos, sin = np.cos(pose[box, 2]), np.sin(pose[box, 2])
        return pose[box, :2] + (share * extent[box]) @ np.array([[cos, sin], [-sin, cos]])

    def holds(box: int, points: np.ndarray, slack: float) -> bool:
        cos, sin = np.cos(pose[box, 2]), np.sin(pose[box, 2])
        local = (points - pose[box, :2]) @ np.array([[cos, -sin], [sin, cos]])
        return bool((np.abs(local) <= extent[box] / 2 + slack).all(axis=-1).any())

    touch = bool(boxes_touch(pose[:1], extent[:1], pose[1:], extent[1:])[0])
    if holds(0, corners(1), 0.0):
        assert touch
    if touch:
        assert holds(0, corners(1), 0.1)  # the grid of points is 0.085 m at its widest


def test_overlaps_finds_the_time_at_which_two_boxes_meet(boxes: tuple[Prototype, ...]) -> None:
    still = np.zeros((2, 4))
    ego = Trajectory(time_s=np.array([0.0, 10.0]), state=still, rate=still)
    coming = np.array([[50.0, 0, 0, 0], [-50.0, 0, 0, 0]])
    track = Trajectory(
        time_s=np.array([0.0, 10.0]), state=coming, rate=np.array([[-10.0, 0, 0, 0], [-10.0, 0, 0, 0]])
    )
    car = Mover(instance=1, prototype=boxes[0], track=track)
    found = overlaps(ego, [car], ego_extent_m=EGO_EXTENT_M, duration_s=10.0)
    # Bumpers meet when the middles are (4.8 + 4.4) / 2 = 4.6 m apart: at 4.54 s, and part at 5.46 s.
    assert_allclose([found.time_s.min(), found.time_s.max()], [4.6, 5.4], atol=1e-9)
    assert set(found.first) == {-1}
    assert set(found.second) == {0}
