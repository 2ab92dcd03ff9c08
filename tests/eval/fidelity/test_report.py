"""The score gives real scans their published values, and judges by the rules that it states."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from echoscape.cli.__main__ import main
from echoscape.eval.fidelity import figure
from echoscape.eval.fidelity.dataset_statistics import DatasetStatistics, measure
from echoscape.eval.fidelity.reference_values import TARGETS, Target, tolerance_of, widened
from echoscape.eval.fidelity.report import json_text, markdown
from echoscape.eval.fidelity.score import FidelityReport, fidelity_report, number_text, scores_of, verdict
from echoscape.sim.datasets.files.navtech_png import write_png
from echoscape.sim.datasets.layouts.oxford import write_timestamps
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.datasets.scan_folder import open_folder
from echoscape.sim.receiver import quantiser
from tests.paths import SHARED

REAL = SHARED / "real"

OF_OTHER_STREETS = {
    "mean_code_5_7.5_m",
    "code_p90_5_7.5_m",
    "code_p99_10_15_m",
}
"""Levels of two ranges, where these two scans show another street than the eleven behind the targets."""


@pytest.fixture(scope="module")
def pair() -> FidelityReport:
    if not (REAL / "oxford-pair").is_dir():
        pytest.skip("needs the real scans")
    return fidelity_report(open_folder(REAL / "oxford-pair"))


@pytest.fixture(scope="module")
def tiny(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two scans of noise with bright points, in the Oxford layout."""
    folder = tmp_path_factory.mktemp("data") / "tiny"
    (folder / "radar").mkdir(parents=True)
    rng = np.random.default_rng(11)
    stamps = (1_000_000_000_000_000, 1_000_000_000_250_000)
    for stamp in stamps:
        power = rng.exponential(1.6, (400, 3768))
        power[::40, 500:3700:300] = 10**6.0
        row_us = stamp + 625 * np.arange(400, dtype=np.int64)
        scan = PolarScan(
            codes=quantiser.codes(power),
            timestamp_us=row_us,
            encoder=(13 + 14 * np.arange(400)).astype(np.uint16),
            valid=np.ones(400, bool),
            bin_m=0.0432,
        )
        write_png(folder / "radar" / f"{stamp}.png", scan)
    write_timestamps(folder / "radar.timestamps", stamps)
    return folder


# ---------------------------------------------------------------------- real scans


def test_real_pair_has_the_published_values(pair: FidelityReport) -> None:
    off = {score.name for score in pair.scores if score.target and score.verdict != "pass"}
    assert off == OF_OTHER_STREETS


@pytest.mark.parametrize(
    ("name", "share"),
    [
        ("noise_code_0_percent", 0.01),
        ("noise_code_6_percent", 0.02),
        ("range_width_3_db_bins", 0.02),
        ("range_width_10_db_bins", 0.01),
        ("azimuth_width_3_db_deg", 0.03),
        ("azimuth_width_20_db_deg", 0.02),
        ("exceedance_6_db_percent", 0.02),
        ("maxima_58_per_scan", 0.02),
    ],
)
def test_real_pair_meets_what_hardly_depends_on_the_street(
    pair: FidelityReport, name: str, share: float
) -> None:
    target = TARGETS["cts350x"][name]
    found = pair.data.values[name]
    assert target.low * (1 - share) <= found <= target.high * (1 + share)


def test_real_scans_of_the_other_radar_have_their_noise_and_peak() -> None:
    if not (REAL / "mulran").is_dir():
        pytest.skip("needs the real scans")
    found = measure(open_folder(REAL / "mulran"))
    assert found.values["noise_mean_power"] == pytest.approx(1.5, abs=0.1)
    assert found.values["code_max"] == 135
    assert all(score.verdict == "pass" for score in scores_of(found, None) if score.target)


# ---------------------------------------------------------------------- verdicts


def _target(low: float, high: float, rule: str, tolerance: float) -> Target:
    return Target(name="x", low=low, high=high, rule=rule, tolerance=tolerance, source="s")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("target", "passing", "low", "high"),
    [
        (_target(10, 10, "share", 0.15), (8.5, 11.5), 8.4, 11.6),
        (_target(10, 10, "factor", 1.5), (10 / 1.5, 15.0), 6.6, 15.1),
        (_target(10, 10, "difference", 6), (4.0, 16.0), 3.9, 16.1),
        (_target(10, 20, "share", 0.10), (9.0, 15.0, 22.0), 8.9, 22.1),
        (_target(8, 36, "difference", 0), (8.0, 20.0, 36.0), 7.9, 36.1),
        (_target(-34, -34, "share", 0.10), (-37.4, -30.6), -37.5, -30.5),
    ],
)
def test_within_the_span_or_its_tolerance_passes(
    target: Target, passing: tuple[float, ...], low: float, high: float
) -> None:
    assert {verdict(value, target.limits) for value in passing} == {"pass"}
    assert verdict(low, target.limits) == "low"
    assert verdict(high, target.limits) == "high"
    assert verdict(math.nan, target.limits) == "unknown"


def test_stated_tolerances_are_those_in_force() -> None:
    assert tolerance_of("noise_code_6_percent") == ("share", 0.15)
    assert tolerance_of("range_width_3_db_bins") == ("share", 0.10)
    assert tolerance_of("azimuth_width_3_db_deg") == ("share", 0.10)
    assert tolerance_of("noise_correlation_lag_3") == ("difference", 0.05)
    assert tolerance_of("exceedance_20_db_percent") == ("factor", 1.5)
    assert tolerance_of("mean_code_20_30_m") == ("share", 0.25)
    assert tolerance_of("strongest_12_code") == ("difference", 6.0)
    assert tolerance_of("peaks_80_per_scan") == ("factor", 1.5)
    assert TARGETS["cts350x"]["spoke_azimuths_percent"].limits == (8.0, 36.0)
    assert widened(0.0, "factor", 1.5) == (0.0, 0.0)


