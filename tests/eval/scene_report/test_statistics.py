"""Laws of the inventory: what is placed counts as often as it stands, areas with the square of its scale."""

import numpy as np
from numpy.testing import assert_allclose

from echoscape.eval.scene_report.statistics import inventory
from echoscape.scenes.core.lane_graph import RoadGraph
from echoscape.scenes.core.scene import CLASSES, Mesh, Placements, Prototype, Scene, StaticMesh

SHEET = Mesh(
    vertices=np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]], np.float32),
    faces=np.array([[0, 1, 2], [0, 2, 3]], np.uint32),
)
"""Two metres by one."""


def _town() -> Scene:
    """Return a sheet of soil, and three of wood of which one is turned left and twice as large."""
    post = Prototype(name="post", class_name="sign", parts={"wood": SHEET}, extent_m=(2, 1, 0))
    unused = Prototype(name="tank", class_name="tank", parts={"metal": SHEET}, extent_m=(2, 1, 0))
    return Scene(
        preset="test",
        seed=0,
        static={
            "soil": StaticMesh(vertices=SHEET.vertices, faces=SHEET.faces, instance=np.ones(2, np.uint32))
        },
        prototypes=(unused, post),
        placements=Placements(
            prototype=np.array([1, 1, 1], np.uint32),
            instance=np.array([2, 3, 4], np.uint32),
            position=np.array([[10.0, 0, 0], [20, 0, 0], [30, 5, 1]]),
            yaw=np.array([0.0, 0.0, np.pi / 2]),
            scale=np.array([1.0, 1.0, 2.0]),
        ),
        instance_class=np.array([0, 1, *3 * [CLASSES.index("sign")]], np.uint8),
        roads=RoadGraph(lanes=(), junctions=np.zeros((0, 2))),
        bounds_m=(0, 0, 30, 9),
    )


def test_triangles_are_stored_once_and_placed_as_often_as_they_stand() -> None:
    numbers = inventory(_town())
    assert (numbers.triangles_stored, numbers.triangles_placed) == (4, 8)


def test_objects_are_counted_by_class_and_only_those_that_stand() -> None:
    classes = inventory(_town()).classes
    assert {name: (count.objects, count.triangles) for name, count in classes.items()} == {
        "ground": (1, 2),
        "sign": (3, 6),
    }


def test_areas_grow_with_the_square_of_the_scale() -> None:
    materials = inventory(_town()).materials
    assert list(materials) == ["soil", "wood"]
    assert_allclose((materials["soil"].area_m2, materials["wood"].area_m2), (2.0, 2 + 2 + 8))


def test_the_box_holds_what_is_placed_turned_and_scaled() -> None:
    numbers = inventory(_town())
    # The last sheet reaches 4 m along y and 2 m back along x from its place.
    assert_allclose((numbers.low_m, numbers.high_m), ((0, 0, 0), (30, 9, 1)), atol=1e-6)
