"""Custom scenes: all mesh formats give the same scene, rules and drives apply as documented,
and errors name what is wrong."""

import json
import logging
import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose
from numpy.typing import NDArray

from echoscape.scenes.core.scene import CLASSES
from echoscape.scenes.io.gltf_export import scene_to_glb
from echoscape.scenes.io.strict_toml import SceneError, read_toml
from echoscape.scenes.io.user_drive import DrivePlan, make_user_drive, read_drive_plan
from echoscape.scenes.io.user_scene import BuiltUserScene, build_user_scene, read_user_scene
from tests.paths import ROOT

EXAMPLES = ROOT / "examples"


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


def _corners(world: BuiltUserScene) -> NDArray[np.float32]:
    """Return all triangles, as rows of nine numbers in order."""
    rows = np.concatenate([mesh.vertices[mesh.faces] for mesh in world.scene.static.values()]).reshape(-1, 9)
    return rows[np.lexsort(rows.T)]


def _bytes(box: trimesh.Trimesh, kind: str) -> bytes:
    data = trimesh.Scene(box).export(file_type=kind) if kind == "glb" else box.export(file_type=kind)
    return data.encode() if isinstance(data, str) else data  # type: ignore[return-value]


@pytest.mark.parametrize("kind", ["obj", "ply", "glb"])
def test_every_format_gives_the_same_scene(tmp_path: Path, kind: str) -> None:
    box = _box(low=(10, 2, 0), size=(4, 3, 2))
    expected = box.triangles.astype(np.float32).reshape(-1, 9)
    world = _world(tmp_path, _bytes(box, kind), 'up = "z"\n' + ALL + STAND, name=f"yard.{kind}")
    assert_allclose(_corners(world), expected[np.lexsort(expected.T)], atol=1e-6)


def test_y_up_becomes_z_up_and_scale_multiplies(tmp_path: Path) -> None:
    mesh = "v 10 3 -4\nv 11 3 -4\nv 10 3 -5\nf 1 2 3\n"  # north is -z in glTF's axes
    world = _world(tmp_path, mesh, 'up = "y"\nscale = 2\n' + ALL + STAND)
    assert_allclose(_corners(world), [[20, 8, 6, 22, 8, 6, 20, 10, 6]])


def test_gltf_is_y_up_by_default(tmp_path: Path) -> None:
    data = _bytes(_box(low=(10, 0, 0), size=(2, 7, 4)), "glb")
    tops = [
        _world(tmp_path, data, up + ALL + STAND, name="y.glb").scene.static["concrete"].vertices[:, 2].max()
        for up in ("", 'up = "z"\n')
    ]
    assert tops == [7.0, 4.0]


def test_nodes_are_placed_and_mirrored_ones_keep_their_outside(tmp_path: Path) -> None:
    box, scene = trimesh.creation.box(extents=(1, 1, 1)), trimesh.Scene()
    scene.add_geometry(box, node_name="left", geom_name="cube", transform=np.diag([-2.0, 1, 1, 1]))
    move = trimesh.transformations.translation_matrix([30, 0, 0])
    scene.graph.update(frame_to="right", frame_from="world", matrix=move, geometry="cube")
    data = scene.export(file_type="glb")
    assert isinstance(data, bytes)
    world = _world(
        tmp_path, data, 'up = "z"\n' + ALL + "[drive]\nposes = [[0, 9, 9, 0], [1, 9, 9, 0]]", "a.glb"
    )
    mesh = world.scene.static["concrete"]
    assert world.names == ("none", "left", "right")
    for instance, volume in ((1, 2.0), (2, 1.0)):
        a, b, c = np.moveaxis(mesh.vertices[mesh.faces[mesh.instance == instance]].astype(float), 1, 0)
        # The signed volume of a closed surface is positive when its faces look outwards.
        assert_allclose(np.einsum("ij,ij->", a, np.cross(b, c)) / 6, volume, rtol=1e-6)


def test_an_exported_scene_is_imported_unchanged(tmp_path: Path) -> None:
    shutil.copy(EXAMPLES / "yard.obj", tmp_path)
    first = build_user_scene(read_user_scene(EXAMPLES / "yard.toml"), seed=0)
    rules = "".join(
        f'[[object]]\nname = "static/{name}"\nmaterial = "{name}"\nclass = "wall"\n'
        for name in first.scene.static
    )
    second = _world(tmp_path, scene_to_glb(first.scene), rules + STAND, "scene.glb")
    assert list(second.scene.static) == list(first.scene.static)
    assert_allclose(_corners(second), _corners(first), atol=1e-5)


