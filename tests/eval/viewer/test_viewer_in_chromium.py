"""The page in a browser, driven by keys and clicks: what is drawn is what the data set holds.

Needs Chromium on the PATH (Debian: apt-get install chromium); without one these tests are skipped.
"""

import json
import math
from collections.abc import Iterator
from pathlib import Path

import pytest
from matplotlib.colors import to_rgb

from echoscape.eval.figures.style import COMPONENT_COLOURS
from echoscape.eval.viewer.data import view_of
from echoscape.eval.viewer.html import page_bytes
from tests.eval.viewer.chromium import NAMES, Chromium, chromium_path
from tests.eval.viewer.view_sets import (
    BOX_FORWARD_M,
    BOX_INSTANCE,
    BOX_RIGHT_M,
    SENSOR,
    STEP_M,
    YAW,
    write_set,
)

BINARY = chromium_path()

pytestmark = pytest.mark.skipif(
    BINARY is None, reason=f"no browser on the PATH, looked for {', '.join(NAMES)} (apt-get install chromium)"
)

REACH_M = SENSOR.bins // 2 * 2 * SENSOR.bin_m
"""Reach of the first image [m]: 500 drawn cells of two bins."""
BLOCK = (20.7, 0.0)
"""Right and forward [m] of the middle of the block of echoes."""
DARK = [11, 14, 19]
"""The colour of code 0."""
DIRECT = [round(255 * part) for part in to_rgb(COMPONENT_COLOURS["direct"])]


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chromium]:
    assert BINARY is not None
    with Chromium(BINARY, tmp_path_factory.mktemp("profile")) as browser:
        yield browser


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> str:
    folder = write_set(tmp_path_factory.mktemp("data") / "set", scans=4)
    (folder / "view.html").write_bytes(page_bytes(view_of(folder)))
    return (folder / "view.html").as_uri()


@pytest.fixture
def page(browser: Chromium, address: str) -> Iterator[Chromium]:
    """The page at its first scan; at the end it has no errors and has requested nothing by network."""
    browser.errors.clear()
    browser.requests.clear()
    browser.open(address)
    _wait_for_scan(browser, 0)
    yield browser
    assert browser.errors == []
    assert [url for url in browser.requests if not url.startswith(("file:", "data:"))] == []


def _wait_for_scan(page: Chromium, number: int) -> None:
    page.wait_for(f"document.body.dataset.scan === '{number}'")


def _colour(page: Chromium, right_m: float, forward_m: float, reach_m: float = REACH_M) -> list[int]:
    """The colour that the canvas has where something stands, from above and heading up."""
    x, y = 0.5 + right_m / (2 * reach_m), 0.5 - forward_m / (2 * reach_m)
    return page.value(
        "(() => { const image = document.getElementById('image'), side = image.width; "
        "const pixel = new OffscreenCanvas(1, 1).getContext('2d', {willReadFrequently: true}); "
        f"pixel.drawImage(image, Math.floor({x} * side), Math.floor({y} * side), 1, 1, 0, 0, 1, 1); "
        "return [...pixel.getImageData(0, 0, 1, 1).data].slice(0, 3); })()"
    )


def _middle(page: Chromium, selector: str) -> tuple[float, float]:
    """The middle of an element in shares of the stage, from its upper left corner."""
    x, y = page.value(
        f"(() => {{ const b = document.querySelector({json.dumps(selector)}).getBoundingClientRect(), "
        "s = document.getElementById('stage').getBoundingClientRect(); "
        "return [(b.x + b.width / 2 - s.x) / s.width, (b.y + b.height / 2 - s.y) / s.height]; })()"
    )
    return x, y


def _text(page: Chromium, identifier: str) -> str:
    return page.value(f"document.getElementById('{identifier}').textContent")


def _bright(colour: list[int]) -> bool:
    return sum(colour) > 500


def test_echoes_stand_where_they_are(page: Chromium) -> None:
    assert _bright(_colour(page, *BLOCK))
    for right, forward in ((-BLOCK[0], 0.0), (0.0, BLOCK[0]), (0.0, -BLOCK[0]), (24.0, 0.0), (17.0, 0.0)):
        assert _colour(page, right, forward) == DARK


def test_arrow_keys_and_buttons_step(page: Chromium) -> None:
    page.press("ArrowRight")
    _wait_for_scan(page, 1)
    assert _colour(page, *BLOCK) == DARK  # no block in odd scans
    page.click_on("#forth")
    _wait_for_scan(page, 2)
    assert _bright(_colour(page, *BLOCK))
    page.press("End")
    _wait_for_scan(page, 3)
    page.click_on("#back")
    _wait_for_scan(page, 2)
    page.press("Home")
    _wait_for_scan(page, 0)
    assert _text(page, "place") == "1 / 4"


