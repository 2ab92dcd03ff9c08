"""Output folders are refused before any work where they cannot be written, and taken away again."""

import os
from pathlib import Path

import pytest

from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.files.output_folder import (
    check_no_dataset,
    check_output_folder,
    make_output_folder,
    remove_output_folder,
)


def test_new_and_existing_folders_are_accepted(tmp_path: Path) -> None:
    check_output_folder(tmp_path / "new" / "deep", empty=True)
    check_output_folder(tmp_path, empty=True)
    (tmp_path / "file").touch()
    check_output_folder(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_a_folder_that_is_not_empty_is_refused_with_a_hint(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(DatasetError, match=r"OUT must be empty or new, .* is not$"):
        check_output_folder(tmp_path, empty=True)
    with pytest.raises(DatasetError, match=r"is not \(--resume goes on\)$"):
        check_output_folder(tmp_path, empty=True, hint="--resume goes on")


@pytest.mark.parametrize("below", ["", "deep", "deep/deeper"])
def test_a_file_in_the_place_of_a_folder_is_refused(tmp_path: Path, below: str) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(DatasetError, match=r"OUT must be a folder, .*file is a file"):
        check_output_folder(tmp_path / "file" / below)


def test_a_folder_that_cannot_be_written_to_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Whoever runs tests as root may write anywhere, so the answer of the system is replaced.
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path) != tmp_path)
    with pytest.raises(DatasetError, match=r"OUT cannot be made: .* cannot be written to"):
        check_output_folder(tmp_path / "new")


def test_removal_undoes_making_and_leaves_what_others_put_there(tmp_path: Path) -> None:
    out = tmp_path / "a" / "b" / "c"
    made = make_output_folder(out)
    assert made == [out, out.parent, out.parent.parent]
    (out / "inner").mkdir()
    (out / "inner" / "file").touch()
    (tmp_path / "a" / "other").touch()
    remove_output_folder(out, made)
    assert sorted(path.name for path in (tmp_path / "a").iterdir()) == ["other"]


def test_an_existing_folder_stays_when_the_output_is_removed(tmp_path: Path) -> None:
    made = make_output_folder(tmp_path)
    (tmp_path / "file").touch()
    remove_output_folder(tmp_path, made)
    assert made == []
    assert tmp_path.is_dir()
    assert not list(tmp_path.iterdir())


def test_results_are_not_written_into_a_data_set(tmp_path: Path) -> None:
    data, other, out = (tmp_path / name for name in ("data", "other", "out"))
    for folder in (data, other):
        folder.mkdir()
    (other / "echoscape.json").touch()
    check_no_dataset(out, data)
    check_no_dataset(data / "results", data)
    for folder in (data, tmp_path / "other" / ".." / "data", other):
        with pytest.raises(DatasetError, match=f"OUT must not be a data set, {folder} is one"):
            check_no_dataset(folder, data)
