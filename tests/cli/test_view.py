"""`echoscape view`: one page and its size, or one line on what is wrong, and nothing left behind."""

from pathlib import Path

import pytest

from echoscape.cli.__main__ import main
from tests.eval.viewer.view_sets import START_US, TURN_US, write_set
from tests.paths import SHARED


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_set(tmp_path / "set")


def _refusal(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """The line by which the command refuses."""
    assert main(["view", *words]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    line = captured.err.splitlines()[-1]
    assert line.startswith("echoscape view: ")
    assert captured.err.count("echoscape view: ") == 1
    return line


def test_page_is_written_beside_the_data_and_its_size_is_printed(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["view", str(folder)]) == 0
    page = folder / "view.html"
    size_mb = page.stat().st_size / 1e6
    assert capsys.readouterr().out == f"{page}  {size_mb:.1f} MB\n"
    assert page.read_bytes().startswith(b"<!doctype html>")


def test_page_goes_where_out_says_with_the_same_bytes_each_time(folder: Path, tmp_path: Path) -> None:
    assert main(["view", str(folder), "--out", str(tmp_path / "a.html")]) == 0
    assert main(["view", str(folder), "--out", str(tmp_path / "b.html")]) == 0
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()
    assert not (folder / "view.html").exists()


def test_fewer_scans_and_columns_make_a_smaller_page(folder: Path, tmp_path: Path) -> None:
    sizes = []
    for number, words in enumerate(
        [["--scans", "3"], ["--scans", "1"], ["--scans", "1", "--columns", "100"]]
    ):
        out = tmp_path / f"{number}.html"
        assert main(["view", str(folder), "--out", str(out), *words]) == 0
        sizes.append(out.stat().st_size)
    assert sizes == sorted(sizes, reverse=True)
    assert len(set(sizes)) == 3


def test_truncated_scan_is_reported_by_name_and_the_old_page_stays(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "view.html").write_text("old")
    scan = folder / "radar" / f"{START_US + TURN_US}.png"
    scan.write_bytes(scan.read_bytes()[:200])
    before = sorted(folder.iterdir())
    assert f"{scan}: not a complete PNG file" in _refusal(capsys, str(folder))
    assert (folder / "view.html").read_text() == "old"
    assert sorted(folder.iterdir()) == before


def test_truncated_truth_is_reported_by_name(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    truth = folder / "truth" / f"{START_US}.npz"
    truth.write_bytes(truth.read_bytes()[:200])
    assert str(truth) in _refusal(capsys, str(folder))
    assert not (folder / "view.html").exists()


def test_folders_that_hold_no_scans_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "empty").mkdir()
    assert "no scans" in _refusal(capsys, str(tmp_path / "empty"))
    assert list((tmp_path / "empty").iterdir()) == []
    assert "no such folder" in _refusal(capsys, str(tmp_path / "absent"))
    assert not (tmp_path / "absent").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--scans 0", "scans must be 1 or more, got 0"),
        ("--every 0", "every must be 1 or more, got 0"),
        ("--columns -1", "columns must be 1 or more, got -1"),
        ("--columns many", "--columns"),
        ("--speed 3", "--speed"),
    ],
)
def test_bad_options_are_refused(
    folder: Path, capsys: pytest.CaptureFixture[str], words: str, message: str
) -> None:
    assert message in _refusal(capsys, str(folder), *words.split())
    assert not (folder / "view.html").exists()


def test_place_that_cannot_be_written_is_refused(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert "out must be a file in an existing folder" in _refusal(capsys, str(folder), "--out", str(tmp_path))
    absent = tmp_path / "absent" / "page.html"
    assert "out must be a file in an existing folder" in _refusal(capsys, str(folder), "--out", str(absent))


def test_real_scans_are_shown(tmp_path: Path) -> None:
    pair = SHARED / "real" / "oxford-pair"
    if not pair.is_dir():
        pytest.skip(f"needs real scans in {pair.parent.parent.name}/real/oxford-pair beside the checkout")
    assert main(["view", str(pair), "--out", str(tmp_path / "real.html")]) == 0
    assert b'"has_truth":false' in (tmp_path / "real.html").read_bytes()