def test_slider_goes_to_a_scan(page: Chromium) -> None:
    left, top, width, height = page.value(
        "(b => [b.x, b.y, b.width, b.height])(document.getElementById('slider').getBoundingClientRect())"
    )
    page.click(left + width - 3, top + height / 2)
    _wait_for_scan(page, 3)


def test_space_plays_and_pauses(page: Chromium) -> None:
    page.value("document.getElementById('pace').value = '4'")
    page.press(" ")
    _wait_for_scan(page, 2)
    page.press(" ")
    assert page.value("document.getElementById('play').getAttribute('aria-label')") == "Play"
    page.value("new Promise(done => setTimeout(done, 300))")  # the scan that was on its way has come
    number = page.value("document.body.dataset.scan")
    page.value("new Promise(done => setTimeout(done, 300))")
    assert page.value("document.body.dataset.scan") == number


def test_overlays_colour_what_truth_names_and_nothing_else(page: Chromium) -> None:
    plain = _colour(page, *BLOCK)
    seen = {}
    for overlay in ("component", "class", "moving", "bounces"):
        page.click_on(f"input[name=overlay][value={overlay}]")
        seen[overlay] = _colour(page, *BLOCK)
        assert _colour(page, -BLOCK[0], 0.0) == DARK
    assert plain not in seen.values()
    # At 85 % over the echo's own colour, which is nearly white.
    mixed = [0.85 * above + 0.15 * below for above, below in zip(DIRECT, plain, strict=True)]
    assert seen["component"] == pytest.approx(mixed, abs=12)
    page.press("o")
    assert _colour(page, *BLOCK) == plain
    page.press("o")
    assert _colour(page, *BLOCK) == seen["bounces"]


def test_legend_lists_what_occurs_and_says_what_a_ghost_is(page: Chromium) -> None:
    page.click_on("input[name=overlay][value=component]")
    assert _text(page, "legend") == "direct"
    assert "where none of its surfaces is" in _text(page, "legend-note")
    page.click_on("input[name=overlay][value=class]")
    assert (_text(page, "legend"), _text(page, "legend-note")) == ("vehicle", "")


def test_opacity_fades_the_overlay(page: Chromium) -> None:
    plain = _colour(page, *BLOCK)
    page.click_on("input[name=overlay][value=moving]")
    page.value(
        "(e => { e.value = 0; e.dispatchEvent(new Event('input')); })(document.getElementById('opacity'))"
    )
    assert _colour(page, *BLOCK) == plain


def test_box_is_drawn_where_it_stands(page: Chromium) -> None:
    box = f"#marks [data-instance='{BOX_INSTANCE}']"
    x, y = _middle(page, box)
    assert x == pytest.approx(0.5 + BOX_RIGHT_M / (2 * REACH_M), abs=0.003)
    assert y == pytest.approx(0.5 - BOX_FORWARD_M / (2 * REACH_M), abs=0.003)
    page.press("b")
    assert page.value(f"document.querySelector({json.dumps(box)})") is None


def test_north_up_rotates_image_and_boxes_alike(page: Chromium) -> None:
    page.press("n")
    east = math.cos(YAW) * BOX_FORWARD_M + math.sin(YAW) * BOX_RIGHT_M
    north = math.sin(YAW) * BOX_FORWARD_M - math.cos(YAW) * BOX_RIGHT_M
    x, y = _middle(page, f"#marks [data-instance='{BOX_INSTANCE}']")
    assert x == pytest.approx(0.5 + east / (2 * REACH_M), abs=0.003)
    assert y == pytest.approx(0.5 - north / (2 * REACH_M), abs=0.003)
    right, forward = BLOCK  # and what was to the right of a car that looks north-west is north-east
    assert _bright(_colour(page, right * math.sin(YAW), -right * math.cos(YAW)))
    assert _colour(page, right, forward) == DARK


def test_polar_image_has_range_across_and_azimuth_down(page: Chromium) -> None:
    page.press("p")
    assert _bright(_colour_at(page, BLOCK[0] / REACH_M, 0.25))
    assert _colour_at(page, BLOCK[0] / REACH_M, 0.75) == DARK
    x, y = _middle(page, f"#marks [data-instance='{BOX_INSTANCE}']")
    assert x == pytest.approx(math.hypot(BOX_FORWARD_M, BOX_RIGHT_M) / REACH_M, abs=0.01)
    assert y == pytest.approx(math.atan2(BOX_RIGHT_M, BOX_FORWARD_M) / (2 * math.pi), abs=0.01)


def _colour_at(page: Chromium, x: float, y: float) -> list[int]:
    return _colour(page, (x - 0.5) * 2, (0.5 - y) * 2, reach_m=1.0)


def test_reach_zooms(page: Chromium) -> None:
    page.press("+")
    assert _bright(_colour(page, *BLOCK, reach_m=REACH_M / 1.25))
    assert not _bright(_colour(page, *BLOCK))


