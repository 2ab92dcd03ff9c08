"""A file is whole or absent, whatever happens while it is written."""

import os
from pathlib import Path

import pytest

from echoscape.sim.datasets.files.atomic_write import (
    DatasetError,
    read_text,
    remove_temporaries,
    temporary_beside,
    write_atomic,
)


def test_a_file_is_replaced_and_nothing_else_is_left(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_bytes(b"before")
    write_atomic(tmp_path / "a.txt", b"after")
    assert (tmp_path / "a.txt").read_bytes() == b"after"
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]


def test_a_failed_write_leaves_the_file_of_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*arguments: object) -> None:
        raise KeyboardInterrupt

    (tmp_path / "a.txt").write_bytes(b"before")
    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(KeyboardInterrupt):
        write_atomic(tmp_path / "a.txt", b"after")
    assert (tmp_path / "a.txt").read_bytes() == b"before"
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]


def test_temporary_files_of_killed_runs_are_removed_and_no_others(tmp_path: Path) -> None:
    (tmp_path / "radar").mkdir()
    for path in (tmp_path / "radar" / "1.png", tmp_path / ".hidden", tmp_path / "a.part"):
        path.touch()
    temporary_beside(tmp_path / "radar" / "2.png").touch()
    remove_temporaries(tmp_path)
    kept = sorted(path.name for path in tmp_path.rglob("*") if path.is_file())
    assert kept == [".hidden", "1.png", "a.part"]


def test_text_that_cannot_be_read_is_refused_by_name(tmp_path: Path) -> None:
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00")
    for name in ("absent.csv", "binary.csv"):
        with pytest.raises(DatasetError, match=rf"{name}: cannot be read"):
            read_text(tmp_path / name)