def test_every_target_is_a_statistic_and_every_statistic_has_a_tolerance(tiny: Path) -> None:
    values = measure(open_folder(tiny)).values
    for targets in TARGETS.values():
        assert set(targets) <= set(values)
    assert all(tolerance_of(name) for name in values)


# ---------------------------------------------------------------------- a folder


@pytest.fixture(scope="module")
def found(tiny: Path) -> DatasetStatistics:
    return measure(open_folder(tiny))


def test_measurement_finds_what_was_planted(found: DatasetStatistics) -> None:
    assert found.scans == 2
    assert found.histogram.sum() == 2 * 400 * 3768
    assert found.values["isolated_peaks_per_scan"] == 10 * 11
    assert found.values["noise_correlation_lag_1"] == pytest.approx(0.0, abs=0.02)
    assert found.values["noise_correlation_scans"] == pytest.approx(0.0, abs=0.05)
    assert found.values["spoke_azimuths_percent"] == 0
    assert found.values["range_width_6_db_bins"] < 1.1
    assert found.values["azimuth_width_6_db_deg"] < 1.0


def test_folder_passes_against_itself(found: DatasetStatistics) -> None:
    scores = scores_of(found, found)
    assert all(score.reference_verdict == "pass" for score in scores if not math.isnan(score.value))
    assert any(score.verdict == "low" for score in scores)
    other = replace(found, values={**found.values, "mean_code": 2 * found.values["mean_code"]})
    assert [score.name for score in scores_of(found, other) if score.reference_verdict == "low"] == [
        "mean_code"
    ]


def test_sensor_without_targets_is_measured_without_verdicts(found: DatasetStatistics) -> None:
    scores = scores_of(replace(found, sensor="another"), None)
    assert len(scores) == len(found.values)
    result = FidelityReport(data=found, reference=None, scores=scores)
    assert (result.passed, result.judged) == (0, 0)
    assert "statistics pass" not in markdown(result)
    assert json.loads(json_text(result))["scores"][0]["verdict"] is None


def test_page_of_a_sensor_without_targets_says_that_nothing_was_compared(
    found: DatasetStatistics, monkeypatch: pytest.MonkeyPatch
) -> None:
    words: list[str] = []

    def texts_of(page: Figure) -> bytes:
        words.extend(text.get_text() for axes in page.axes for text in axes.texts)
        return b""

    monkeypatch.setattr(figure, "png_bytes", texts_of)
    data = replace(found, sensor="another")
    figure.fidelity_page(FidelityReport(data=data, reference=None, scores=scores_of(data, None)))
    assert "nothing to compare" in words
    assert "none" not in words
    figure.fidelity_page(FidelityReport(data=found, reference=None, scores=scores_of(found, None)))
    assert words.count("nothing to compare") == 1


def test_numbers_are_short() -> None:
    assert [number_text(value) for value in (0.123, 12.345, 4321.0, 7.0, math.nan, None)] == [
        "0.12", "12.3", "4321", "7", "-", "-",
    ]  # fmt: skip


# ---------------------------------------------------------------------- the command


def test_command_writes_table_numbers_and_plots(
    tiny: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "report"
    assert main(["fidelity", str(tiny), "--reference", str(tiny), "--out", str(out)]) == 0
    assert sorted(path.name for path in out.iterdir()) == ["fidelity.json", "fidelity.md", "fidelity.png"]
    content = json.loads((out / "fidelity.json").read_text())
    assert content["judged"] == len(TARGETS["cts350x"])
    assert len(content["data"]["histogram"]) == 256
    assert str(tiny.parent) not in (out / "fidelity.json").read_text()
    table = (out / "fidelity.md").read_text()
    assert "| noise code 0 percent |" in table
    with Image.open(out / "fidelity.png") as page:
        assert page.size == (1800, 1520)
    printed = capsys.readouterr().out
    assert "spoke azimuths percent" in printed
    assert f"of {content['judged']} statistics pass" in printed


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["DATA/no"], "no such folder"),
        (["DATA/empty"], "no scans"),
        (["DATA/empty", "--reference", "DATA/no"], "no scans"),
        (["DATA/empty", "--out", "DATA/file"], "OUT must be a folder"),
        (["DATA/empty", "--out", "DATA/file/deep"], "OUT must be a folder"),
        ([], "DATA"),
        (["DATA/empty", "--nothing"], "nothing"),
    ],
)
def test_bad_input_is_told_in_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], message: str
) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "file").write_text("")
    assert main(["fidelity", *(word.replace("DATA", str(tmp_path)) for word in words)]) == 2
    captured = capsys.readouterr()
    assert message in captured.err
    assert len(captured.err.splitlines()) == 1
    assert captured.out == ""
    assert sorted(path.name for path in tmp_path.iterdir()) == ["empty", "file"]


def test_broken_scan_leaves_no_report(tiny: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = tmp_path / "data"
    (data / "radar").mkdir(parents=True)
    names = sorted(path.name for path in (tiny / "radar").iterdir())
    (data / "radar" / names[0]).write_bytes((tiny / "radar" / names[0]).read_bytes())
    (data / "radar" / names[1]).write_bytes((tiny / "radar" / names[1]).read_bytes()[:5000])
    (data / "radar.timestamps").write_text("")
    assert main(["fidelity", str(data)]) == 2
    assert names[1] in capsys.readouterr().err
    assert not (data / "fidelity").exists()
