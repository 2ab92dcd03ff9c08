"""Laws of target files: what they say comes out in metres and radians, and whatever is wrong is named."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from echoscape.scenes.core.targets import KINDS, Target
from echoscape.scenes.io.strict_toml import SceneError
from echoscape.scenes.io.target_toml import FromStart, placed_targets, read_targets

PLATE = """
[[target]]
kind = "plate"
position_m = [1, 2.5, 3]
heading_deg = 90
elevation_deg = -30
size_m = { height = 2, width = 1 }
material = "glass"
"""

NUMBER = st.floats(-100, 100)


def _file(folder: Path, text: str) -> Path:
    path = folder / "targets.toml"
    path.write_text(text)
    return path


def test_values_are_converted_to_metres_and_radians(tmp_path: Path) -> None:
    (plate,) = read_targets(_file(tmp_path, PLATE))
    assert isinstance(plate, Target)
    assert (plate.kind, plate.position_m, plate.size_m, plate.material) == (
        "plate",
        (1.0, 2.5, 3.0),
        (1.0, 2.0),
        "glass",
    )
    assert_allclose((plate.heading_rad, plate.elevation_rad), (1.5707963, -0.5235988), atol=1e-7)


@pytest.mark.parametrize(("dbsm", "m2"), [(0, 1.0), (20, 100.0), (-10, 0.1)])
def test_decibels_are_converted_to_square_metres(tmp_path: Path, dbsm: float, m2: float) -> None:
    text = f'[[target]]\nkind = "point"\nposition_m = [1, 2, 3]\nrcs_dbsm = {dbsm}\n'
    (point,) = read_targets(_file(tmp_path, text))
    assert isinstance(point, Target)
    assert_allclose(point.rcs_m2, m2, rtol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_can_be_read(tmp_path: Path, kind: str) -> None:
    size = [0.5, 2.0, 1.5][: len(KINDS[kind].sizes)]
    text = f'[[target]]\nkind = "{kind}"\nposition_m = [9, 9, 1]\n' + (f"size_m = {size}\n" if size else "")
    (target,) = read_targets(_file(tmp_path, text))
    assert isinstance(target, Target)
    assert (target.kind, target.size_m) == (kind, tuple(size))


def test_ten_metres_ahead_of_a_car_heading_north_is_ten_metres_north(tmp_path: Path) -> None:
    text = '[[target]]\nkind = "wall"\nframe = "start"\nposition_m = [10, 2, 0.5]\nheading_deg = 180\n'
    targets = read_targets(_file(tmp_path, text + "size_m = [4, 2, 0.1]\n"))
    assert isinstance(targets[0], FromStart)
    start = np.array([100.0, 50.0, 3.0, math.pi / 2])
    (wall,) = placed_targets(targets, start=start)
    assert_allclose(wall.position_m, (102.0, 60.0, 3.5), atol=1e-12)
    assert_allclose(wall.axes[0], (0.0, -1.0, 0.0), atol=1e-12)  # it looks south, back at the car


@given(x=NUMBER, y=NUMBER, z=NUMBER, yaw=NUMBER, forward=NUMBER, right=NUMBER, heading=NUMBER)
def test_distance_and_bearing_do_not_depend_on_the_start_pose(
    x: float, y: float, z: float, yaw: float, forward: float, right: float, heading: float
) -> None:
    near = FromStart(target=Target(kind="point", position_m=(forward, right, 1.0), heading_rad=heading))
    target = near.placed(np.array([x, y, z, yaw]))
    dx, dy = target.position_m[0] - x, target.position_m[1] - y
    # Turned into a frame with x along the car and y to its left.
    seen = complex(dx, dy) * complex(math.cos(-yaw), math.sin(-yaw))
    assert_allclose((seen.real, -seen.imag, target.position_m[2] - z), (forward, right, 1.0), atol=1e-9)
    assert_allclose(math.cos(target.heading_rad + heading - yaw), 1.0, atol=1e-9)


BAD = {
    '[[target]]\nkind = "ball"\nposition_m = [0, 0, 0]': "target 1: kind must be one of point, trihedral",
    "[[target]]\nposition_m = [0, 0, 0]": "target 1: kind is missing",
    PLATE + '[[target]]\nkind = "point"': "target 2: position_m is missing",
    '[[target]]\nkind = "point"\nposition_m = [0, 0]': "target 1: position_m must be [x, y, z], finite",
    '[[target]]\nkind = "point"\nposition_m = [0, 0, nan]': "position_m must be [x, y, z], finite numbers",
    '[[target]]\nkind = "point"\nposition_m = [0, 0, true]': "position_m must be [x, y, z]",
    '[[target]]\nkind = "point"\nframe = "start"\nposition_m = 3': "position_m must be [forward, right, up]",
    '[[target]]\nkind = "point"\nframe = "car"\nposition_m = [0, 0, 0]': "frame must be one of world, start",
    PLATE + "heading = 3": "target 1: unknown key 'heading'; did you mean heading_deg?",
    PLATE.replace("90", '"north"'): "target 1: heading_deg must be a finite number, got 'north'",
    PLATE.replace("glass", "cheese"): "target 1: material must be one of concrete,",
    PLATE.replace(
        "width = 1", "width = 0"
    ): "target 1: width of a plate must be between 0.001 and 200 m, got 0",
    PLATE.replace("width", "edge"): "target 1: size_m must have the keys width, height, got height, edge",
    PLATE + "rcs_dbsm = 3": "target 1: unknown key 'rcs_dbsm'",
    PLATE.replace("plate", "sphere").replace("{", "[1] #"): "target 1: unknown key 'elevation_deg'",
    '[[target]]\nkind = "point"\nposition_m = [0, 0, 0]\nrcs_dbsm = 1e9': "rcs_dbsm must be within -100",
    PLATE + "[[targets]]": "unknown key 'targets'; did you mean target?",
    "": "contains no",
    "target = 3": "target must be tables ([[target]]), got 3",
    "kind = ": "not valid TOML",
}


@pytest.mark.parametrize("text", BAD)
def test_errors_name_the_key_in_one_line(tmp_path: Path, text: str) -> None:
    with pytest.raises(SceneError) as message:
        read_targets(_file(tmp_path, text))
    assert "targets.toml: " in str(message.value)
    assert BAD[text] in str(message.value)
    assert "\n" not in str(message.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"none\.toml: cannot be read \(No such file"):
        read_targets(tmp_path / "none.toml")
