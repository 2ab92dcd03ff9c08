"""Figures of an ablation show every condition where it belongs, whatever it costs, and fail on none."""

import io
import math
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.axes import Axes
from PIL import Image

from echoscape.eval.ablation.study import figures
from echoscape.eval.ablation.study.figures import curves_figure, summary_figure
from echoscape.eval.ablation.study.markdown_table import table_markdown
from echoscape.eval.ablation.study.report import report_page
from echoscape.eval.ablation.study.tables import ablation_rows
from tests.eval.ablation.study.studies import made_up, small_study


def drawn(data: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(data)))


@pytest.fixture
def points(monkeypatch: pytest.MonkeyPatch) -> list[tuple[list[float], list[float]]]:
    """The points of the curves that are drawn."""
    found: list[tuple[list[float], list[float]]] = []
    errorbar = Axes.errorbar

    def kept(self: Axes, x: list[float], y: np.ndarray, *arguments: object, **named: object) -> object:
        found.append((list(x), list(y)))
        return errorbar(self, x, y, *arguments, **named)  # type: ignore[arg-type]

    monkeypatch.setattr(Axes, "errorbar", kept)
    return found


STUDY = small_study("ghosts=4,0,2", "gain_step=-10", seeds=tuple(range(8)))


def test_curves_run_over_rising_strengths_through_the_default(
    points: list[tuple[list[float], list[float]]],
) -> None:
    rows = ablation_rows(STUDY, made_up(STUDY, cost_m={"ghosts=4": 0.3, "ghosts=0": -0.01}))
    curves_figure(STUDY, rows)
    ghosts, _, gain, _ = points  # translation and rotation of each
    assert ghosts[0] == [0, 1, 2, 3]
    assert ghosts[1] == pytest.approx([-0.01, 0.0, 0.0, 0.3], abs=2e-3)
    assert ghosts[1][1] == 0.0  # ghosts=1 is the default
    assert gain[1] == pytest.approx([0.0, 0.0], abs=2e-3)


def test_a_grid_is_cut_where_all_else_is_at_the_default(
    points: list[tuple[list[float], list[float]]],
) -> None:
    from echoscape.eval.ablation.study.conditions import chosen_levels, conditions
    from echoscape.sim.settings.artefacts import Artefacts
    from tests.eval.ablation.study.studies import SENSOR

    levels = chosen_levels(("ghosts=0,1", "speckle=0,1"), None)
    study = replace(STUDY, conditions=conditions(levels, Artefacts(), SENSOR, grid=True))
    costs = {"ghosts=0,speckle=1": 0.1, "ghosts=1,speckle=0": 0.2, "ghosts=0,speckle=0": 0.9}
    curves_figure(study, ablation_rows(study, made_up(study, cost_m=costs)))
    assert [y for _, y in points[::2]] == pytest.approx(np.array([[0.1, 0.0], [0.2, 0.0]]), abs=2e-3)
    points.clear()
    apart = replace(
        STUDY,
        conditions=conditions(chosen_levels(("ghosts=0", "speckle=0"), None), Artefacts(), SENSOR, grid=True),
    )
    rows = ablation_rows(apart, made_up(apart, cost_m={}))
    assert curves_figure(apart, rows) == summary_figure(apart, rows)
    assert points == []


@pytest.mark.parametrize("cost_m", [0.0, -0.019, 30.0])
def test_the_summary_is_drawn_for_any_cost(cost_m: float) -> None:
    rows = ablation_rows(STUDY, made_up(STUDY, cost_m={"ghosts=0": cost_m}))
    image = drawn(summary_figure(STUDY, rows))
    assert image.shape[1] == 1300
    assert len(np.unique(image.reshape(-1, 3), axis=0)) > 20


def test_a_single_drive_is_drawn_without_intervals() -> None:
    study = small_study("ghosts=0")
    rows = ablation_rows(study, made_up(study, cost_m={}))
    assert all(math.isnan(row.compared.low) for row in rows)
    assert drawn(summary_figure(study, rows)).ndim == 3
    assert drawn(curves_figure(study, rows)).ndim == 3


def test_every_method_has_a_colour() -> None:
    assert len(set(figures._COLOURS)) == len(figures._COLOURS) == 7


def test_clear_differences_are_marked_in_tables_and_page() -> None:
    rows = ablation_rows(STUDY, made_up(STUDY, cost_m={"ghosts=4": 0.3}))
    text = table_markdown(STUDY, rows)
    (line,) = [each for each in text.splitlines() if each.startswith("| ghosts ×4")]
    assert line.count("**+0.3") >= 1
    page = report_page(STUDY, rows, {"summary.png": b"png"})
    assert '<td class="clear">+0.30' in page
    assert "Caution" not in page
    assert "4 metrics" not in text


def test_drives_too_short_for_drift_have_none() -> None:
    rows = ablation_rows(STUDY, made_up(STUDY, cost_m={}, drift=False))
    assert {row.metric.name for row in rows if "drift" in row.metric.name} == set()
    assert "drift" not in table_markdown(STUDY, rows)


def test_the_summary_says_what_is_filled_only_where_an_interval_can_be_clear(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    said: list[str] = []
    monkeypatch.setattr(figures, "png_bytes", lambda figure: said.extend(t.get_text() for t in figure.texts))
    for drives in (1, 5, 6):
        study = small_study("ghosts=0", seeds=tuple(range(drives)))
        summary_figure(study, ablation_rows(study, made_up(study, cost_m={})))
    one, few, enough = (text for text in said if "of 2 scans" in text)
    assert one == "1 drive of 2 scans, no intervals"
    assert few == "5 drives of 2 scans; bars: 95 % over drives, too few for 95 %"
    assert enough == "6 drives of 2 scans; bars: 95 % over drives; filled: the interval leaves out 0"
