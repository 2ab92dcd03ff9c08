"""The map in CONTRIBUTING.md: every file exists, and none is named twice."""

import re

from tests.paths import ROOT

PAGE = (ROOT / "CONTRIBUTING.md").read_text()
STEPS = re.findall(r"^\| [^|]+ \| (.+?) \|$", PAGE, re.MULTILINE)
FILES = [step.strip("`") for step in STEPS if step.startswith("`")]


def test_each_step_names_one_file_that_exists() -> None:
    assert len(FILES) == len([step for step in STEPS if step not in ("file", "---")])
    assert len(FILES) > 20
    assert [file for file in FILES if not (ROOT / file).is_file()] == []


def test_no_file_is_named_twice() -> None:
    assert sorted(set(FILES)) == sorted(FILES)


def test_the_walks_reach_their_ends() -> None:
    walks = [re.findall(r"\| `(\S+)` \|", part) for part in PAGE.split("### ")[1:]]
    ends = [(walk[0], walk[-1]) for walk in walks]
    assert ends == [
        ("scenes/town/build.py", "sim/datasets/files/navtech_png.py"),
        ("scenes/io/osm/elements/reading.py", "scenes/io/osm/ground.py"),
        ("sim/datasets/scan_folder.py", "eval/odometry/kitti_drift.py"),
        ("eval/methods/cen2018.py", "eval/methods/figure.py"),
        ("eval/ablation/study/conditions.py", "eval/ablation/study/report.py"),
        ("eval/detections/interface.py", "eval/detections/report.py"),
        ("testing/plugin.py", "testing/golden_figure.py"),
    ]
