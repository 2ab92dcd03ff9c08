"""Beat files: there and back, the same bytes, plain names, and errors for damage."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from echoscape.sim.datasets.beat_signal import BeatSignal
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.files.beat_npz import beat_bytes, read_beat, write_beat
from echoscape.sim.sensor.cts350x import CTS350X

SENSOR = replace(CTS350X, azimuths=40)


def _drawn() -> BeatSignal:
    rng = np.random.default_rng(4)
    samples = rng.integers(-32768, 32767, (SENSOR.azimuths, SENSOR.samples), np.int16, endpoint=True)
    return BeatSignal(samples=samples, scale=rng.uniform(1e-9, 1e-6, SENSOR.azimuths).astype(np.float32))


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("beat") / "17.npz"
    write_beat(path, _drawn())
    return path


def test_beat_is_read_as_it_was_written(archive: Path) -> None:
    read, written = read_beat(archive, sensor=SENSOR), _drawn()
    assert_array_equal(read.samples, written.samples)
    assert_array_equal(read.scale, written.scale)


def test_arrays_have_plain_names_and_types(archive: Path) -> None:
    with np.load(archive, allow_pickle=False) as arrays:
        assert {name: arrays[name].dtype.str for name in arrays.files} == {"samples": "<i2", "scale": "<f4"}


def test_same_beat_gives_same_bytes() -> None:
    assert beat_bytes(_drawn()) == beat_bytes(_drawn())


def test_absent_beat_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"nowhere\.npz: no such beat file"):
        read_beat(tmp_path / "nowhere.npz")


@pytest.mark.parametrize("left", [0, 10, 20_000, -10])
def test_cut_beat_is_refused_by_name(archive: Path, tmp_path: Path, left: int) -> None:
    (tmp_path / "cut.npz").write_bytes(archive.read_bytes()[:left])
    with pytest.raises(DatasetError, match=r"cut\.npz: not a complete beat file"):
        read_beat(tmp_path / "cut.npz", sensor=SENSOR)


def test_damaged_beat_is_refused_by_name(archive: Path, tmp_path: Path) -> None:
    data = bytearray(archive.read_bytes())
    data[5000:5100] = bytes(100)
    (tmp_path / "damaged.npz").write_bytes(data)
    with pytest.raises(DatasetError, match=r"damaged\.npz: not a complete beat file"):
        read_beat(tmp_path / "damaged.npz", sensor=SENSOR)


def test_other_sensors_beat_is_refused_with_both_shapes(archive: Path) -> None:
    with pytest.raises(
        DatasetError, match=r"17\.npz: samples of cts350x have shape \(400, 1500\), these have \(40, 1500\)"
    ):
        read_beat(archive)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"scale": None}, r"wrong\.npz: a beat file without scale"),
        (
            {"samples": np.zeros((40, 1500), np.float32)},
            r"wrong\.npz: samples must be .* int16, got .* float32",
        ),
        ({"samples": np.zeros((40, 1500), ">i2")}, r"wrong\.npz: samples must be .* int16, got .* >i2"),
        ({"scale": np.ones(40)}, r"wrong\.npz: scale must be \(40,\) float32, got \(40,\) float64"),
        ({"scale": np.ones(39, np.float32)}, r"wrong\.npz: scale must be \(40,\) float32, got \(39,\)"),
        ({"scale": np.zeros(40, np.float32)}, r"wrong\.npz: scale must be finite and above 0"),
    ],
)
def test_wrong_array_is_refused_by_name(tmp_path: Path, change: dict, message: str) -> None:
    arrays = {"samples": _drawn().samples, "scale": _drawn().scale} | change
    np.savez(tmp_path / "wrong.npz", **{name: each for name, each in arrays.items() if each is not None})
    with pytest.raises(DatasetError, match=message):
        read_beat(tmp_path / "wrong.npz", sensor=SENSOR)
