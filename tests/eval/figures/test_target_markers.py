"""Targets in the preview of a dataset: in their places, with their colour, and none where there are none."""

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from PIL import Image

from echoscape.cli.__main__ import main
from echoscape.eval.figures.frame import read_frame
from echoscape.eval.figures.style import TARGET_COLOUR
from echoscape.eval.figures.target_markers import target_marks
from echoscape.scenes.core.targets import Target
from echoscape.sim.datasets.files.atomic_write import DatasetError

START = np.array([100.0, 50.0, 0.0, np.pi / 2])
"""The car begins at (100, 50) and looks north."""
NEAR = json.loads(json.dumps(asdict(Target(kind="sphere", position_m=(20.0, 4.0, 1.5), size_m=(0.3,)))))
SIDE = 555
PLAN = np.s_[127 : 127 + SIDE, 1205 : 1205 + SIDE]
"""The plan's pixels: the third image in the upper part of the page."""
TARGETS = """
[[target]]
kind = "point"
frame = "start"
position_m = [30, -20, 1.9]
"""


def test_marks_stand_where_the_targets_do() -> None:
    config = {
        "targets": [{"target": NEAR}, NEAR],
        "scene": {"targets": [NEAR | {"position_m": [1.0, 2.0, 0.5]}]},
    }
    marks = target_marks({"config": config}, start=START)
    # 20 m ahead is north, 4 m to the right is east.
    assert_allclose([(mark.x_m, mark.y_m) for mark in marks], [(1, 2), (104, 70), (20, 4)], atol=1e-9)
    assert {mark.kind for mark in marks} == {"sphere"}
    assert target_marks({"config": {"scene": None}}, start=START) == ()
    with pytest.raises(DatasetError, match=r"echoscape\.json: config\.targets\[0\]: kind must be one of"):
        target_marks({"config": {"targets": [NEAR | {"kind": "ufo"}]}}, start=START)


def _preview(folder: Path, *words: str) -> np.ndarray:
    small = ["--preset", "empty", "--seed", "3", "--scans", "1", "--trace.rays", "16"]
    assert main(["simulate", str(folder), *small, *words]) == 0
    with Image.open(folder / "preview.png") as page:
        return np.asarray(page.convert("RGB")).astype(int)


def test_preview_has_a_cross_where_the_target_stands(tmp_path: Path) -> None:
    (tmp_path / "targets.toml").write_text(TARGETS)
    bare = _preview(tmp_path / "bare")
    marked = _preview(tmp_path / "marked", "--targets", str(tmp_path / "targets.toml"))
    colour = np.array([int(TARGET_COLOUR[i : i + 2], 16) for i in (1, 3, 5)])
    found, none = (np.argwhere(np.abs(page[PLAN] - colour).max(axis=2) < 12) for page in (marked, bare))
    assert len(none) == 0
    assert 20 < len(found) < 400
    # The plan is a square of 260 m about the only mid-scan; the target is forward and left of the start.
    frame = read_frame(tmp_path / "marked", 0)
    x, y, _, yaw = frame.truth.pose[0]
    place = np.array([x + 30 * np.cos(yaw) - 20 * np.sin(yaw), y + 30 * np.sin(yaw) + 20 * np.cos(yaw)])
    pixel_m = 260 / SIDE
    down, right = (found.mean(axis=0) - (SIDE - 1) / 2) * pixel_m
    assert_allclose((right, -down), place - frame.path[0, :2], atol=1.0)
