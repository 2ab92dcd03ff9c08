"""A scan in grey from above: forward up, right right, true to scale."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from echoscape.eval.figures.scan_image import scan_image, write_scan_image
from echoscape.sim.datasets.files.navtech_png import write_png
from tests.sim.scans import drawn_scan


def _point(azimuth: int, range_m: float):
    codes = np.zeros((400, 3768), np.uint8)
    column = round(range_m / 0.0432)
    codes[azimuth - 1 : azimuth + 2, column - 12 : column + 13] = 84
    return replace(drawn_scan(), codes=codes)


@pytest.mark.parametrize(("azimuth", "right", "up"), [(100, 1, 0), (200, 0, -1), (300, -1, 0)])
def test_a_point_lies_where_its_azimuth_looks(azimuth: int, right: int, up: int) -> None:
    image = scan_image(_point(azimuth, 100.0), pixels=900)
    # 2.25 pixels a metre: 900 of them for 400 m, and 162.8 m to both sides of the radar.
    assert image.shape == (2 * round(162.7776 * 2.25), 900)
    v, u = np.nonzero(image > 100)
    middle = ((image.shape[0] - 1) / 2, (image.shape[1] - 1) / 2)
    # The first azimuth looks along 13 / 5600 of a revolution, 0.84 deg to the right of ahead.
    aside = 225 * math.radians(0.836)
    assert u.mean() - middle[1] == pytest.approx(225 * right + aside * up, abs=1)
    assert middle[0] - v.mean() == pytest.approx(225 * up - aside * right, abs=1)
    assert image.max() == 255


def test_the_scale_bar_is_50_m_long(tmp_path: Path) -> None:
    folder = tmp_path / "radar"
    folder.mkdir()
    scan = _point(100, 20.0)
    write_png(folder / f"{scan.timestamp_us[0]}.png", replace(scan, valid=np.ones(400, np.bool_)))
    write_scan_image(folder, tmp_path / "scan.png", pixels=800)
    with Image.open(tmp_path / "scan.png") as file:
        assert file.mode == "L"
        image = np.asarray(file)
    line = image[round(image.shape[0] * 0.98)]
    assert np.count_nonzero(line) == pytest.approx(100, abs=2)
    with pytest.raises(ValueError, match="scan must be between 0 and 0, got 1"):
        write_scan_image(folder, tmp_path / "no.png", scan=1)
    with pytest.raises(ValueError, match="pixels must be 100 or more, got 10"):
        write_scan_image(folder, tmp_path / "no.png", pixels=10)
    assert not (tmp_path / "no.png").exists()
