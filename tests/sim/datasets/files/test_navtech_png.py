"""Scans as PNG files: byte by byte, there and back, and damage."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from PIL import Image

from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.files.navtech_png import read_png, write_png
from tests.sim.scans import START_US, drawn_scan


@pytest.fixture(scope="module")
def png(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("radar") / f"{START_US}.png"
    write_png(path, drawn_scan())
    return path


def test_image_has_time_encoder_validity_and_codes_in_their_columns(png: Path) -> None:
    scan = drawn_scan()
    with Image.open(png) as image:
        assert (image.mode, image.size) == ("L", (11 + 3768, 400))
        pixels = np.asarray(image)
    second = [int.from_bytes(bytes(pixels[row, :8]), "little") for row in range(400)]
    assert second == [START_US + 625 * row for row in range(400)]
    assert [int(pixels[row, 8]) + 256 * int(pixels[row, 9]) for row in (0, 1, 399)] == [13, 27, 5599]
    assert_array_equal(pixels[:, 10], np.where(scan.valid, 255, 0))
    assert_array_equal(pixels[:, 11:], scan.codes)


def test_scan_is_read_as_it_was_written(png: Path) -> None:
    written, read = drawn_scan(), read_png(png)
    for name in ("codes", "timestamp_us", "encoder", "valid"):
        assert_array_equal(getattr(read, name), getattr(written, name))
        assert getattr(read, name).dtype == getattr(written, name).dtype
    assert read.bin_m == written.bin_m


def test_same_scan_gives_same_bytes(png: Path, tmp_path: Path) -> None:
    write_png(tmp_path / "again.png", drawn_scan())
    assert (tmp_path / "again.png").read_bytes() == png.read_bytes()
    assert [path.name for path in tmp_path.iterdir()] == ["again.png"]


@pytest.mark.parametrize("kept", [0, 7, 100, 5000, -2000])
def test_cut_image_is_refused_by_name(png: Path, tmp_path: Path, kept: int) -> None:
    cut = tmp_path / "cut.png"
    cut.write_bytes(png.read_bytes()[:kept])
    with pytest.raises(DatasetError, match=r"cut\.png: not a complete PNG"):
        read_png(cut)


@pytest.mark.parametrize(
    ("mode", "size", "message"),
    [
        ("L", (3700, 400), r"3779 columns .* this file has 400 and 3700"),
        ("L", (3779, 399), r"400 rows .* this file has 399"),
        ("RGB", (3779, 400), "mode RGB"),
        ("I;16", (3779, 400), "mode I;16"),
    ],
)
def test_other_images_are_refused_by_name(
    tmp_path: Path, mode: str, size: tuple[int, int], message: str
) -> None:
    path = tmp_path / "other.png"
    Image.new(mode, size).save(path)
    with pytest.raises(DatasetError, match=rf"other\.png: .*{message}"):
        read_png(path)


def test_absent_image_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"nowhere\.png: no such scan"):
        read_png(tmp_path / "nowhere.png")
