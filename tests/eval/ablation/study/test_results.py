"""Metrics of a result: each is its own statistic of the errors of pairs; damaged files are no results."""

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from echoscape.eval.ablation.study.results import METRICS, has_result, read_result, result_text
from echoscape.eval.odometry.interface import PairMotion
from echoscape.eval.odometry.run import OdometryResult, PairResult
from echoscape.sim.datasets.files.atomic_write import DatasetError


def straight(path: Path, ahead_m: ArrayLike, yaw_deg: ArrayLike, *, failed: int | None = None) -> Path:
    """Write the result of a straight drive, 1 m from scan to scan, with these estimates of its motions."""
    estimates: NDArray[np.float64] = np.stack(np.broadcast_arrays(ahead_m, np.radians(yaw_deg)), axis=-1)
    pairs = [
        PairResult(
            motion=None if index == failed else PairMotion(x_m=x, y_m=0.0, yaw_rad=yaw),
            failure="asked to" if index == failed else None,
            matches=None,
            seconds=0.1,
        )
        for index, (x, yaw) in enumerate(estimates.tolist())
    ]
    scans = len(pairs) + 1
    truth = np.stack([np.arange(scans), np.zeros(scans), np.zeros(scans)], axis=1)
    numbers = np.arange(scans) * 250_000
    result = OdometryResult(
        method="made up",
        names=tuple(numbers.tolist()),
        middle_us=numbers,
        pairs=tuple(pairs),
        truth=truth.astype(np.float64),
    )
    path.write_text(result_text(result))
    return path


def values(path: Path) -> dict[str, float | None]:
    content = read_result(path)
    return {each.name: each.of(content) for each in METRICS}


def test_every_metric_is_its_own_statistic(tmp_path: Path) -> None:
    """Errors 0.1, 0.2, 0.3, 0.4 m and a failed pair, which has all of its 1 m; 1, 2, 3, 10 deg and 0."""
    path = straight(tmp_path / "a.json", [1.1, 0.8, 1.3, 0.6, 5.0], [1.0, -2.0, 3.0, -10.0, 90.0], failed=4)
    found = values(path)
    assert found["translation_error_mean"] == pytest.approx((0.1 + 0.2 + 0.3 + 0.4 + 1.0) / 5)
    assert found["translation_error_median"] == pytest.approx(0.3)
    assert found["rotation_error_mean"] == pytest.approx((1 + 2 + 3 + 10 + 0) / 5)
    assert found["rotation_error_median"] == pytest.approx(2.0)
    assert found["failed_pairs"] == pytest.approx(20.0)
    assert found["translation_drift"] is found["rotation_drift"] is None  # 5 m hold no segment of 100 m


def test_drift_of_position_is_that_of_a_wrong_scale(tmp_path: Path) -> None:
    found = values(straight(tmp_path / "a.json", np.full(150, 1.02), 0.0))
    assert found["translation_drift"] == pytest.approx(2.0, rel=0.02)  # a segment may be 101 m
    assert found["rotation_drift"] == pytest.approx(0.0, abs=1e-9)


def test_drift_of_heading_is_that_of_a_steady_turn(tmp_path: Path) -> None:
    found = values(straight(tmp_path / "a.json", np.ones(150), 0.03))
    assert found["rotation_drift"] == pytest.approx(0.03, rel=0.02)
    # Far ends of a segment of 100 m lie off by half its turn.
    assert found["translation_drift"] == pytest.approx(100 * math.radians(3.0) / 2, rel=0.03)


@pytest.mark.parametrize(
    "damage",
    [
        lambda data: data[:50],
        lambda data: b"",
        lambda data: b"[]",
        lambda data: data.replace(b'"pairs": 3', b'"pairs": 0', 1),
        lambda data: data.replace(b'"translation_error_m_mean": 0.0', b'"translation_error_m_mean": "?"', 1),
        lambda data: b"\xff" + data,
    ],
    ids=["cut", "empty", "list", "no_pairs", "no_number", "no_text"],
)
def test_damaged_results_are_none(damage, tmp_path: Path) -> None:
    path = straight(tmp_path / "a.json", np.ones(3), 0.0)
    assert has_result(path)
    whole = path.read_bytes()
    path.write_bytes(damage(whole))
    assert path.read_bytes() != whole
    assert not has_result(path)
    with pytest.raises(DatasetError, match=r"a.json: no result of an ablation"):
        read_result(path)


def test_an_absent_result_is_none(tmp_path: Path) -> None:
    assert not has_result(tmp_path / "a.json")
