import numpy as np
import pytest

from echoscape.scenes.assets.street_furniture import furniture_prototypes
from echoscape.scenes.core.materials import MATERIALS
from echoscape.scenes.core.scene import CLASSES
from echoscape.scenes.geometry.meshes import areas

PROTOTYPES = {proto.name: proto for proto in furniture_prototypes()}


def test_every_class_of_furniture_has_a_prototype() -> None:
    made = {proto.class_name for proto in PROTOTYPES.values()}
    assert made == {"lamp_post", "sign", "bollard", "bus_shelter", "bin", "barrier", "container", "tank"}
    assert made <= set(CLASSES)


@pytest.mark.parametrize("name", PROTOTYPES)
def test_extent_is_the_exact_box_and_faces_are_sound(name: str) -> None:
    proto = PROTOTYPES[name]
    assert set(proto.parts) <= set(MATERIALS)
    points = np.concatenate([part.vertices[np.unique(part.faces)] for part in proto.parts.values()])
    np.testing.assert_allclose(np.ptp(points, axis=0), proto.extent_m, atol=1e-5)
    np.testing.assert_allclose(
        points.min(axis=0), [-proto.extent_m[0] / 2, -proto.extent_m[1] / 2, 0], atol=1e-5
    )
    for part in proto.parts.values():
        assert np.isfinite(part.vertices).all()
        assert areas(part.vertices, part.faces).min() > 0


def test_container_has_iso_size_and_corrugated_sides() -> None:
    container = PROTOTYPES["container_20ft"]
    np.testing.assert_allclose(
        container.extent_m, (6.06, 2.44, 2.59), atol=0.03
    )  # ISO 668; door bars stand out
    corners = container.parts["metal"].vertices[container.parts["metal"].faces].astype(np.float64)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    slanted = (np.abs(normal[:, 1]) > 0.3) & (np.abs(normal[:, 0]) > 0.1) & (np.abs(normal[:, 2]) < 1e-3)
    slanted &= np.abs(corners.mean(axis=1)[:, 1]) > 1.1  # the sides, not the doors' bars
    outward = normal[slanted, 1] * corners[slanted].mean(axis=1)[:, 1] > 0
    assert slanted.sum() > 40
    assert outward.all()


def test_guard_rail_is_four_metres_and_thin() -> None:
    length, width, height = PROTOTYPES["guard_rail"].extent_m
    np.testing.assert_allclose([length, height], [4.0, 0.76], atol=1e-5)
    assert width < 0.4
