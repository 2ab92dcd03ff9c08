"""Archives of arrays: NumPy opens them, equal arrays give equal bytes, damaged files are refused by name."""

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.files.npz import archive_bytes, ends_as_archive, read_archive

ARRAYS = {
    "table": np.arange(12, dtype=np.uint16).reshape(3, 4),
    "scalar": np.array(2.5),
    "empty": np.zeros((0, 3), np.float32),
    "turned": np.arange(6.0).reshape(2, 3).T,
}


def _written(folder: Path, content: bytes) -> Path:
    path = folder / "arrays.npz"
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("level", [0, 1, 9])
def test_numpy_opens_an_archive_with_the_same_arrays_in_their_order(level: int) -> None:
    with np.load(io.BytesIO(archive_bytes(ARRAYS, level=level)), allow_pickle=False) as archive:
        assert list(archive) == list(ARRAYS)
        for name, array in ARRAYS.items():
            assert archive[name].dtype == array.dtype
            assert archive[name].shape == array.shape
            assert np.array_equal(archive[name], array)


def test_archive_is_a_valid_zip_file_dated_1980() -> None:
    with zipfile.ZipFile(io.BytesIO(archive_bytes(ARRAYS, level=1))) as archive:
        assert archive.testzip() is None
        assert [entry.filename for entry in archive.infolist()] == [f"{name}.npy" for name in ARRAYS]
        for entry in archive.infolist():
            assert entry.date_time == (1980, 1, 1, 0, 0, 0)
            assert entry.compress_type == zipfile.ZIP_DEFLATED
            assert entry.compress_size > 0


def test_runs_of_bytes_are_packed_smaller_than_by_a_search_for_repetitions() -> None:
    labels = np.repeat(np.random.default_rng(2).integers(0, 7, 20_000, np.uint8), 20)
    searched = io.BytesIO()
    with zipfile.ZipFile(searched, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr("labels.npy", labels.tobytes())
    assert len(archive_bytes({"labels": labels}, level=1)) < 0.9 * len(searched.getvalue())


def test_equal_arrays_give_equal_bytes_whatever_their_order_in_memory() -> None:
    copies = {name: array.copy(order="C") for name, array in ARRAYS.items()}
    assert archive_bytes(copies, level=6) == archive_bytes(ARRAYS, level=6)


def test_arrays_are_read_by_name(tmp_path: Path) -> None:
    path = _written(tmp_path, archive_bytes(ARRAYS, level=1))
    found = read_archive(path, ("scalar", "table"), kind="table of codes")
    assert list(found) == ["scalar", "table"]
    assert np.array_equal(found["table"], ARRAYS["table"])


@pytest.mark.parametrize("share", [0.0, 0.3, 0.99])
def test_an_archive_cut_short_does_not_end_as_one_and_is_refused(tmp_path: Path, share: float) -> None:
    content = archive_bytes(ARRAYS, level=1)
    path = _written(tmp_path, content)
    assert ends_as_archive(path)
    path.write_bytes(content[: int(share * len(content))])
    assert not ends_as_archive(path)
    with pytest.raises(DatasetError, match=r"arrays\.npz: not a complete table of codes"):
        read_archive(path, ("table",), kind="table of codes")


def test_an_archive_damaged_inside_is_refused(tmp_path: Path) -> None:
    noise = np.random.default_rng(1).integers(0, 255, 4000, np.uint8)
    content = bytearray(archive_bytes({"noise": noise}, level=0))
    content[2000] ^= 1
    with pytest.raises(DatasetError, match="not a complete scan"):
        read_archive(_written(tmp_path, bytes(content)), ("noise",), kind="scan")


def test_absent_files_and_arrays_are_refused_by_name(tmp_path: Path) -> None:
    assert not ends_as_archive(tmp_path / "none.npz")
    with pytest.raises(DatasetError, match=r"none\.npz: no such scan"):
        read_archive(tmp_path / "none.npz", ("table",), kind="scan")
    path = _written(tmp_path, archive_bytes(ARRAYS, level=1))
    with pytest.raises(DatasetError, match=r"arrays\.npz: a scan without codes, times"):
        read_archive(path, ("table", "codes", "times"), kind="scan")


def test_pickled_objects_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "arrays.npz"
    np.savez(path, table=np.array([{"any": "object"}], dtype=object))
    with pytest.raises(DatasetError, match="not a complete scan"):
        read_archive(path, ("table",), kind="scan")