TWO = """
o wall_a
usemtl bricks
v 10 0 0
v 10 1 0
v 10 1 1
f 1 2 3
usemtl pane
f -1 -2 -3
o wall_b
usemtl bricks
v 20 0 0
v 20 1 0
v 20 1 1
f 4 5 6
"""


def _rules(*rules: tuple[str, str, str]) -> str:
    return "".join(
        f'[[object]]\nname = "{name}"\nmaterial = "{material}"\nclass = "{kind}"\n'
        for name, material, kind in rules
    )


def test_the_first_matching_rule_applies(tmp_path: Path) -> None:
    text = _rules(("pane", "glass", "wall"), ("wall_?", "brick", "wall"), ("*", "metal", "tree")) + STAND
    world = _world(tmp_path, TWO, text)
    assert {name: len(mesh.faces) for name, mesh in world.scene.static.items()} == {"brick": 2, "glass": 1}


def test_an_object_of_two_materials_is_one_instance(tmp_path: Path) -> None:
    world = _world(tmp_path, TWO, _rules(("pane", "glass", "wall"), ("wall_?", "brick", "wall")) + STAND)
    assert world.names == ("none", "wall_a", "wall_b")
    assert world.scene.static["glass"].instance.tolist() == [1]
    assert sorted(world.scene.static["brick"].instance.tolist()) == [1, 2]
    assert [CLASSES[number] for number in world.scene.instance_class] == ["none", "wall", "wall"]


def test_skipped_objects_are_left_out(tmp_path: Path) -> None:
    text = '[[object]]\nname = "wall_a"\nskip = true\n' + ALL + STAND
    assert _world(tmp_path, TWO, text).names == ("none", "wall_b")


def test_rules_match_gltf_nodes_by_node_mesh_and_material(tmp_path: Path) -> None:
    numbers = np.array([10, 0, 0, 11, 0, 0, 10, 1, 0], np.float32).tobytes()
    (tmp_path / "b.bin").write_bytes(numbers + np.array([0, 1, 2], np.uint32).tobytes())
    faces = {"attributes": {"POSITION": 0}, "indices": 1}
    content = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"name": "House", "mesh": 0}, {"name": "Shed", "mesh": 0, "translation": [5, 0, 0]}],
        "meshes": [{"name": "Cube", "primitives": [faces | {"material": 0}, faces | {"material": 1}]}],
        "materials": [{"name": "clay"}, {"name": "pane"}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [10, 0, 0],
             "max": [11, 1, 0]},
            {"bufferView": 1, "componentType": 5125, "count": 3, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 12},
        ],
        "buffers": [{"byteLength": 48, "uri": "b.bin"}],
    }  # fmt: skip
    rules = _rules(
        ("pane", "glass", "building"), ("Shed", "wood", "building"), ("Cube*", "brick", "building")
    )
    world = _world(tmp_path, json.dumps(content), rules + STAND, name="yard.gltf")
    faces_of = {name: len(mesh.faces) for name, mesh in world.scene.static.items()}
    assert faces_of == {"brick": 1, "glass": 2, "wood": 1}
    assert world.names == ("none", "House", "Shed")
    before = read_user_scene(tmp_path / "yard.toml").sha256
    (tmp_path / "b.bin").write_bytes(numbers + np.array([0, 2, 1], np.uint32).tobytes())
    assert read_user_scene(tmp_path / "yard.toml").sha256 != before


