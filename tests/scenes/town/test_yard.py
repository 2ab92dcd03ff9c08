"""A yard is small, quick to build and has some of everything; vehicles drive and wait in it."""

import time

import numpy as np
import pytest

from echoscape.scenes.core.scene import CLASSES, Scene
from echoscape.scenes.driving.ego_drive import plan_ego_drive
from echoscape.scenes.town.build import build_town
from echoscape.scenes.traffic.plan import plan_traffic

WANTED = ["ground", "road", "building", "wall", "fence", "tree", "lamp_post", "bollard", "car", "container"]
SEEDS = range(8)


def classes_within(scene: Scene, reach_m: float) -> set[str]:
    """Classes of the objects that stand within a square about the crossing."""
    found = {
        CLASSES[scene.instance_class[each]] for each in scene.placements.instance[inside(scene, reach_m)]
    }
    for mesh in scene.static.values():
        near = (np.abs(mesh.vertices[mesh.faces][..., :2]).max(axis=(1, 2)) < reach_m) | (
            np.ptp(mesh.vertices[mesh.faces][..., 2], axis=1) == 0.0
        )
        found |= {CLASSES[scene.instance_class[each]] for each in np.unique(mesh.instance[near])}
    return found


def inside(scene: Scene, reach_m: float) -> np.ndarray:
    return np.abs(scene.placements.position[:, :2]).max(axis=1) < reach_m


@pytest.mark.parametrize("seed", SEEDS)
def test_every_yard_has_some_of_everything_within_its_wall(seed: int) -> None:
    assert classes_within(build_town("yard", seed=seed), 100.0) >= set(WANTED)


def test_a_yard_is_built_with_its_drive_and_traffic_in_less_than_a_second_of_cpu() -> None:
    build_town("yard", seed=100)  # imports what is imported on first use
    begin = time.process_time()
    scene = build_town("yard", seed=0)
    plan_traffic(scene, plan_ego_drive(scene, seed=0, duration_s=3.5), seed=0)
    assert time.process_time() - begin < 1.0


@pytest.mark.parametrize("seed", SEEDS)
def test_the_car_and_other_vehicles_move(seed: int) -> None:
    scene = build_town("yard", seed=seed)
    drive = plan_ego_drive(scene, seed=seed, duration_s=3.5)
    assert drive.length_m > 10.0
    moved = [
        np.ptp(mover.track.state[:, :2], axis=0).max() for mover in plan_traffic(scene, drive, seed=seed)
    ]
    assert np.sum(np.array(moved) > 1.0) >= 3


@pytest.mark.parametrize("seed", SEEDS)
def test_the_quarters_differ_and_a_seed_shuffles_them(seed: int) -> None:
    """Three quarters of the containers, of the parked cars and of the trees stand in two quarters at most."""
    scene = build_town("yard", seed=seed)
    for wanted in ("tree", "car"):
        within = inside(scene, 92.0) & (
            scene.instance_class[scene.placements.instance] == CLASSES.index(wanted)
        )
        x, y = scene.placements.position[within, :2].T
        count = np.bincount(2 * (x > 0).astype(int) + (y > 0), minlength=4)
        assert count.max() >= 0.75 * count.sum()
