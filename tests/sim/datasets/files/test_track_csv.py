"""tracks.csv says where car and movers are, and how the body of the car is tilted; older tables open too."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from echoscape.scenes.core.attitude import Attitude
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.files.track_csv import TRACK_COLUMNS, read_car_track, tracks_csv
from tests.sim.worlds import box_prototype, mover, straight

TIMES_S = np.arange(0.0, 1.0, 0.25)
CAR = straight([1.0, 2.0], [4.0, 0.0]).trajectory
ATTITUDE = Attitude(
    time_s=np.array([0.0, 1.0]),
    angle_rad=np.array([[0.0, 0.02], [0.01, 0.02]]),
    rate_rps=np.full((2, 2), [0.01, 0]),
)
TILTED = replace(CAR, attitude=ATTITUDE)
MOVER = mover(7, box_prototype("box", (4.0, 1.8, 1.5), "metal"), straight([9.0, 0.0], [0.0, 3.0]))


EPOCH_US = 1_650_000_000_000_000


def rows(text: str, instance: int) -> np.ndarray:
    lines = [line.split(",") for line in text.splitlines()[1:]]
    return np.array([[float(word) for word in words] for words in lines if words[1] == str(instance)])


def test_car_has_its_attitude_and_movers_are_level() -> None:
    text = tracks_csv(TILTED, [MOVER], TIMES_S, epoch_us=EPOCH_US)
    assert text.splitlines()[0] == TRACK_COLUMNS
    assert TRACK_COLUMNS.split(",")[9:] == ["pitch_rad", "roll_rad"]
    car = rows(text, 0)
    assert_allclose(car[:, 0], EPOCH_US + 1e6 * TIMES_S)
    assert_allclose(car[:, 9], 0.01 * TIMES_S, atol=6e-5)
    assert_allclose(car[:, 10], 0.02)
    assert not rows(text, 7)[:, 9:].any()


def test_strength_scales_the_attitude_alone() -> None:
    whole, half = (
        rows(tracks_csv(TILTED, [], TIMES_S, epoch_us=EPOCH_US, attitude=share), 0) for share in (1.0, 0.5)
    )
    assert_allclose(half[:, 10], 0.01)
    assert_allclose(half[:, :9], whole[:, :9])


def test_velocity_is_read_from_tables_with_and_without_attitude(tmp_path: Path) -> None:
    text = tracks_csv(TILTED, [MOVER], TIMES_S, epoch_us=EPOCH_US)
    older = "\n".join(",".join(line.split(",")[:9]) for line in text.splitlines()) + "\n"
    (tmp_path / "new.csv").write_text(text)
    (tmp_path / "old.csv").write_text(older)
    for name in ("new.csv", "old.csv"):
        found = read_car_track(tmp_path / name).velocity(np.array([EPOCH_US + 300_000]))
        assert_allclose(found, [[4.0, 0.0, 0.0]])


def test_another_header_is_refused(tmp_path: Path) -> None:
    (tmp_path / "tracks.csv").write_text(TRACK_COLUMNS + ",yaw\n")
    with pytest.raises(DatasetError, match="the header is not"):
        read_car_track(tmp_path / "tracks.csv")
