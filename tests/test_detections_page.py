"""docs/detections.md keeps its word: its example runs, its defaults are the code's, it lists every method."""

import re
from pathlib import Path

import pytest

from echoscape.eval.detections.bootstrap import BLOCK_M, DRAWS
from echoscape.eval.detections.cfar import CfarSettings, OrderedCfarSettings
from echoscape.eval.detections.k_strongest import KStrongestSettings
from echoscape.eval.detections.precision_recall import LEVELS
from echoscape.eval.detections.registry import METHODS
from echoscape.eval.detections.report import TABLE_COLUMNS
from echoscape.eval.detections.targets import JudgeSettings
from echoscape.eval.statistics.intervals import CONFIDENCE, FEWEST
from tests.paths import ROOT

PAGE = (ROOT / "docs" / "detections.md").read_text()
TEXT = " ".join(PAGE.split())
(EXAMPLE,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)


def test_a_detector_of_ones_own_is_judged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    exec(compile(EXAMPLE, "docs/detections.md", "exec"), {})
    printed = capsys.readouterr().out
    found = re.findall(r"'precision': ([\d.]+), 'recall': ([\d.]+)", printed)
    assert all(0.1 < float(each) <= 1 for each in found[0])
    assert "'map_average_precision': None" in printed


def test_every_method_is_described_and_judged_in_the_example() -> None:
    described = re.findall(r"`(\w+)`", "".join(re.findall(r"^\| (`.*?) \|", PAGE, re.MULTILINE)))
    assert described == list(METHODS)
    assert f"--methods {','.join(METHODS)}" in PAGE
    (head,) = re.findall(r"^\| method \| a scan \|.*$", PAGE, re.MULTILINE)
    assert [each.strip() for each in head.strip("|").split("|")] == list(TABLE_COLUMNS.values())
    rows = PAGE.partition(head)[2].splitlines()[2 : 2 + len(METHODS)]
    assert [row.split()[1] for row in rows] == list(METHODS)


def test_numbers_in_the_text_are_the_defaults() -> None:
    judge, cfar, strongest = JudgeSettings(), CfarSettings(), KStrongestSettings()
    assert f"{judge.min_snr_db:g} dB (`--judge.min-snr-db`)" in TEXT
    assert f"{judge.tolerance_m:g} m (`--judge.tolerance-m`)" in TEXT
    assert f"{judge.near_m:g} m (`--judge.near-m`)" in TEXT
    assert f"from {cfar.guard_m:g} m to {cfar.guard_m + cfar.training_m:g} m on both sides" in TEXT
    assert f"the {100 * OrderedCfarSettings().rank:g} % quantile" in TEXT
    assert (
        f"the {strongest.k} strongest cells of an azimuth with codes of {2 * strongest.floor_db:g} or more"
        in TEXT
    )
    assert f"sorted into {LEVELS} levels" in TEXT
    assert f"at {100 * CONFIDENCE:g} %: percentiles of {DRAWS:,} resamplings" in TEXT
    assert f"A block is a way of {BLOCK_M:g} m or more" in TEXT
    assert f"{FEWEST} blocks are the fewest" in TEXT


def test_the_figure_is_small() -> None:
    assert (ROOT / "docs" / "detections.png").stat().st_size < 500_000
