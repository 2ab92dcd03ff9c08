"""Plots of an odometry name what they show: the truth beside the estimate, the error at the end."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from numpy.typing import NDArray

from echoscape.eval.odometry import plots
from echoscape.eval.odometry.interface import MatchedPoints, PairMotion
from echoscape.eval.odometry.run import OdometryResult, PairResult
from tests.sim.scans import drawn_scan

STEP_M, PAIRS = 2.0, 5


@pytest.fixture(autouse=True)
def figures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plots, "png_bytes", lambda figure: figure)


def result(*, known: int) -> OdometryResult:
    """A straight drive whose steps are measured 0.1 m short, the truth known for its first scans."""
    truth: NDArray[np.float64] = np.zeros((PAIRS + 1, 3))
    truth[:, 0] = STEP_M * np.arange(PAIRS + 1)
    truth[known:] = np.nan
    motion = PairMotion(x_m=STEP_M - 0.1, y_m=0.0, yaw_rad=0.0)
    pair = PairResult(motion=motion, failure=None, matches=None, seconds=0.1)
    times_us = 250_000 * np.arange(PAIRS + 1)
    return OdometryResult(
        method="drawn",
        names=tuple(times_us.tolist()),
        middle_us=times_us,
        pairs=PAIRS * (pair,),
        truth=truth if known else None,
    )


def texts(figure: object) -> str:
    assert isinstance(figure, Figure)
    return "\n".join(text.get_text() for text in figure.texts)


def test_the_trajectory_says_how_far_its_end_is_from_the_truth() -> None:
    shown = texts(plots.trajectory_figure(result(known=PAIRS + 1)))
    assert "final position error: 0.50 m after 10 m" in shown
    for known in (0, PAIRS):
        assert "final" not in texts(plots.trajectory_figure(result(known=known)))


def test_a_pair_shows_the_true_motion_where_it_is_known() -> None:
    scan, motion = drawn_scan(), PairMotion(x_m=1.9, y_m=0.0, yaw_rad=np.deg2rad(0.5))
    bare = texts(plots.matches_figure(scan, scan, motion, title="pair"))
    assert "estimate: +1.900 m forward, +0.000 m right, yaw +0.500 deg" in bare
    assert "truth" not in bare
    true = np.array([2.0, -0.1, 0.0])
    both = texts(plots.matches_figure(scan, scan, motion, title="pair", true_motion=true))
    assert "truth: +2.000 m forward, -0.100 m right, yaw +0.000 deg" in both


@pytest.mark.parametrize("panels", [2, 3])
def test_the_texts_of_a_pair_stay_above_its_panels(panels: int) -> None:
    points = np.zeros((1, 2))
    matches = None if panels == 2 else MatchedPoints(earlier_m=points, later_m=points, weights=np.ones(1))
    scan = drawn_scan()
    motion = PairMotion(x_m=-1.9, y_m=-12.0, yaw_rad=-1.0, matches=matches)
    true = np.array([-2.0, -12.1, -1.1])
    figure = plots.matches_figure(scan, scan, motion, title="fourier, scans 100 and 101", true_motion=true)
    assert isinstance(figure, Figure)
    figure.canvas.draw()
    boxes = [axes.get_window_extent() for axes in figure.axes]
    assert len(boxes) == panels
    for text in figure.texts:
        extent = text.get_window_extent()
        assert extent.x0 >= boxes[0].x0 - 5
        assert extent.x1 <= boxes[-1].x1
        assert extent.y0 > max(box.y1 for box in boxes)


def test_each_error_over_time_has_its_own_name() -> None:
    figure = plots.pairs_figure(result(known=PAIRS + 1))
    assert isinstance(figure, Figure)
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert labels[3:] == ["translation error [m]", "rotation error [deg]"]
