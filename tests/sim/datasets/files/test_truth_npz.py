"""Truth files: there and back, the same bytes, plain names, and errors for damage."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.files.truth_npz import NAMES, read_truth, truth_arrays, truth_bytes, write_truth
from echoscape.sim.datasets.polar_scan import ScanTruth
from tests.sim.scans import drawn_scan


def _truth(*, seed: int = 1, movers: int = 2) -> ScanTruth:
    truth = drawn_scan(seed=seed, movers=movers).truth
    assert truth is not None
    return truth


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("truth") / "17.npz"
    write_truth(path, _truth())
    return path


def _assert_same(read: ScanTruth, written: ScanTruth) -> None:
    assert read == written
    for part in ("cells", "boxes"):
        for name, array in vars(getattr(written, part)).items():
            assert getattr(getattr(read, part), name).dtype == array.dtype


def test_truth_is_read_as_it_was_written(archive: Path) -> None:
    _assert_same(read_truth(archive), _truth())


def test_truth_without_movers_is_read_as_it_was_written(tmp_path: Path) -> None:
    write_truth(tmp_path / "none.npz", _truth(movers=0))
    _assert_same(read_truth(tmp_path / "none.npz"), _truth(movers=0))


def test_small_instance_ids_take_two_bytes(tmp_path: Path) -> None:
    truth = _truth()
    small = replace(truth, cells=replace(truth.cells, instance=truth.cells.instance % 65_536))
    write_truth(tmp_path / "small.npz", small)
    with np.load(tmp_path / "small.npz") as arrays:
        assert arrays["instance"].dtype == np.uint16
    _assert_same(read_truth(tmp_path / "small.npz"), small)


def test_arrays_have_plain_names(archive: Path) -> None:
    with np.load(archive, allow_pickle=False) as arrays:
        assert tuple(arrays.files) == NAMES
        assert arrays["moving"].dtype == np.bool_
        np.testing.assert_array_equal(arrays["first_m"], _truth().first_obstacle_m)


def test_same_truth_gives_same_bytes() -> None:
    assert truth_bytes(_truth()) == truth_bytes(_truth())


def test_absent_truth_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"nowhere\.npz: no such truth"):
        read_truth(tmp_path / "nowhere.npz")


@pytest.mark.parametrize("kept", [0, 10, 20_000, -10])
def test_cut_truth_is_refused_by_name(archive: Path, tmp_path: Path, kept: int) -> None:
    (tmp_path / "cut.npz").write_bytes(archive.read_bytes()[:kept])
    with pytest.raises(DatasetError, match=r"cut\.npz: not a complete truth"):
        read_truth(tmp_path / "cut.npz")


def test_damaged_truth_is_refused_by_name(archive: Path, tmp_path: Path) -> None:
    data = bytearray(archive.read_bytes())
    data[5000:5100] = bytes(100)
    (tmp_path / "damaged.npz").write_bytes(data)
    with pytest.raises(DatasetError, match=r"damaged\.npz: not a complete truth"):
        read_truth(tmp_path / "damaged.npz")


@pytest.mark.parametrize("name", NAMES)
def test_truth_that_lacks_an_array_is_refused_by_name(tmp_path: Path, name: str) -> None:
    arrays = {each: values for each, values in truth_arrays(_truth()).items() if each != name}
    np.savez(tmp_path / "poor.npz", allow_pickle=False, **arrays)
    with pytest.raises(DatasetError, match=rf"poor\.npz: a truth file without {name}$"):
        read_truth(tmp_path / "poor.npz")


def test_flag_of_another_shape_is_refused_by_name(tmp_path: Path) -> None:
    truth = _truth()
    cut = replace(truth, cells=replace(truth.cells, displaced=truth.cells.displaced[:, :-1]))
    write_truth(tmp_path / "cut.npz", cut)
    with pytest.raises(DatasetError, match=r"cut\.npz: displaced has shape"):
        read_truth(tmp_path / "cut.npz")