def test_pointer_on_a_cell_or_a_box_shows_its_values(page: Chromium) -> None:
    page.press("b")
    left, top, side = page.value(
        "(b => [b.x, b.y, b.width])(document.getElementById('stage').getBoundingClientRect())"
    )
    page.point(left + side * (0.5 + BLOCK[0] / (2 * REACH_M)), top + side * 0.5)
    page.wait_for("!document.getElementById('readout').textContent.startsWith('Point')")
    words = _text(page, "readout").split(" · ")
    assert float(words[0].removesuffix(" m")) == pytest.approx(BLOCK[0], abs=0.15)
    # Azimuth 99 looks along 13 + 99 x 14 of 5600 counts, 89.94 deg.
    assert words[1].endswith("(azimuth 99)")
    assert int(words[2].split()[1]) == pytest.approx(100, abs=4)
    assert words[3:] == ["direct", "car", "1 bounce", "moving"]
    page.press("b")
    x, y = _middle(page, f"#marks [data-instance='{BOX_INSTANCE}']")
    page.point(left + side * x, top + side * y)
    page.wait_for("document.getElementById('readout').textContent.startsWith('car')")
    assert _text(page, "readout").startswith(f"car {BOX_INSTANCE} · 0.0 km/h · 4.5 × 1.8 × 1.4 m")


def test_mark_on_the_plan_follows_the_drive(page: Chromium) -> None:
    start = _middle(page, "#plan .here")
    width_m = page.value("document.getElementById('plan').viewBox.baseVal.width")
    plan_px, stage_px = page.value(
        "[document.getElementById('plan').clientWidth, document.getElementById('stage').clientWidth]"
    )
    page.press("End")
    _wait_for_scan(page, 3)
    end = _middle(page, "#plan .here")
    metres = width_m / plan_px * stage_px
    assert (end[0] - start[0]) * metres == pytest.approx(3 * STEP_M * math.cos(YAW), abs=0.5)
    assert (start[1] - end[1]) * metres == pytest.approx(3 * STEP_M * math.sin(YAW), abs=0.5)


def test_click_on_the_drive_goes_there(page: Chromium) -> None:
    page.press("End")
    _wait_for_scan(page, 3)
    x, y = _middle(page, "#plan .here")
    page.press("Home")
    _wait_for_scan(page, 0)
    left, top, side = page.value(
        "(b => [b.x, b.y, b.width])(document.getElementById('stage').getBoundingClientRect())"
    )
    page.click(left + side * x, top + side * y)
    _wait_for_scan(page, 3)


def test_azimuth_marks_appear_when_chosen(page: Chromium) -> None:
    assert page.value("document.querySelector('.obstacles').getAttribute('d')") == ""
    page.click_on("#obstacles")
    page.click_on("#clipped")
    assert page.value("document.querySelector('.obstacles').getAttribute('d').match(/[ML]/g).length") == 200
    assert page.value("document.querySelector('.clip').getAttribute('d').match(/M/g).length") == 5


def test_clicked_controls_leave_the_arrow_keys_to_the_scans(page: Chromium) -> None:
    page.click_on("input[name=overlay][value=class]")
    page.press("ArrowRight")
    _wait_for_scan(page, 1)
    assert page.value("document.querySelector('input[name=overlay]:checked').value") == "class"


def test_every_control_has_a_name(page: Chromium) -> None:
    nameless = page.value(
        "[...document.querySelectorAll('button, input, select')].filter(e => !e.getAttribute('aria-label')"
        " && !(e.labels && [...e.labels].some(l => l.textContent.trim()))).map(e => e.outerHTML)"
    )
    assert nameless == []


@pytest.mark.parametrize(("width", "height"), [(390, 844), (1024, 768), (1920, 1080)])
def test_nothing_hangs_over_the_edge(page: Chromium, address: str, width: int, height: int) -> None:
    page.open(address, width=width, height=height, dark=False)
    _wait_for_scan(page, 0)
    assert page.value("document.documentElement.scrollWidth") <= width
    assert page.value("document.getElementById('stage').clientWidth") >= min(0.9 * width, 0.5 * height)


def test_folder_without_truth_is_shown_with_a_note(page: Chromium, tmp_path: Path) -> None:
    folder = write_set(tmp_path / "real", simulated=False)
    (folder / "view.html").write_bytes(page_bytes(view_of(folder)))
    page.open((folder / "view.html").as_uri())
    page.press("o")
    page.press("ArrowRight")
    _wait_for_scan(page, 1)
    assert "no ground truth" in _text(page, "notes")
    assert page.value("document.querySelector('input[name=overlay]').matches(':disabled')")
    assert page.value("document.querySelector('input[name=overlay]:checked').value") == "off"
    assert page.value("document.querySelectorAll('[data-instance]').length") == 0
