import numpy as np
import pytest

from echoscape.scenes.assets.vehicles import vehicle_prototypes
from echoscape.scenes.core.materials import MATERIALS
from echoscape.scenes.core.scene import CLASSES, Prototype
from echoscape.scenes.geometry.meshes import areas

PROTOTYPES = {proto.name: proto for proto in vehicle_prototypes()}
SIZES_M = {  # least and most length, width (with mirrors), height
    "car": ((3.5, 5.2), (1.7, 2.3), (1.3, 1.9)),
    "van": ((4.2, 6.5), (1.8, 2.5), (1.7, 2.8)),
    "truck": ((6.0, 16.5), (2.3, 3.0), (2.5, 4.0)),
    "bus": ((10.0, 13.0), (2.5, 3.0), (2.8, 3.5)),
    "cyclist": ((1.5, 2.0), (0.4, 0.8), (1.5, 2.0)),
    "pedestrian": ((0.2, 1.2), (0.3, 0.8), (1.0, 2.0)),
}


def points(proto: Prototype) -> np.ndarray:
    return np.concatenate([part.vertices[np.unique(part.faces)] for part in proto.parts.values()])


def test_every_class_has_a_prototype() -> None:
    kinds = [proto.class_name for proto in PROTOTYPES.values()]
    least = {"car": 4, "van": 2, "truck": 2, "bus": 1, "cyclist": 1, "pedestrian": 3}
    assert all(kinds.count(kind) >= count for kind, count in least.items())
    assert len(PROTOTYPES) == len(vehicle_prototypes())


@pytest.mark.parametrize("name", PROTOTYPES)
def test_extent_is_the_exact_box_centred_on_the_ground(name: str) -> None:
    proto = PROTOTYPES[name]
    low, high = points(proto).min(axis=0), points(proto).max(axis=0)
    np.testing.assert_allclose(high - low, proto.extent_m, atol=1e-5)
    np.testing.assert_allclose(low, [-proto.extent_m[0] / 2, -proto.extent_m[1] / 2, 0.0], atol=1e-5)


@pytest.mark.parametrize("name", PROTOTYPES)
def test_sizes_are_those_of_the_kind(name: str) -> None:
    proto = PROTOTYPES[name]
    for size, (least, most) in zip(proto.extent_m, SIZES_M[proto.class_name], strict=True):
        assert least <= size <= most


@pytest.mark.parametrize("name", PROTOTYPES)
def test_meshes_are_finite_without_degenerate_faces_and_of_known_materials(name: str) -> None:
    proto = PROTOTYPES[name]
    assert proto.class_name in CLASSES
    assert set(proto.parts) <= set(MATERIALS)
    for part in proto.parts.values():
        assert np.isfinite(part.vertices).all()
        assert areas(part.vertices, part.faces).min() > 0
        assert part.faces.max() < len(part.vertices)


@pytest.mark.parametrize("name", PROTOTYPES)
def test_normals_of_curved_faces_are_unit_vectors_on_the_outer_side(name: str) -> None:
    curved_m2 = all_m2 = 0.0
    for part in PROTOTYPES[name].parts.values():
        size_m2 = areas(part.vertices, part.faces)
        all_m2 += size_m2.sum()
        if part.normals is None:
            continue
        curved = part.normals.any(axis=(1, 2))
        curved_m2 += size_m2[curved].sum()
        corners = part.vertices[part.faces[curved]].astype(np.float64)
        face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        face /= np.linalg.norm(face, axis=1, keepdims=True)
        normals = part.normals[curved]
        np.testing.assert_allclose(np.linalg.norm(normals, axis=2), 1.0, atol=1e-5)
        assert np.einsum("fck,fk->fc", normals, face).min() > 0
    assert curved_m2 > 0.2 * all_m2


@pytest.mark.parametrize(
    "name", [n for n, p in PROTOTYPES.items() if p.class_name in ("car", "van", "truck", "bus", "cyclist")]
)
def test_wheels_touch_the_road(name: str) -> None:
    rubber = PROTOTYPES[name].parts["rubber"].vertices
    touching = rubber[np.abs(rubber[:, 2]) < 1e-3]
    assert len(np.unique(np.round(touching[:, 0], 1))) >= 2  # at two axles or more


@pytest.mark.parametrize("name", PROTOTYPES)
def test_a_radar_nearby_sees_the_outer_side_of_every_face(name: str) -> None:
    proto = PROTOTYPES[name]
    corners = np.concatenate([part.vertices[part.faces] for part in proto.parts.values()]).astype(np.float64)
    rng = np.random.default_rng(7)
    turn = rng.uniform(0.0, 2 * np.pi, 100)
    origin = np.c_[25 * np.cos(turn), 25 * np.sin(turn), rng.uniform(0.3, 4.0, 100)]
    target = rng.uniform((-0.48, -0.48, 0.02), (0.48, 0.48, 0.98), (100, 3)) * proto.extent_m
    cosine = [first_cosine(corners, start, end - start) for start, end in zip(origin, target, strict=True)]
    assert np.mean(np.isfinite(cosine)) > 0.2
    assert np.nanmax(cosine) < 0


def first_cosine(corners: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> float:
    """Cosine of `direction` and the normal of the first triangle hit, else NaN (Moeller, Trumbore 1997)."""
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = np.cross(direction, v)
    det = (u * p).sum(axis=1)
    det = np.where(np.abs(det) < 1e-12, np.nan, det)
    away = origin - corners[:, 0]
    a = (away * p).sum(axis=1) / det
    q = np.cross(away, u)
    b = (q @ direction) / det
    distance = (v * q).sum(axis=1) / det
    hit = (a >= 0) & (b >= 0) & (a + b <= 1) & (distance > 0)
    if not hit.any():
        return np.nan
    row = np.flatnonzero(hit)[np.argmin(distance[hit])]
    normal = np.cross(u[row], v[row])
    return float(normal @ direction / np.linalg.norm(normal) / np.linalg.norm(direction))


def test_cars_have_glass_above_their_waist_only() -> None:
    for proto in PROTOTYPES.values():
        if proto.class_name == "car":
            assert (
                proto.parts["glass"].vertices[np.unique(proto.parts["glass"].faces), 2].min()
                > 0.45 * proto.extent_m[2]
            )
