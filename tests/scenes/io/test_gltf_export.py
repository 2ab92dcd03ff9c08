"""Laws of the export: the file holds each prototype once, its nodes stand where the town says."""

import io

import numpy as np
import pytest
import trimesh

from echoscape.scenes.core.scene import Scene
from echoscape.scenes.io.gltf_export import gltf_scene, scene_to_glb
from echoscape.scenes.town.build import build_town


@pytest.fixture(scope="module")
def town() -> Scene:
    return build_town("open", seed=3)


def test_prototypes_are_stored_once_and_placed_by_nodes(town: Scene) -> None:
    scene = gltf_scene(town)
    used = np.unique(town.placements.prototype)
    parts = sum(len(town.prototypes[row].parts) for row in used)
    assert len(scene.geometry) == len(town.static) + parts
    nodes = sum(len(town.prototypes[row].parts) for row in town.placements.prototype)
    assert len(scene.graph.nodes_geometry) == len(town.static) + nodes


def test_the_file_has_the_towns_extent_with_y_upwards(town: Scene) -> None:
    data = scene_to_glb(town)
    assert data[:4] == b"glTF"
    scene = trimesh.load_scene(io.BytesIO(data), file_type="glb")
    x0, y0, x1, y1 = town.bounds_m
    low, high = np.asarray(scene.bounds)
    np.testing.assert_allclose([low[0], high[0]], [x0, x1], atol=0.1)
    np.testing.assert_allclose([low[2], high[2]], [-y1, -y0], atol=0.1)
    assert -0.2 < low[1] <= 0.0
    assert 5.0 < high[1] < 40.0


def test_a_placed_prototype_has_the_pose_of_the_scene(town: Scene) -> None:
    scene = gltf_scene(town)
    row = int(town.placements.prototype[0])
    prototype = town.prototypes[row]
    node = f"{prototype.name}/{next(iter(prototype.parts))}/{town.placements.instance[0]}"
    matrix, _ = scene.graph.get(node)
    x, y, z = town.placements.position[0]
    np.testing.assert_allclose(matrix[:3, 3], [x, z, -y], atol=1e-9)
