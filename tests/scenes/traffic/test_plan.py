"""Traffic keeps to its lanes and speed limits, and no two boxes ever overlap."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial import KDTree

from echoscape.scenes.core.lane_graph import RoadGraph
from echoscape.scenes.core.scene import Mover, Prototype, Scene
from echoscape.scenes.driving.ego_drive import EGO_EXTENT_M, EgoDrive, plan_ego_drive
from echoscape.scenes.traffic.collisions import overlaps
from echoscape.scenes.traffic.plan import TrafficSettings, plan_traffic

BareTown = Callable[[RoadGraph], Scene]


DENSE = TrafficSettings(vehicles_per_km2=70.0, pedestrians_per_km2=60.0)


@pytest.fixture(scope="module")
def scene(
    blocks: RoadGraph, bare_town: BareTown, boxes: tuple[Prototype, ...]
) -> tuple[EgoDrive, tuple[Mover, ...]]:
    drive = plan_ego_drive(blocks, seed=11, duration_s=150)
    return drive, plan_traffic(bare_town(blocks), drive, seed=11, settings=DENSE, prototypes=boxes)


def _vehicles(movers: tuple[Mover, ...]) -> list[Mover]:
    return [mover for mover in movers if mover.prototype.class_name != "pedestrian"]


def _removed(caplog: pytest.LogCaptureFixture) -> int:
    messages = [record.getMessage() for record in caplog.records]
    return sum(int(message.split()[1]) for message in messages if message.startswith("removed"))


@pytest.mark.parametrize("seed", range(4))
def test_no_two_movers_touch(
    blocks: RoadGraph,
    bare_town: BareTown,
    boxes: tuple[Prototype, ...],
    caplog: pytest.LogCaptureFixture,
    seed: int,
) -> None:
    drive = plan_ego_drive(blocks, seed=seed, duration_s=120)
    with caplog.at_level("INFO"):
        movers = plan_traffic(bare_town(blocks), drive, seed=seed, settings=DENSE, prototypes=boxes)
    assert _removed(caplog) <= 1  # by keeping clear, not by being taken out
    found = overlaps(drive, movers, ego_extent_m=EGO_EXTENT_M, duration_s=120.0)
    assert len(movers) > 20
    assert len(found) == 0


@pytest.mark.parametrize("seed", range(2))
def test_few_movers_are_removed_in_a_real_town(
    town_roads: RoadGraph, bare_town: BareTown, caplog: pytest.LogCaptureFixture, seed: int
) -> None:
    drive = plan_ego_drive(town_roads, seed=seed, duration_s=300)
    with caplog.at_level("INFO"):
        movers = plan_traffic(bare_town(town_roads), drive, seed=seed)
    assert len(movers) >= 8
    assert _removed(caplog) <= 0.1 * len(movers)


def test_vehicles_keep_to_their_lanes_and_below_the_limit(
    scene: tuple[EgoDrive, tuple[Mover, ...]], blocks: RoadGraph
) -> None:
    drive, movers = scene
    centres = KDTree(np.concatenate([lane.centre for lane in blocks.lanes]))
    time = np.arange(0, drive.duration_s, 0.5)
    for mover in _vehicles(movers):
        off, _ = centres.query(mover.track.pose(time)[:, :2])
        # Both axles are on the line: the middle of a long one cuts bends by (0.3 length)^2 / (2 radius).
        assert off.max() < 0.6 + (0.3 * mover.prototype.extent_m[0]) ** 2 / (2 * 6.0)
        assert np.hypot(*mover.track.velocity(time)[:, :2].T).max() < 13.4 + 1e-6
        assert_allclose(mover.track.pose(time)[:, 2], 0.0)


def test_vehicles_move_along_their_heading(scene: tuple[EgoDrive, tuple[Mover, ...]]) -> None:
    drive, movers = scene
    time = np.arange(0.05, drive.duration_s, 0.5)
    for mover in _vehicles(movers):
        velocity, yaw = mover.track.velocity(time), mover.track.pose(time)[:, 3]
        moving = np.hypot(*velocity[:, :2].T) > 1
        course = np.arctan2(velocity[moving, 1], velocity[moving, 0])
        assert np.abs(np.angle(np.exp(1j * (course - yaw[moving])))).max() < 0.2


def test_velocity_of_movers_is_the_derivative_of_their_pose(
    scene: tuple[EgoDrive, tuple[Mover, ...]],
) -> None:
    drive, movers = scene
    time = np.linspace(0.05, drive.duration_s - 0.05, 400)
    for mover in movers:
        slope = (mover.track.pose(time + 1e-4) - mover.track.pose(time - 1e-4)) / 2e-4
        assert_allclose(slope, mover.track.velocity(time), atol=5e-3)


def test_most_traffic_moves(scene: tuple[EgoDrive, tuple[Mover, ...]]) -> None:
    drive, movers = scene
    time = np.arange(0, drive.duration_s, 1.0)
    speed = [np.hypot(*mover.track.velocity(time)[:, :2].T).mean() for mover in _vehicles(movers)]
    assert np.median(speed) > 3.0


def test_instances_follow_the_towns_and_do_not_repeat(
    scene: tuple[EgoDrive, tuple[Mover, ...]], blocks: RoadGraph, bare_town: BareTown
) -> None:
    _, movers = scene
    first = len(bare_town(blocks).instance_class)
    assert [mover.instance for mover in movers] == list(range(first, first + len(movers)))


def test_same_seed_same_traffic(blocks: RoadGraph, bare_town: BareTown, boxes: tuple[Prototype, ...]) -> None:
    drive = plan_ego_drive(blocks, seed=1, duration_s=20)
    runs = [
        plan_traffic(bare_town(blocks), drive, seed=seed, settings=DENSE, prototypes=boxes)
        for seed in (1, 1, 2)
    ]
    states = [b"".join(mover.track.state.tobytes() for mover in movers) for movers in runs]
    assert states[0] == states[1]
    assert states[0] != states[2]


@pytest.mark.slow
def test_twenty_kilometres_of_town_traffic(town_roads: RoadGraph, bare_town: BareTown) -> None:
    drive = plan_ego_drive(town_roads, seed=1, length_m=20_000)
    movers = plan_traffic(bare_town(town_roads), drive, seed=1)
    assert len(movers) > 20
    assert len(overlaps(drive, movers, ego_extent_m=EGO_EXTENT_M, duration_s=drive.duration_s)) == 0


def test_zero_density_gives_no_traffic(blocks: RoadGraph, bare_town: BareTown) -> None:
    drive = plan_ego_drive(blocks, seed=1, duration_s=5)
    empty = TrafficSettings(vehicles_per_km2=0.0, pedestrians_per_km2=0.0)
    assert plan_traffic(bare_town(blocks), drive, seed=1, settings=empty) == ()
