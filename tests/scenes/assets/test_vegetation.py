import numpy as np
import pytest

from echoscape.scenes.assets.vegetation import hedge, tree_prototypes
from echoscape.scenes.geometry.meshes import areas

PROTOTYPES = {proto.name: proto for proto in tree_prototypes()}


def test_trees_are_the_same_every_time() -> None:
    for first, second in zip(tree_prototypes(), tree_prototypes(), strict=True):
        for material in first.parts:
            np.testing.assert_array_equal(first.parts[material].vertices, second.parts[material].vertices)


@pytest.mark.parametrize("name", PROTOTYPES)
def test_trees_have_wood_and_many_small_leaf_clusters(name: str) -> None:
    proto = PROTOTYPES[name]
    assert set(proto.parts) == {"wood", "foliage"}
    leaves = proto.parts["foliage"]
    size = areas(leaves.vertices, leaves.faces)
    assert 200 <= len(leaves.faces) // 2 <= 400
    assert size.min() > 0
    assert size.max() < 0.5 * 0.7**2
    points = np.concatenate([part.vertices for part in proto.parts.values()])
    np.testing.assert_allclose(np.ptp(points, axis=0), proto.extent_m, atol=1e-5)


@pytest.mark.parametrize("name", PROTOTYPES)
def test_crowns_transmit_part_of_the_rays(name: str) -> None:
    """By Beer's law the share that passes is exp(-projected leaf area / silhouette); facets lie at random."""
    leaves = PROTOTYPES[name].parts["foliage"]
    corners = leaves.vertices[leaves.faces].astype(np.float64)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    projected = 0.5 * np.abs(normal[:, 0]).sum()
    spread = np.ptp(corners.reshape(-1, 3), axis=0)
    share = np.exp(-projected / (np.pi / 4 * spread[1] * spread[2]))
    assert 0.05 < share < 0.8


def test_hedge_is_rough_closed_from_above_and_along_its_line() -> None:
    line = np.array([[0.0, 0.0], [12.0, 0.0]])
    part = hedge(line, height_m=1.6, thickness_m=0.8, rng=np.random.default_rng(3))
    low, high = part.vertices.min(axis=0), part.vertices.max(axis=0)
    assert abs(low[2]) < 1e-6
    assert 1.5 < high[2] < 1.7
    assert high[1] - low[1] < 1.05
    corners = part.vertices[part.faces].astype(np.float64)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    middle = corners.mean(axis=1) - [6.0, 0.0, 0.8]
    side = (np.abs(middle[:, 1]) > 0.3) & (np.abs(middle[:, 0]) < 5.7)
    assert np.all(normal[side, 1] * middle[side, 1] > 0)
    assert np.std(normal[side, 0]) > 0.03  # no common mirror direction


def test_hedge_follows_its_generator() -> None:
    line = np.array([[0.0, 0.0], [5.0, 1.0], [7.0, 6.0]])
    one, same, other = (
        hedge(line, height_m=1.6, thickness_m=0.8, rng=np.random.default_rng(seed)).vertices
        for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(one, same)
    assert not np.array_equal(one, other)
