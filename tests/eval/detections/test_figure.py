"""The figure of judged detectors: shares up to 100 %, with the numbers behind them."""

from pathlib import Path

import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from echoscape.eval.detections import figure
from echoscape.eval.detections.registry import MethodSettings, build_detectors
from echoscape.eval.detections.run import DetectionResult, judge_detectors
from echoscape.eval.detections.targets import TARGET
from echoscape.sim.datasets.scan_folder import open_folder
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.dataset import write_dataset
from echoscape.sim.sensor.cts_small import CTS_SMALL
from echoscape.sim.settings.tracing import TraceSettings


@pytest.fixture
def judged(tmp_path: Path) -> DetectionResult:
    config = SimulationConfig(preset="yard", seed=3, scans=3, sensor=CTS_SMALL, trace=TraceSettings(rays=64))
    write_dataset(tmp_path / "yard", config)
    folder = open_folder(tmp_path / "yard")
    return judge_detectors(folder, build_detectors(["cfar", "kstrongest"], MethodSettings(), folder.sensor))


def titled(page: Figure, name: str) -> Axes:
    """The axes of this title."""
    (found,) = (axes for axes in page.axes if name in [text.get_text() for text in axes.texts])
    return found


def test_shares_end_at_100_and_the_drawn_scan_is_counted_from_0(
    judged: DetectionResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    pages: list[Figure] = []
    monkeypatch.setattr(figure, "png_bytes", lambda page: pages.append(page) or b"")
    figure.detections_page(judged)
    alarms = titled(pages[0], "False alarms by cause")
    assert alarms.get_xlim() == (0, 100)
    for method, label in zip(judged.methods, alarms.get_yticklabels(), strict=True):
        counts = method.blocks.total.labels.sum(axis=-1)
        found, false = counts.sum(), counts.sum() - counts[TARGET]
        assert label.get_text() == f"{method.name}\n{false / 3:.0f} of {found / 3:.0f}"
    shown = [text.get_text() for text in titled(pages[0], "cfar").texts]
    assert any(text.startswith("scan 1 (from 0): ") for text in shown)
