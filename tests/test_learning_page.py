"""docs/learning.md keeps its word: its examples run, and its table lists the entries of items."""

import re
from pathlib import Path

import pytest

from tests.learn.simulated import write_simulated
from tests.paths import ROOT

PAGE = (ROOT / "docs" / "learning.md").read_text()
TRAINING, KEYPOINTS = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)


def run(example: str) -> dict[str, object]:
    """Run an example and return its names."""
    names: dict[str, object] = {}
    exec(compile(example, "docs/learning.md", "exec"), names)
    return names


def test_a_network_of_ones_own_is_trained_in_a_dozen_lines(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import torch

    write_simulated(tmp_path / "OUT", scans=6)
    monkeypatch.chdir(tmp_path)
    assert len([line for line in TRAINING.splitlines() if line]) < 12
    names = run(TRAINING)
    loss, pairs = names["loss"], names["pairs"]
    assert isinstance(loss, torch.Tensor)
    assert loss.isfinite()
    assert pairs[0]["motion"][0] > 0.5  # pyright: ignore[reportIndexIssue]


def test_the_keypoints_of_the_page_are_printed(capsys: pytest.CaptureFixture[str]) -> None:
    run(KEYPOINTS)
    count, _, _, score = map(float, capsys.readouterr().out.split())
    assert count == 400
    assert 0.5 < score <= 1


def test_the_table_lists_every_entry(tmp_path: Path) -> None:
    from echoscape.learn import ScanPairs

    item = ScanPairs(write_simulated(tmp_path / "OUT", scans=2), pixel_m=2.0, size=32)[0]
    first_column = r"^\| (?:`Scan(?:Pairs|Folder)`)? ?\| (.*?) \|"
    listed = re.findall(r"`(\w+)`", " ".join(re.findall(first_column, PAGE, re.MULTILINE)))
    assert set(listed) == {*item, *item["source"]}
    assert all(f"`{name}`" in PAGE for name in item["source"]["labels"])
