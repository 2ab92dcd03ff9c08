"""The first collision of a drive with a wall, a roof or a target."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose

from echoscape.scenes.core.target_meshes import with_targets
from echoscape.scenes.core.targets import Target
from echoscape.scenes.driving.clearance import first_collision
from echoscape.scenes.io.user_scene import BuiltUserScene, build_user_scene, read_user_scene

STAND = "\n[drive]\nposes = [[0, 0, 0, 0], [10, 0, 0, 0]]\n"


ALL = '\n[default]\nmaterial = "concrete"\nclass = "building"\n'


TRIANGLE = "v 20 0 0\nv 21 0 0\nv 20 0 1\nf 1 2 3\n"


def _world(
    folder: Path, mesh: str | bytes, text: str = ALL + STAND, name: str = "yard.obj"
) -> BuiltUserScene:
    """Build the scene of a mesh file and of the TOML text below its `file` key."""
    (folder / name).write_bytes(mesh if isinstance(mesh, bytes) else mesh.encode())
    (folder / "yard.toml").write_text(f'file = "{name}"\n{text}')
    return build_user_scene(read_user_scene(folder / "yard.toml"), seed=0)


def _box(*, low: tuple[float, float, float], size: tuple[float, float, float]) -> trimesh.Trimesh:
    box = trimesh.creation.box(extents=size)
    box.apply_translation(np.add(low, np.array(size) / 2))
    return box


def _bytes(box: trimesh.Trimesh, kind: str) -> bytes:
    data = trimesh.Scene(box).export(file_type=kind) if kind == "glb" else box.export(file_type=kind)
    return data.encode() if isinstance(data, str) else data  # type: ignore[return-value]


@pytest.mark.parametrize(
    ("low", "size", "hit"),
    [
        ((20, -5, 0), (0.5, 10, 3), True),  # a wall across the path
        ((20, 1.2, 0), (0.5, 10, 3), False),  # beside it
        ((20, 0.9, 0), (0.5, 10, 3), True),  # the car is 2 m wide
        ((20, -5, 0), (0.5, 10, 0.25), False),  # a kerb
        ((20, -5, 2.5), (0.5, 10, 1), False),  # a beam above the antenna
        ((20, -0.5, 2.5), (0.5, 1, 1), False),  # a beam whose ends are above the car as well
        ((20, -5, 1.5), (0.5, 10, 1), True),  # a beam at the height of the antenna
        ((33, -5, 0), (0.5, 10, 3), False),  # the front of the car stops 0.6 m short of it
        ((20, 0, 0.5), (0.01, 0.01, 0.3), True),  # an object smaller than the steps
    ],
)
def test_the_car_hits_a_wall_in_its_path(
    tmp_path: Path, low: tuple[float, float, float], size: tuple[float, float, float], *, hit: bool
) -> None:
    text = ALL + "[drive]\nwaypoints = [[0, 0], [30, 0]]\nspeed_mps = 10\n"
    world = _world(tmp_path, _bytes(_box(low=low, size=size), "obj"), text)
    collision = first_collision(world.scene, world.drive.trajectory, until_s=3.0, height_m=2.0)
    assert (collision is not None) == hit
    if collision is not None:
        assert world.names[collision.instance] == "yard"
        # The front, 2.4 m ahead of the middle, arrives first.
        assert_allclose(collision.position_m, (low[0] - 2.4, 0.0), atol=0.15)
        assert_allclose(collision.time_s, (low[0] - 2.4) / 10, atol=0.015)


def test_a_slope_is_hit_where_it_exceeds_the_ground_clearance(tmp_path: Path) -> None:
    ramp = "v 10 -9 0\nv 40 -9 3\nv 40 9 3\nv 10 9 0\nf 1 2 3 4\n"  # 0.3 m high at x = 13
    world = _world(tmp_path, ramp, ALL + "[drive]\nwaypoints = [[0, 0], [30, 0]]\nspeed_mps = 10\n")
    collision = first_collision(world.scene, world.drive.trajectory, until_s=3.0, height_m=2.0)
    assert collision is not None
    assert_allclose(collision.position_m[0] + 2.4, 13.0, atol=0.15)


def test_only_collisions_before_the_end_count_and_point_targets_do_too(tmp_path: Path) -> None:
    world = _world(
        tmp_path,
        TRIANGLE.replace("v 2", "v 9"),
        ALL + "[drive]\nwaypoints = [[0, 0], [30, 0]]\nspeed_mps = 10\n",
    )
    town = with_targets(world.scene, [Target(kind="point", position_m=(20.0, 0.5, 1.0))])
    track = world.drive.trajectory
    assert first_collision(town, track, until_s=1.7, height_m=2.0) is None
    collision = first_collision(town, track, until_s=1.8, height_m=2.0)
    assert collision is not None
    assert collision.instance == town.targets[0].instance
    assert (
        first_collision(town, track, until_s=3.0, height_m=2.0, first_instance=collision.instance + 1) is None
    )
