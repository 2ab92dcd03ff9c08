"""The figure of keypoints shows each at its place, from above and forward up."""

import io
from pathlib import Path

import numpy as np
from PIL import Image, ImageColor

from echoscape.eval.figures.style import ACCENT
from echoscape.eval.methods.cen2018 import Cen2018
from echoscape.eval.methods.figure import REACH_M, keypoints_page, write_keypoints_figure
from tests.eval.drives import write_points
from tests.eval.methods.polar_scans import BIN_M, receiver_noise, scan_of_codes, with_echo


def dots(page: bytes) -> np.ndarray:
    """Rows and columns (N, 2) of the pixels of dots, as shares of a panel as wide as the page."""
    pixels = np.asarray(Image.open(io.BytesIO(page)).convert("RGB")).astype(int)
    off = np.abs(pixels - ImageColor.getrgb(ACCENT)).max(axis=-1)
    return np.argwhere(off < 10) / [len(pixels[0]), len(pixels[0])]


def test_a_target_to_the_right_is_drawn_to_the_right() -> None:
    scan = scan_of_codes(with_echo(receiver_noise(60, 1500), 15, 1199))
    found = dots(keypoints_page(scan, [Cen2018()]))
    shares = 0.01 + 0.98 * (REACH_M + np.array([0.0, 1199.5 * BIN_M])) / (2 * REACH_M)
    assert len(found) > 4
    # Three azimuths of 6 deg are 13 m wide at 60 m; the dots of 3 points are 0.006 of the page in radius.
    np.testing.assert_allclose(np.median(found[:, 1]), shares[1], atol=0.01)
    middle = np.median(found[:, 0]) - found[:, 0].min()
    assert middle < 7 / (2 * REACH_M) + 0.01


def test_the_figure_of_a_folder_has_a_panel_for_each_method(tmp_path: Path) -> None:
    folder = write_points(tmp_path / "pair", (2.0, 0.0, 0.0))
    write_keypoints_figure(folder, tmp_path / "keypoints.png", scan=1)
    with Image.open(tmp_path / "keypoints.png") as image:
        width, height = image.size
        page = np.asarray(image.convert("RGB")).astype(int)
    assert width > 1.5 * height
    at_dot = np.abs(page - ImageColor.getrgb(ACCENT)).max(axis=-1) < 10
    assert at_dot[:, : width // 2].sum() > 500
    assert at_dot[:, width // 2 :].sum() > 500
