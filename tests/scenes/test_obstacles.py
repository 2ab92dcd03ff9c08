"""The search for obstacles that other tests use, against sampled points and simple scenes."""

import numpy as np
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from echoscape.scenes.core.lane_graph import RoadGraph
from echoscape.scenes.core.scene import CLASSES, Mesh, Placements, Prototype, Scene, StaticMesh
from echoscape.scenes.core.trajectory import Trajectory
from tests.scenes.obstacles import OVERHEAD_M, Obstacles, triangle_overlaps_box


def _scene(parts: dict[str, Mesh], placed: Prototype | None = None) -> Scene:
    """Return a town of one object a class, from 1 on, and one prototype at (10, 0)."""
    classes = [0, *(CLASSES.index(name) for name in parts), CLASSES.index("lamp_post")]
    static = {
        name: StaticMesh(
            vertices=mesh.vertices, faces=mesh.faces, instance=np.full(len(mesh.faces), number + 1, np.uint32)
        )
        for number, (name, mesh) in enumerate(parts.items())
    }
    some = 1 if placed else 0
    return Scene(
        preset="test",
        seed=0,
        static=static,
        prototypes=(placed,) if placed else (),
        placements=Placements(
            prototype=np.zeros(some, np.uint32),
            instance=np.full(some, len(parts) + 1, np.uint32),
            position=np.tile([10.0, 0.0, 0.12], (some, 1)),
            yaw=np.full(some, np.pi / 2),
            scale=np.full(some, 2.0),
        ),
        instance_class=np.array(classes, np.uint8),
        roads=RoadGraph(lanes=(), junctions=np.zeros((0, 2))),
        bounds_m=(0.0, 0.0, 1.0, 1.0),
    )


def _triangle(*corners: tuple[float, float, float]) -> Mesh:
    return Mesh(vertices=np.array(corners, np.float32), faces=np.array([[0, 1, 2]], np.uint32))


def _hits(town: Scene, x: float, y: float, height: float, yaw: float = 0.0) -> int:
    obstacles = Obstacles(town, near=np.array([[0.0, 0.0], [10.0, 0.0]]))
    return int(obstacles.touched(np.array([[x, y, 0.0, yaw]]), (4.0, 2.0, height), shrink_m=0.0)[0])


def test_a_wall_is_an_obstacle_and_a_road_is_not() -> None:
    wall = _triangle((1.9, -9.0, 0.0), (1.9, 9.0, 0.0), (1.9, 0.0, 3.0))
    road = _triangle((-9.0, -9.0, 0.1), (9.0, -9.0, 0.1), (0.0, 9.0, 0.1))
    town = _scene({"road": road, "wall": wall})
    assert _hits(town, 0.0, 0.0, 1.5) == 2
    assert _hits(town, -0.2, 0.0, 1.5) == 0
    assert _hits(town, 0.0, 0.0, 1.5, yaw=np.pi / 2) == 0  # it is 1 m to either side then


def test_overhanging_objects_are_passed_under() -> None:
    for height, lorry, car in ((OVERHEAD_M, 0, 0), (2.0, 1, 0), (1.4, 1, 1)):
        leaf = _triangle((0.0, 0.0, height), (0.5, 0.0, height), (0.0, 0.5, height))
        town = _scene({"tree": leaf})
        assert (_hits(town, 0.0, 0.0, 3.5), _hits(town, 0.0, 0.0, 1.5)) == (lorry, car)


def test_placed_prototypes_are_found_at_their_pose() -> None:
    arm = _triangle((0.0, 0.0, 0.5), (1.5, 0.0, 0.5), (1.5, 0.01, 0.5))  # to x: twice as long and turned to y
    kind = Prototype(name="arm", class_name="lamp_post", parts={"metal": arm}, extent_m=(3.0, 0.02, 0.5))
    town = _scene({}, kind)
    assert _hits(town, 10.0, 3.9, 1.5) == 1
    assert _hits(town, 10.0, 4.1, 1.5) == 0
    assert _hits(town, 12.5, 0.0, 1.5) == 0


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_triangles_overlap_boxes_as_sampled_points_do(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corner, half = rng.uniform(-4, 4, (1, 3, 2)), rng.uniform(0.3, 2.0, 2)
    weight = rng.dirichlet(np.ones(3), 4000)
    inside = (np.abs(weight @ corner[0]) <= half).all(axis=-1).any()
    apart = shapely.Polygon(corner[0]).distance(shapely.box(*-half, *half)) > 0
    overlaps = bool(triangle_overlaps_box(corner, half)[0])
    assert overlaps or not inside
    assert overlaps != apart


def test_boxes_are_tested_at_the_poses_of_their_trajectory() -> None:
    post = _triangle((0.0, 0.0, 0.0), (0.1, 0.0, 0.0), (0.0, 0.1, 1.0))
    town = _scene({"bollard": post})
    state = np.array([[-5.0, 0.0, 0.0, 0.0], [5.0, 0.0, 0.0, 0.0]])
    track = Trajectory(time_s=np.array([0.0, 10.0]), state=state, rate=np.tile([1.0, 0, 0, 0], (2, 1)))
    obstacles = Obstacles(town, near=np.zeros((1, 2)))
    hit = obstacles.touched(track.pose(np.arange(0.0, 10.1, 1.0)), (4.0, 2.0, 1.5)) > 0
    # A box of 4 m overlaps the post, 0 to 0.1 m, while its middle is from -1.98 to 2.08 m.
    np.testing.assert_array_equal(np.flatnonzero(hit), [4, 5, 6, 7])