def test_degenerate_faces_are_left_out(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        world = _world(tmp_path, TRIANGLE + "v 22 0 0\nf 1 2 4\n")
    assert len(world.scene.static["concrete"].faces) == 1
    assert "1 degenerate faces left out" in caplog.text


BROKEN_MESH = {
    "": "contains no faces",
    "v 0 0 0\nv 1 0 0\nv 0 1 0\n": "contains no faces",
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n": "line 4: a face refers to vertex 9, but there are 3",
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n": "line 4: a face refers to vertex 0",
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2": "line 4: a face must have 3 or more corners, got 2",
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 b 3": "line 4: 'b' is not a vertex index",
    "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n": "object 'yard': a vertex or its transform is not finite",
    "v 0 0 inf\nv 1 0 0\nv 0 1 0\nf 1 2 3\n": "not finite",
    "v 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n": "line 1: a vertex must be three numbers, got '0 0'",
    "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n": "object 'yard' has only degenerate faces",
    "v 0 0 0\nv 1 0 0\nv 0 4e5 0\nf 1 2 3\n": "reaches 400000 m from the origin",
}


@pytest.mark.parametrize("mesh", BROKEN_MESH)
def test_an_invalid_obj_is_refused(tmp_path: Path, mesh: str) -> None:
    _assert_error(tmp_path, mesh, BROKEN_MESH[mesh])


@pytest.mark.parametrize("kind", ["ply", "glb"])
@pytest.mark.parametrize("share", [0.0, 0.05, 0.4, 0.7, 0.99])
def test_a_truncated_mesh_is_refused(tmp_path: Path, kind: str, share: float) -> None:
    whole = _bytes(_box(low=(10, 0, 0), size=(1, 1, 1)), kind)
    _assert_error(tmp_path, whole[: int(share * len(whole))], "damaged or truncated", name=f"yard.{kind}")


def test_a_truncated_ascii_ply_is_refused(tmp_path: Path) -> None:
    whole = trimesh.creation.box().export(file_type="ply", encoding="ascii")
    text = whole.decode() if isinstance(whole, bytes) else str(whole)
    for cut in range(4, len(text) // 2, 29):
        _assert_error(tmp_path, text[:-cut], "damaged or truncated", name="yard.ply")


def test_a_ply_without_faces_or_with_invalid_indices_is_refused(tmp_path: Path) -> None:
    head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    points = "10 0 0\n11 0 0\n10 1 0\n"
    _assert_error(tmp_path, head + "end_header\n" + points, "object 'yard' has no faces", name="yard.ply")
    faces = "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    message = "a face refers to vertex 7, but there are 3"
    _assert_error(tmp_path, head + faces + points + "3 0 1 7\n", message, name="yard.ply")


def _assert_error(folder: Path, mesh: str | bytes, message: str, name: str = "yard.obj") -> None:
    with pytest.raises(SceneError) as error:
        _world(folder, mesh, name=name)
    assert message in str(error.value)
    assert str(folder / name) in str(error.value)
    assert "\n" not in str(error.value)


BAD_TOML = {
    STAND: "no [[object]] gives a material and a class to 'yard'",
    ALL: "yard.toml: drive is missing",
    ALL.replace("concrete", "stone") + STAND: "default: material must be one of concrete, brick",
    ALL.replace("building", "none") + STAND: "default: class must be one of ground, road",
    '[default]\nclass = "wall"\n' + STAND: "default: material is missing",
    '[[object]]\nmaterial = "metal"\nclass = "wall"\n' + STAND: "object 1: name is missing",
    "[default]\nskip = true\n" + STAND: "every object is skipped",
    '[default]\nskip = true\nmaterial = "wood"' + STAND: "skip excludes material and class",
    'up = "x"\n' + ALL + STAND: "up must be one of z, y, got 'x'",
    "scale = 0\n" + ALL + STAND: "scale must be above 0, got 0",
    "sacle = 2\n" + ALL + STAND: "unknown key 'sacle'; did you mean scale?",
    ALL + "[drive]\nspeed_mps = 3": "drive: one of poses and waypoints must be given, got neither",
    ALL + STAND + "waypoints = [[0, 0], [1, 1]]": "drive: one of poses and waypoints must be given, got both",
    ALL + STAND + "speed_mps = 3": "drive: unknown key 'speed_mps'; allowed: poses, waypoints, z_m",
    ALL + "[drive]\npose = [[0, 0, 0, 0], [9, 0, 0, 0]]": "yard.toml: drive: unknown key 'pose'; "
    "did you mean poses? allowed: poses, waypoints, speed_mps, z_m",
    ALL + "[drive]\nwaypoints = [[0, 0], [5, 0]]\nspeed = 3": "yard.toml: drive: unknown key 'speed'; "
    "did you mean speed_mps? allowed: poses, waypoints, speed_mps, z_m",
    ALL + "[drive]\nposes = [[0, 0, 0, 0]]": "drive: poses must be two or more, got 1",
    ALL + "[drive]\nposes = [[0, 0, 0, 0], [1, 2, 3]]": "poses must be [[t_s, x_m, y_m, heading_deg], ...]",
    ALL + "[drive]\nposes = [[1, 0, 0, 0], [2, 0, 0, 0]]": "poses must begin at t_s = 0, got 1",
    ALL + "[drive]\nposes = [[0, 0, 0, 0], [2, 0, 0, 0], [2, 0, 0, 0]]": "t_s of row 3 is 2 after 2",
    ALL + "[drive]\nposes = [[0, 0, 0, 0], [1, 400, 0, 0]]": "row 2 is reached at 400 m/s",
    ALL + "[drive]\nwaypoints = [[0, 0], [5, 0]]": "drive: speed_mps is missing",
    ALL + "[drive]\nwaypoints = [[0, 0], [5, 0]]\nspeed_mps = 0": "speed_mps must be above 0",
    ALL + "[drive]\nwaypoints = [[0, 0], [0, 0]]\nspeed_mps = 1": "row 2 is nearer",
    ALL + STAND + "z_m = 1e5": "yard.toml: drive: z_m must be between -10000 and 10000, got 100000",
    ALL + STAND + "z_m = -10001": "yard.toml: drive: z_m must be between -10000 and 10000, got -10001",
    ALL + STAND + '[[target]]\nkind = "plate"': "target 1: position_m is missing",
}  # fmt: skip


@pytest.mark.parametrize("text", BAD_TOML)
def test_an_invalid_description_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(SceneError) as error:
        _world(tmp_path, TRIANGLE, text)
    assert BAD_TOML[text] in str(error.value)
    assert "yard." in str(error.value)
    assert "\n" not in str(error.value)


def test_missing_files_and_other_formats_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text('file = "no.obj"' + ALL + STAND)
    with pytest.raises(SceneError, match=r"no\.obj: cannot be read \(No such file"):
        read_user_scene(tmp_path / "a.toml")
    (tmp_path / "a.toml").write_text('file = "a.stl"' + ALL + STAND)
    with pytest.raises(SceneError, match=r"a\.stl: meshes must be \.glb, \.gltf, \.obj, \.ply, got \.stl"):
        read_user_scene(tmp_path / "a.toml")


def test_a_changed_mesh_is_refused(tmp_path: Path) -> None:
    _world(tmp_path, TRIANGLE)
    scene = read_user_scene(tmp_path / "yard.toml")
    (tmp_path / "yard.obj").write_text(TRIANGLE.replace("21", "22"))
    with pytest.raises(SceneError, match=r"yard\.obj: changed since"):
        build_user_scene(scene, seed=0)


def test_objects_without_a_rule_are_listed_by_their_first_names(tmp_path: Path) -> None:
    mesh = "v 20 0 0\nv 21 0 0\nv 20 0 1\n" + "".join(f"o thing{i}\nf 1 2 3\n" for i in range(9))
    with pytest.raises(SceneError, match=r"'thing\d', .* and 4 more"):
        _world(tmp_path, mesh, STAND)


def test_waypoints_are_driven_through_at_the_given_speed_and_heading() -> None:
    points = ((0.0, 0.0), (10.0, 5.0), (25.0, 0.0), (30.0, -12.0))
    drive = make_user_drive(DrivePlan(waypoints=points, speed_mps=4.0, z_m=1.5), seed=0)
    times = np.linspace(0, drive.duration_s, 4001)
    pose, rate = drive.trajectory.pose(times), drive.trajectory.velocity(times)
    for point in points:
        assert np.hypot(*(pose[:, :2] - point).T).min() < 0.01
    assert_allclose(np.hypot(*rate[:, :2].T), 4.0, rtol=2e-3)
    assert_allclose(np.hypot(*np.diff(pose[:, :2], axis=0).T).sum(), 4.0 * drive.duration_s, rtol=1e-4)
    lean = np.arctan2(rate[:, 1], rate[:, 0]) - pose[:, 3]
    assert_allclose(np.cos(lean), 1.0, atol=1e-5)
    track = drive.trajectory
    turning = np.gradient(track.state[:, 3], track.time_s)
    assert_allclose(track.rate[1:-1, 3], turning[1:-1], atol=2e-3)
    assert_allclose(pose[:, 2], 1.5)


def test_two_waypoints_make_a_straight_line() -> None:
    drive = make_user_drive(DrivePlan(waypoints=((1.0, 1.0), (1.0, 21.0)), speed_mps=5.0), seed=0)
    assert_allclose(drive.duration_s, 4.0)
    assert_allclose(drive.pose(np.array([0.0, 1.0, 4.0])), [[1, 1, 0, np.pi / 2], [1, 6, 0, np.pi / 2],
                                                            [1, 21, 0, np.pi / 2]], atol=1e-9)  # fmt: skip


def test_poses_are_interpolated_and_a_stationary_car_stays_stationary() -> None:
    rows = ((0.0, 0.0, 0.0, 350.0), (2.0, 0.0, 0.0, 350.0), (4.0, 0.0, 0.0, 350.0), (6.0, 8.0, 1.0, 10.0),
            (8.0, 16.0, 4.0, 20.0))  # fmt: skip
    drive = make_user_drive(DrivePlan(poses=rows, z_m=0.5), seed=0)
    poses = np.array(rows)
    pose = drive.pose(poses[:, 0])
    assert_allclose(pose[:, :2], poses[:, 1:3], atol=1e-12)
    # 350 to 10 degrees is a turn of 20 degrees to the left, not of 340 to the right.
    assert_allclose(np.degrees(np.diff(pose[:, 3])), [0, 0, 20, 10], atol=1e-9)
    assert_allclose(drive.pose(np.linspace(0, 2, 50))[:, :2], 0.0, atol=1e-12)
    before, after = drive.trajectory.velocity(np.array([6 - 1e-6, 6 + 1e-6]))
    assert_allclose(before, after, atol=1e-3)


def test_car_keeps_the_attitude_of_its_poses() -> None:
    rows = tuple((float(t), 5.0 * t, 0.0, 0.0) for t in range(6))
    given = ((0.0, 0.0), (1.0, -2.0), (-1.5, 0.5), (0.0, 0.0), (2.0, 2.0), (0.0, 0.0))
    track = make_user_drive(DrivePlan(poses=rows, attitude=given), seed=0).trajectory
    assert_allclose(np.degrees(track.tilt(np.arange(6.0))), given, atol=1e-12)


def test_car_pitches_and_rolls_as_on_a_road_of_its_class() -> None:
    rows = tuple((float(t), 9.0 * t, 0.0, 0.0) for t in range(101))
    swing = {
        name: make_user_drive(DrivePlan(poses=rows, road_class=name), seed=3).trajectory.tilt(
            np.linspace(5, 100, 2000)
        )
        for name in ("smooth", "A", "C")
    }
    assert np.abs(swing["smooth"]).max() < 1e-6
    # A class has four times the roughness of the one before, and class C is 16 times as rough as A.
    assert_allclose(swing["C"], 4 * swing["A"], rtol=1e-3, atol=1e-6)
    assert 0.1 < np.degrees(swing["C"]).std() < 0.5
    again = make_user_drive(DrivePlan(poses=rows), seed=3).trajectory.tilt(np.linspace(5, 100, 2000))
    assert_allclose(again, swing["C"])


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ("attitude = [[0, 0]]", "attitude must have a row for each of the 2 poses, got 1"),
        ("attitude = [[0, 0], [30, 0]]", r"between -28\.6 and 28\.6 deg; row 2 is \[30\.0, 0\.0\]"),
        ("attitude = [[0, 0], [1]]", r"attitude must be \[\[pitch_deg, roll_deg\], \.\.\.\]"),
        ('road_class = "F"', "road_class must be one of smooth, A, B, C, D, E, got 'F'"),
    ],
)
def test_attitude_that_is_none_is_refused(tmp_path: Path, more: str, message: str) -> None:
    path = tmp_path / "drive.toml"
    path.write_text(f"poses = [[0, 0, 0, 0], [9, 9, 0, 0]]\n{more}\n")
    with pytest.raises(SceneError, match=message):
        read_drive_plan(read_toml(path))


def test_attitude_needs_poses(tmp_path: Path) -> None:
    path = tmp_path / "drive.toml"
    path.write_text("waypoints = [[0, 0], [9, 0]]\nspeed_mps = 3\nattitude = [[0, 0], [0, 0]]\n")
    with pytest.raises(SceneError, match="attitude"):
        read_drive_plan(read_toml(path))


@pytest.mark.parametrize("z_m", [1.0001e4, -np.inf, np.nan])
def test_a_plan_at_an_excessive_height_is_refused(z_m: float) -> None:
    with pytest.raises(ValueError, match="z_m must be between -10000 and 10000"):
        DrivePlan(waypoints=((0.0, 0.0), (9.0, 0.0)), speed_mps=1.0, z_m=z_m)
    assert DrivePlan(z_m=-1e4).z_m == -1e4
