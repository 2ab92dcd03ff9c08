"""Golden scans: equal ones pass, others fail with a message that says how they differ and what to do."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.testing import GoldenScans, golden, golden_figure
from echoscape.testing.golden import OTHER_VERSIONS
from echoscape.testing.golden_file import Golden, GoldenError, read_golden, write_golden

CODES = np.arange(200, dtype=np.uint8).reshape(10, 20)


def stored(folder: Path, scan: PolarScan | NDArray = CODES, name: str = "first") -> Path:
    GoldenScans(folder, update=True).check(scan, name)
    return folder / f"{name}.png"


def message(folder: Path, scan: Any = CODES, name: str = "first", **limits: Any) -> str:
    with pytest.raises(AssertionError) as found:
        GoldenScans(folder, test="tests/test_x.py::test_y[1]").check(scan, name, **limits)
    return str(found.value)


def changed(*changes: tuple[int, int, int]) -> NDArray[np.uint8]:
    """The codes with some cells (row, column) raised."""
    codes = CODES.copy()
    for row, column, by in changes:
        codes[row, column] += by
    return codes


# ---------------------------------------------------------------------- equal


def test_a_scan_that_is_as_stored_passes_and_leaves_nothing(tmp_path: Path, radar_scan: PolarScan) -> None:
    path = stored(tmp_path, radar_scan)
    GoldenScans(tmp_path).check(radar_scan, "first")
    assert list(tmp_path.iterdir()) == [path]
    assert path.stat().st_size < 40_000


def test_the_file_is_an_image_of_the_codes(tmp_path: Path, radar_scan: PolarScan) -> None:
    with Image.open(stored(tmp_path, radar_scan)) as image:
        np.testing.assert_array_equal(np.array(image), radar_scan.codes)


@pytest.mark.parametrize("dtype", [np.uint8, np.bool_])
def test_arrays_of_codes_and_masks_are_compared_as_well(tmp_path: Path, dtype: type) -> None:
    array = (CODES > 90).astype(dtype)
    stored(tmp_path, array)
    GoldenScans(tmp_path).check(array, "first")
    text = message(tmp_path, array ^ dtype(1))
    assert "200 of 200 cells differ (1)" in text
    assert ("by up to" in text) == (dtype is np.uint8)


def test_masks_are_stored_in_black_and_white_and_are_no_codes(tmp_path: Path) -> None:
    with Image.open(stored(tmp_path, CODES > 90)) as image:
        assert image.mode == "1"
        np.testing.assert_array_equal(np.array(image), CODES > 90)
    assert "the scan is of codes, " in message(tmp_path, (CODES > 90).astype(np.uint8))


# ---------------------------------------------------------------------- different


def test_one_cell_that_differs_by_one_code_fails_and_is_named(tmp_path: Path, radar_scan: PolarScan) -> None:
    path = stored(tmp_path, radar_scan)
    codes = radar_scan.codes.copy()
    codes[3, 77] += 1
    text = message(tmp_path, replace(radar_scan, codes=codes))
    assert text.startswith(f"the scan differs from {tmp_path.parent.name}/{tmp_path.name}/first.png\n")
    assert "1 of 51200 cells differ (2e-05), by up to 1 codes (0.5 dB)\n" in text
    was = radar_scan.codes[3, 77]
    assert f"azimuth 3, bin 77 (13.4 m): {was} stored, {was + 1} now\n" in text
    assert "allowed: no difference\n" in text
    assert 'pytest "tests/test_x.py::test_y[1]" --radar-update-golden' in text
    assert f"figure: {path.with_suffix('.difference.png')}\n" in text
    np.testing.assert_array_equal(read_golden(path).codes, radar_scan.codes)


def test_a_figure_of_the_difference_is_written_and_goes_when_the_scan_passes(tmp_path: Path) -> None:
    figure = stored(tmp_path).with_suffix(".difference.png")
    message(tmp_path, changed((0, 0, 6)))
    with Image.open(figure) as image:
        assert min(image.size) > 500
    GoldenScans(tmp_path).check(CODES, "first")
    assert not figure.exists()


@pytest.mark.parametrize(
    ("dtype", "label", "most"), [(bool, "cell is set", 1), (np.uint8, "code [half dB]", 4)]
)
def test_the_figure_names_what_cells_hold(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, dtype: type, label: str, most: float
) -> None:
    figures: list[Figure] = []
    monkeypatch.setattr(golden_figure, "png_bytes", lambda figure: figures.append(figure) or b"")
    array = (CODES > 90).astype(dtype)
    stored(tmp_path, array)
    message(tmp_path, array ^ dtype(1))
    images = [image for axes in figures[0].axes for image in axes.get_images()]
    bars = [image.colorbar for image in images if image.colorbar is not None]
    assert [bar.ax.get_ylabel() for bar in bars] == 3 * [label]
    assert images[2].get_clim() == (-most, most)
    ticks = bars[2].get_ticks()
    np.testing.assert_array_equal(ticks, np.round(ticks))


def test_scans_are_equal_where_their_digests_are() -> None:
    def described(**changes: Any) -> Golden:
        content = {"codes": CODES, "axes": {"bin_m": 0.1}, "versions": {}, **changes}
        return Golden(**content)

    ones = np.ones((10, 20), np.uint8)
    made = [
        described(),
        described(codes=changed((9, 19, 1))),
        described(codes=CODES.reshape(20, 10)),
        described(axes={"bin_m": 0.2}),
        described(codes=ones),
        described(codes=ones, mask=True),
    ]
    for first in made:
        assert [first.digest == other.digest for other in made] == [first.same(other) for other in made]
    assert described(versions={"numpy": "1"}).digest == described().digest


def test_only_some_cells_are_listed(tmp_path: Path) -> None:
    stored(tmp_path)
    text = message(tmp_path, changed(*((row, 0, 1) for row in range(5))))
    assert text.count("azimuth") == 3
    assert "\n  ...\n" in text


@given(count=st.integers(0, 10), by=st.integers(1, 9), share=st.integers(0, 10), most=st.integers(0, 9))
def test_limits_hold_each_where_given(
    count: int, by: int, share: int, most: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("golden")
    stored(folder)
    codes = changed(*((row, 5, by) for row in range(count)))
    cases: tuple[tuple[dict[str, Any], bool], ...] = (
        ({}, count == 0),
        ({"max_share": share / 200}, count <= share),
        ({"max_codes": most}, count == 0 or by <= most),
        ({"max_share": share / 200, "max_codes": most}, count <= share and (count == 0 or by <= most)),
    )
    for limits, passes in cases:
        with pytest.MonkeyPatch().context() as patch:
            patch.setattr(golden, "_drawn", lambda *_: "not drawn")
            try:
                GoldenScans(folder).check(codes, "first", **limits)
            except AssertionError:
                assert not passes
            else:
                assert passes


def test_differences_below_zero_count_as_well(tmp_path: Path) -> None:
    stored(tmp_path, changed((4, 4, 7)))
    GoldenScans(tmp_path).check(CODES, "first", max_codes=7)
    assert "by up to 7 codes (3.5 dB)" in message(tmp_path, max_codes=6)


def test_other_versions_are_named_with_the_tolerance_for_them(tmp_path: Path) -> None:
    path = tmp_path / "first.png"
    numpy = np.__version__
    write_golden(path, Golden(codes=CODES, axes={}, versions={"numpy": "1.0", "unknown": "3"}))
    text = message(tmp_path, changed((1, 1, 1)))
    assert f"stored with numpy 1.0, now {numpy}; check(..., max_share=0.0001, max_codes=6) allows" in text
    assert "unknown" not in text
    write_golden(path, Golden(codes=CODES, axes={}, versions={"numpy": numpy}))
    assert "stored with" not in message(tmp_path, changed((1, 1, 1)))
    assert OTHER_VERSIONS["max_share"] > 3e-5
    assert OTHER_VERSIONS["max_codes"] == 6


def test_other_shapes_and_axes_are_told(tmp_path: Path, radar_scan: PolarScan) -> None:
    stored(tmp_path, radar_scan)
    name = f"{tmp_path.parent.name}/{tmp_path.name}/first.png"
    shape = replace(radar_scan, codes=radar_scan.codes[:, :9])
    assert f"the scan has shape (100, 9), {name} has (100, 512)\n" in message(tmp_path, shape)
    axes = replace(radar_scan, bin_m=0.2, encoder=radar_scan.encoder + np.uint16(1))
    wanted = f"the scan has other axes than {name}: bin_m was 0.1728, is 0.2, the encoder counts differ\n"
    assert wanted in message(tmp_path, axes)
    assert "a scan and a plain array are not compared" in message(tmp_path, radar_scan.codes)


def test_a_figure_that_cannot_be_written_hides_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stored(tmp_path)
    monkeypatch.setattr(
        "echoscape.testing.golden_figure.write_atomic", lambda *_: (_ for _ in ()).throw(OSError("read-only"))
    )
    text = message(tmp_path, changed((1, 1, 1)))
    assert "1 of 200 cells differ" in text
    assert "no figure was written: read-only" in text


# ---------------------------------------------------------------------- stored scans


def test_where_no_scan_is_stored_the_message_says_how_to_store_it(tmp_path: Path) -> None:
    text = message(tmp_path / "nowhere")
    assert f"there is no stored scan {tmp_path.name}/nowhere/first.png\n" in text
    assert text.endswith('pytest "tests/test_x.py::test_y[1]" --radar-update-golden')
    assert not (tmp_path / "nowhere").exists()


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", "cannot be read"),
        (b"not a png", "cannot be read"),
        (None, "cannot be read"),  # cut short
        (CODES, "was not written by radar_golden"),
    ],
)
def test_a_file_that_holds_no_golden_scan_is_named(tmp_path: Path, data: Any, reason: str) -> None:
    path = stored(tmp_path)
    if isinstance(data, np.ndarray):
        Image.fromarray(data).save(path)
    else:
        path.write_bytes(path.read_bytes()[:-40] if data is None else data)
    assert f"first.png {reason}" in message(tmp_path)
    stored(tmp_path)
    GoldenScans(tmp_path).check(CODES, "first")


def test_updates_write_what_differs_and_nothing_else(tmp_path: Path) -> None:
    path = stored(tmp_path)
    before = path.stat().st_mtime_ns
    again = GoldenScans(tmp_path, update=True)
    again.check(CODES, "first")
    assert again.written == {}
    assert path.stat().st_mtime_ns == before
    message(tmp_path, changed((1, 1, 1)))
    again.check(changed((1, 1, 1)), "first")
    assert list(again.written) == [path]
    GoldenScans(tmp_path).check(changed((1, 1, 1)), "first")
    assert list(tmp_path.iterdir()) == [path]


def test_two_tests_that_store_different_scans_under_one_name_are_told(tmp_path: Path) -> None:
    writers: dict[Path, str] = {}
    GoldenScans(tmp_path, test="first", update=True, writers=writers).check(CODES, "x")
    second = GoldenScans(tmp_path, test="second", update=True, writers=writers)
    second.check(CODES, "x")
    with pytest.raises(AssertionError, match="stored in this run by first: each scan needs a name"):
        second.check(changed((1, 1, 1)), "x")


# ---------------------------------------------------------------------- bad calls


@pytest.mark.parametrize("name", ["", "a/b", "../a", ".hidden", "a b", "a\\b"])
def test_names_that_leave_the_folder_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(ValueError, match="name must hold letters"):
        GoldenScans(tmp_path, update=True).check(CODES, name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", [5, None, Path("a"), b"a"])
def test_names_that_are_no_words_are_refused_by_their_value(tmp_path: Path, name: Any) -> None:
    with pytest.raises(TypeError, match=r"^name must be of type str, got "):
        GoldenScans(tmp_path, update=True).check(CODES, name)


@pytest.mark.parametrize("letter", ["a", "\N{LATIN SMALL LETTER O WITH DIAERESIS}"])
def test_names_are_as_long_as_files_may_be_named(tmp_path: Path, letter: str) -> None:
    most = 200 // len(letter.encode())
    stored(tmp_path, name=most * letter)
    assert "figure: " in message(tmp_path, changed((1, 1, 1)), most * letter)  # written beside it
    with pytest.raises(ValueError, match=r"name must have 200 bytes of UTF-8 or fewer, got 20[12]: "):
        stored(tmp_path, name=(most + 1) * letter)


@pytest.mark.parametrize(
    ("limits", "text"),
    [
        ({"max_share": -0.1}, "max_share must be between 0 and 1, got -0.1"),
        ({"max_share": 2}, "max_share must be between 0 and 1, got 2"),
        ({"max_codes": -1}, "max_codes must be between 0 and 255, got -1"),
        ({"max_codes": 256}, "max_codes must be between 0 and 255, got 256"),
        ({"max_codes": 1.5}, "max_codes must be a whole number, got 1.5"),
        ({"max_codes": True}, "max_codes must be a whole number, got True"),
        ({"max_share": "1"}, "max_share must be a number, got '1'"),
        ({"max_share": True}, "max_share must be a number, got True"),
        ({"max_share": float("nan")}, "max_share must be between 0 and 1, got nan"),
    ],
)
def test_limits_out_of_range_are_refused(tmp_path: Path, limits: dict, text: str) -> None:
    with pytest.raises(ValueError, match=text):
        GoldenScans(tmp_path, update=True).check(CODES, "first", **limits)


@pytest.mark.parametrize("scan", [CODES.astype(float), CODES[0], CODES[:0], [[1.5]], None, "codes"])
def test_what_is_no_scan_is_refused_by_its_type(tmp_path: Path, scan: Any) -> None:
    with pytest.raises(TypeError, match=r"scan must be a PolarScan or an array \(azimuths, bins\) of uint8"):
        GoldenScans(tmp_path, update=True).check(scan, "first")


def test_colour_images_are_no_golden_scans(tmp_path: Path) -> None:
    path = stored(tmp_path)
    with Image.open(path) as image:
        from PIL.PngImagePlugin import PngInfo

        info = PngInfo()
        info.add_text("echoscape", image.info["echoscape"], zip=True)
        image.convert("RGB").save(path, pnginfo=info)
    with pytest.raises(GoldenError, match="must be a grey image of 8 bits or one of 1 bit, its mode is RGB"):
        read_golden(path)
