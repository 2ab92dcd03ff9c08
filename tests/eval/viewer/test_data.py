"""What a page is given: the strongest cell of each group, its truth, boxes where the beam met them."""

import base64
import io
import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from echoscape.eval.viewer.data import View, ViewedScan, strongest_bins, view_of
from echoscape.eval.viewer.html import page_bytes
from echoscape.scenes.core.scene import CLASSES
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.files.navtech_png import write_png
from echoscape.sim.datasets.files.truth_npz import write_truth
from echoscape.sim.datasets.polar_scan import Component
from tests.eval.viewer.view_sets import (
    BLOCK_AZIMUTHS,
    BLOCK_BINS,
    BLOCK_CODE,
    BOX_FORWARD_M,
    BOX_RIGHT_M,
    CAR,
    START_US,
    TURN_US,
    YAW,
    made_scan,
    write_set,
)


def _pixels(data: bytes | None) -> np.ndarray:
    assert data is not None
    with Image.open(io.BytesIO(data)) as image:
        return np.asarray(image.convert("RGB"))


def _embedded(page: bytes) -> dict:
    """The data that a page holds."""
    (text,) = re.findall(rb'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    return json.loads(text)


def test_strongest_cells_are_the_largest_codes_and_where_they_stand() -> None:
    codes = np.array([[1, 9, 2, 0, 0, 7, 5], [3, 3, 3, 8, 1, 1, 200]], np.uint8)
    top, bins = strongest_bins(codes, 3)
    np.testing.assert_array_equal(top, [[9, 7], [3, 8]])
    np.testing.assert_array_equal(bins, [[1, 5], [0, 3]])


def test_shown_scan_is_the_scan_within_what_lossy_images_cost(tmp_path: Path) -> None:
    view = view_of(write_set(tmp_path / "set"), columns=250)
    shown = _pixels(view.scans[0].codes)[..., 0].astype(int)
    assert (view.columns, shown.shape) == (250, (400, 250))
    true = np.zeros((400, 250), int)
    true[BLOCK_AZIMUTHS, BLOCK_BINS.start // 4 : BLOCK_BINS.stop // 4] = BLOCK_CODE
    assert np.abs(shown - true).mean() < 0.5
    assert np.abs(shown - true)[95:105, 114:126].max() <= 4


def test_labels_are_the_truth_of_the_strongest_cell_exactly(tmp_path: Path) -> None:
    folder = write_set(tmp_path / "set", scans=1)
    scan = made_scan(0)
    assert scan.truth is not None
    scan.codes[200, 404:408] = (3, 50, 9, 9)
    scan.truth.cells.component[200, 404:408] = (0, Component.GHOST, Component.SPOKE, Component.SPOKE)
    scan.truth.cells.class_id[200, 404:408] = (1, 2, 3, 4)
    scan.truth.cells.bounces[200, 404:408] = (1, 3, 2, 2)
    scan.truth.cells.component[200, 411] = Component.GHOST
    scan.truth.cells.bounces[200, 411] = 2
    scan.codes[200, 411] = 40
    assert scan.truth.cells.displaced is not None
    scan.truth.cells.displaced[200, 405] = True
    write_png(folder / "radar" / f"{START_US}.png", scan)
    write_truth(folder / "truth" / f"{START_US}.npz", scan.truth)
    view = view_of(folder, columns=250)
    labels = _pixels(view.scans[0].labels)
    np.testing.assert_array_equal(labels[200, 101], (Component.GHOST + 16 * 3, 2, 0))
    np.testing.assert_array_equal(labels[200, 102], (len(Component) + 16 * 2, 0, 0))  # multipath in place
    assert {"ghost", "multipath in place"} < dict(view.component_legend).keys()
    np.testing.assert_array_equal(labels[100, 120], (Component.DIRECT + 16, CAR, 1))


def test_box_of_a_standing_drive_is_where_it_was_put(tmp_path: Path) -> None:
    (box,) = view_of(write_set(tmp_path / "set", scans=1)).scans[0].boxes
    assert (box.forward_m, box.right_m) == pytest.approx((BOX_FORWARD_M, BOX_RIGHT_M), abs=0.01)
    assert (box.heading_rad, box.yaw_rad) == pytest.approx((0.0, YAW), abs=0.001)


def test_box_is_placed_for_the_azimuth_that_sees_it(tmp_path: Path) -> None:
    """Car at 16 m/s along y; a box 30 m to its left at mid-scan is met at three quarters of the turn."""
    folder = write_set(tmp_path / "set", scans=1)
    scan = made_scan(0)
    assert scan.truth is not None
    times_s = (scan.timestamp_us - scan.truth.middle_us) / 1e6
    pose = np.column_stack([0 * times_s, 16 * times_s, 0 * times_s, 0 * times_s + math.pi / 2])
    boxes = replace(
        scan.truth.boxes,
        centre=np.array([[-30.0, 0, 0]]),
        velocity=np.array([[0, 8.0, 0]]),
        yaw=np.array([0.0]),
        row=np.array([300], np.int32),
        row_centre=np.array([[-30.0, 8 * times_s[300], 0]]),
        row_yaw=np.array([0.0]),
    )
    truth = replace(scan.truth, pose=pose, middle_pose=np.array([0, 0, 0, math.pi / 2]), boxes=boxes)
    write_truth(folder / "truth" / f"{START_US}.npz", truth)
    (box,) = view_of(folder).scans[0].boxes
    # Met some 0.06 s after mid-scan: the car has gone 16 times that, the box 8 times.
    late_s = times_s[300]
    assert late_s == pytest.approx(0.0625, abs=0.001)
    assert (box.forward_m, box.right_m) == pytest.approx(((8 - 16) * late_s, -30.0), abs=0.05)
    assert box.heading_rad == pytest.approx(math.pi / 2, abs=0.001)  # it looks east, the car north


def test_motion_speed_and_drive_are_those_of_the_poses(tmp_path: Path) -> None:
    simulated = view_of(write_set(tmp_path / "simulated"))
    real = view_of(write_set(tmp_path / "real", simulated=False))
    for view in (simulated, real):
        assert view.scans[0].motion is None
        assert view.scans[1].motion == pytest.approx((2.0, 0.0, 0.0), abs=1e-6)
    assert simulated.path is not None
    assert simulated.path[1] == pytest.approx((10 - 2**0.5, 5 + 2**0.5, YAW), abs=0.01)


def test_without_truth_there_is_a_drive_that_begins_upwards_and_nothing_else(tmp_path: Path) -> None:
    view = view_of(write_set(tmp_path / "set", simulated=False))
    shown = view.scans[2]
    assert not view.has_truth
    assert (shown.labels, shown.boxes, shown.obstacle_m, shown.clipped, view.plan) == (None, [], [], [], None)
    assert shown.pose == pytest.approx((0.0, 4.0, math.pi / 2), abs=1e-4)
    assert shown.speed_m_s == pytest.approx(8.0)


def test_azimuth_marks_are_those_of_the_truth(tmp_path: Path) -> None:
    shown = view_of(write_set(tmp_path / "set", scans=1)).scans[0]
    assert shown.clipped == [0, 1, 2, 3, 4]
    assert shown.obstacle_m == [12.0] * 100 + [None] * 300


def test_legends_list_what_occurs_in_the_scans_shown(tmp_path: Path) -> None:
    view = view_of(write_set(tmp_path / "set", scans=2))
    assert [name for name, _ in view.component_legend] == ["direct", "noise"]
    assert [name for name, _ in view.class_legend] == ["vehicle"]
    dark = view_of(write_set(tmp_path / "real", simulated=False))
    assert dark.component_legend == dark.class_legend == []


def test_boxes_stay_at_mid_scan_without_motion_distortion(tmp_path: Path) -> None:
    folder = write_set(tmp_path / "set", scans=1)
    scan = made_scan(0)
    assert scan.truth is not None
    boxes = replace(scan.truth.boxes, velocity=np.array([[0, 8.0, 0]]))
    write_truth(folder / "truth" / f"{START_US}.npz", replace(scan.truth, boxes=boxes))
    manifest = json.loads((folder / "echoscape.json").read_text())
    manifest["config"]["artefacts"] = {"motion_distortion": 0.0}
    (folder / "echoscape.json").write_text(json.dumps(manifest))
    (box,) = view_of(folder).scans[0].boxes
    assert (box.forward_m, box.right_m) == pytest.approx((BOX_FORWARD_M, BOX_RIGHT_M), abs=0.01)


def test_every_and_scans_choose(tmp_path: Path) -> None:
    folder = write_set(tmp_path / "set", scans=7)
    assert _numbers(view_of(folder, every=3)) == [0, 3, 6]
    assert _numbers(view_of(folder, every=2, scans=2)) == [0, 2]
    view = view_of(folder, scans=1)
    assert (view.total, len(view.path or [])) == (7, 7)  # the whole drive is drawn


def _numbers(view: View) -> list[int]:
    return [shown.number for shown in view.scans]


@pytest.mark.parametrize("setting", [{"scans": 0}, {"every": 0}, {"columns": -3}], ids=str)
def test_arguments_out_of_range_are_refused(tmp_path: Path, setting: dict[str, Any]) -> None:
    ((name, value),) = setting.items()
    with pytest.raises(ValueError, match=f"{name} must be 1 or more, got {value}"):
        view_of(tmp_path, **setting)


def test_missing_truth_of_one_scan_is_named(tmp_path: Path) -> None:
    folder = write_set(tmp_path / "set")
    (folder / "truth" / f"{START_US + TURN_US}.npz").unlink()
    with pytest.raises(DatasetError, match=f"{START_US + TURN_US}.npz"):
        view_of(folder)


def test_same_data_set_gives_the_same_page(tmp_path: Path) -> None:
    folder = write_set(tmp_path / "set")
    assert page_bytes(view_of(folder)) == page_bytes(view_of(folder))


def test_page_holds_the_view_and_no_address(tmp_path: Path) -> None:
    view = view_of(write_set(tmp_path / "set"))
    page = page_bytes(view)
    data = _embedded(page)
    assert base64.b64decode(data["scans"][1]["codes"]) == view.scans[1].codes
    assert [name for name, _ in data["classes"]] == list(CLASSES)
    assert b"://" not in page
    assert b"{{" not in page
    assert b"<title>hand &lt;b&gt;, seed 1" in page


def test_text_of_a_data_set_cannot_end_the_script(tmp_path: Path) -> None:
    view = view_of(write_set(tmp_path / "set", scans=1))
    bad = "</script><script>alert(1)//{{script}}"
    page = page_bytes(replace(view, title=bad, classes=[(bad, "#ffffff")]))
    assert page.count(b"</script>") == 2
    assert _embedded(page)["classes"] == [[bad, "#ffffff"]]


def test_forty_scans_of_nothing_but_noise_can_be_mailed(tmp_path: Path) -> None:
    """The hardest scan to make small, its truth as hard: below 20 MB for 40 of them."""
    folder = write_set(tmp_path / "set", scans=1)
    page = len(page_bytes(view_of(folder)))
    rng = np.random.default_rng(1)
    scan = made_scan(0)
    codes = rng.integers(0, 40, scan.codes.shape, np.uint8)
    write_png(folder / "radar" / f"{START_US}.png", replace(scan, codes=codes))
    noisy = len(page_bytes(view_of(folder)))
    assert page < 0.1e6
    assert 40 * (noisy - page) < 20e6


def test_shown_is_what_the_page_lists(tmp_path: Path) -> None:
    data = _embedded(page_bytes(view_of(write_set(tmp_path / "set", scans=1))))
    assert set(data["scans"][0]) == set(ViewedScan.__dataclass_fields__)
