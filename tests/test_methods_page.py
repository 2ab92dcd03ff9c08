"""docs/methods.md keeps its word: its examples run, and it names every hand-made method."""

import re
from pathlib import Path

import pytest

from echoscape.eval.odometry.methods import HAND_MADE
from tests.eval.drives import write_points
from tests.paths import ROOT

PAGE = (ROOT / "docs" / "methods.md").read_text()
KEYPOINTS, ODOMETRY = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)


def run(example: str) -> dict[str, object]:
    """Run an example and return its names."""
    names: dict[str, object] = {}
    exec(compile(example, "docs/methods.md", "exec"), names)
    return names


def test_every_method_has_a_line() -> None:
    assert tuple(re.findall(r"^\| `(\w+)` \| .*(?:IEEE|ICRA)", PAGE, re.MULTILINE)) == HAND_MADE


def test_the_examples_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_points(tmp_path / "DATA", (2.0, 0.0, 0.0))
    monkeypatch.chdir(tmp_path)
    run(KEYPOINTS)
    count, farthest_m, score = map(float, capsys.readouterr().out.split())
    assert count > 200
    assert 30 < farthest_m < 90
    assert 4 < score <= 32
    run(ODOMETRY)
    x_m, agreeing, matches = re.findall(r"SE2\(x_m=([\d.]+).*\) (\d+) of (\d+)", capsys.readouterr().out)[0]
    assert float(x_m) == pytest.approx(2.0, abs=0.1)
    assert 100 < int(agreeing) <= int(matches)
