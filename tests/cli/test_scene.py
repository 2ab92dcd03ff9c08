"""`echoscape scene`: a plan, numbers and a model that agree with what was put in, or nothing at all."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose
from PIL import Image

from echoscape.cli.__main__ import main
from echoscape.eval.scene_report import report as scene_folder
from tests.paths import ROOT

EXAMPLES = ROOT / "examples"
YARD = ["--scene", str(EXAMPLES / "yard.toml")]


@pytest.fixture(scope="module")
def yard(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("scene") / "new" / "yard"
    assert main(["scene", str(out), *YARD]) == 0
    return out


def test_folder_holds_model_plan_and_numbers(yard: Path) -> None:
    assert {path.name for path in yard.iterdir()} == {"scene.glb", "plan.png", "scene.json"}
    assert [path.name for path in yard.parent.iterdir()] == ["yard"]


def test_numbers_are_those_of_the_yard(yard: Path) -> None:
    numbers = json.loads((yard / "scene.json").read_text())
    # By hand: 2 on the ground, five boxes of 5 sides, 2 for the door, 3 for the corner reflector.
    assert numbers["triangles_stored"] == numbers["triangles_placed"] == 2 + 5 * 10 + 2 + 3
    objects = {name: count["objects"] for name, count in numbers["classes"].items()}
    assert objects == {"road": 1, "building": 2, "wall": 3, "target": 1}
    areas = {name: count["area_m2"] for name, count in numbers["materials"].items()}
    assert_allclose(areas["asphalt"], 60 * 40)
    # The door, and three right-angled triangles with legs of 0.3 m.
    assert_allclose(areas["metal"], 3 * 3 + 3 * 0.3**2 / 2, rtol=1e-5)
    assert_allclose(areas["concrete"], (12 * 8 + 2 * (12 + 8) * 4) + (0.2**2 + 4 * 0.2 * 8), rtol=1e-5)
    assert_allclose((numbers["low_m"], numbers["high_m"]), ((-10, -20, 0), (50, 20, 8)))
    assert numbers["targets"][0]["position_m"] == [20, 10, 1.5]


def test_the_model_has_as_many_triangles(yard: Path) -> None:
    scene = trimesh.load_scene(yard / "scene.glb", process=False)
    assert sum(len(scene.geometry[scene.graph[node][1]].faces) for node in scene.graph.nodes_geometry) == 57


def test_the_plan_shows_walls_drive_and_target_in_their_places(yard: Path) -> None:
    with Image.open(yard / "plan.png") as page:
        image = np.asarray(page.convert("RGB")).astype(int)
    height, width, _ = image.shape
    # The plan is 0.7 of the width and 0.875 of the height, the yard's middle in its own.
    left, bottom, wide = 0.035 * width, (1 - 0.045) * height, 0.70 * width
    pixel_m = 2 * (0.53 * 60 + 1) / wide

    def colour(x: float, y: float) -> list[int]:
        column = left + wide / 2 + (x - 20) / pixel_m
        row = bottom - 0.875 * height / 2 - y / pixel_m
        return image[round(row), round(column)].tolist()

    assert colour(12, 1) == [255, 180, 84]  # a way-point: the drive
    assert colour(20, 10) == [255, 95, 162]  # the target
    red, green, blue = colour(30, 19.85)
    assert red > 1.2 * green > 1.2 * blue  # brick
    red, green, blue = colour(31, 10)
    assert max(red, green, blue) - min(red, green, blue) < 20 < red  # a roof of concrete
    assert colour(31, 10)[0] > 2 * colour(0, 10)[0]  # on asphalt


def test_a_table_is_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scene", str(tmp_path / "a"), *YARD, "--targets", str(EXAMPLES / "targets.toml")]) == 0
    output = capsys.readouterr()
    # Another reflector, a wall of 12 triangles, and a point that has none.
    assert "72 stored, 72 placed" in output.out
    assert all(word in output.out for word in ("asphalt", "building", "size"))
    assert "world" in output.err
    assert "plan" in output.err


def test_a_preset_is_drawn_with_its_drive(tmp_path: Path) -> None:
    assert main(["scene", str(tmp_path / "a"), "--preset", "empty", "--seed", "3", "--scans", "4"]) == 0
    numbers = json.loads((tmp_path / "a" / "scene.json").read_text())
    assert numbers["world"] == "empty, seed 3"
    assert_allclose(numbers["drive_s"], 1 + 4 * 0.25325, atol=0.01)


BAD = {
    "--preset moon": "preset must be one of town,",
    "--preset town --scene {yard}": "preset must not be given beside a scene, got 'town'",
    "--scene none.toml": "none.toml: cannot be read",
    "--targets {yard}": "unknown key 'file'",
    "--seed many": "--seed",
    "--scans 0": "scans must be 1 or more",
}


@pytest.mark.parametrize("words", BAD)
def test_bad_input_is_refused_in_one_line_and_leaves_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: str
) -> None:
    assert main(["scene", str(tmp_path / "a"), *words.format(yard=YARD[1]).split()]) == 2
    output = capsys.readouterr().err
    assert output.startswith("echoscape scene: ")
    assert BAD[words] in output
    assert len(output.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_a_full_folder_is_refused_and_left_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "diary.txt").write_text("dear")
    assert main(["scene", str(tmp_path), *YARD]) == 2
    assert "OUT must be empty or new" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["diary.txt"]


@pytest.mark.parametrize("there", [True, False])
def test_nothing_is_left_when_the_plan_cannot_be_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, there: bool
) -> None:
    def fail(*arguments: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(scene_folder, "scene_page", fail)
    out = tmp_path / "a" / "b"
    if there:
        out.mkdir(parents=True)
    assert main(["scene", str(out), *YARD]) == 130
    assert out.exists() == (tmp_path / "a").exists() == there
    assert not there or list(out.iterdir()) == []


def test_a_map_has_its_origin_among_its_numbers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scene_folder, "scene_page", lambda plan: b"drawing takes long")
    assert main(["scene", str(tmp_path / "map"), "--osm", str(EXAMPLES / "small_town.osm")]) == 0
    numbers = json.loads((tmp_path / "map" / "scene.json").read_text())
    assert numbers["world"] == "small_town.osm, seed 0"
    assert numbers["origin_deg"] == [54.5, 3.5]
    assert numbers["classes"]["building"]["objects"] > 60


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--osm", "absent.osm"], "absent.osm: No such file"),
        (["--osm", "map.pbf"], "map.pbf: must end with one of .osm"),
        (["--osm", str(EXAMPLES / "small_town.osm"), "--preset", "town"], "--preset must not be given"),
        (["--osm", str(EXAMPLES / "small_town.osm"), *YARD], "--osm must not be given beside a scene"),
    ],
)
def test_a_map_that_cannot_be_read_is_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], says: str
) -> None:
    assert main(["scene", str(tmp_path / "out"), *words]) == 2
    assert says in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
