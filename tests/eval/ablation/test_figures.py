"""Figures of artefacts show the part that changes, and are written whole or not at all."""

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from echoscape.eval.ablation import figures as artefact_figures
from echoscape.eval.ablation.cases import ArtefactCase
from echoscape.eval.ablation.crop import most_changed
from echoscape.eval.ablation.figures import case_figure, write_artefacts
from echoscape.eval.ablation.run import CaseScans
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.generation.config import SimulationConfig
from tests.sim.scans import drawn_scan

CONFIG = SimulationConfig(preset="empty", seed=5, scans=2)


def _shown(azimuth: int, range_m: float, view: str) -> CaseScans:
    """An artefact that makes displaced ghosts in one patch brighter, and more in place elsewhere."""
    scan = drawn_scan()
    assert scan.truth is not None
    before = np.full((400, 3768), 20, np.uint8)
    after, component = before.copy(), np.zeros((400, 3768), np.uint8)
    column = round(range_m / scan.bin_m)
    component[azimuth - 2 : azimuth + 3, column - 20 : column + 21] = 3
    after[component == 3] = 80
    displaced = component == 3
    if view == "above":
        component[300:340], after[300:340] = 3, 80
    cells = replace(scan.truth.cells, component=component, displaced=displaced)
    truth = replace(scan.truth, cells=cells)
    return CaseScans(
        case=ArtefactCase(name="ghosts", text="", span_m=60.0, view=view, region="ghost"),  # type: ignore[arg-type]
        strengths=(0.0, 1.0),
        scans=(replace(scan, codes=before, truth=truth), replace(scan, codes=after, truth=truth)),
        motion_distortion=(1.0, 1.0),
    )


def test_the_part_seen_from_above_is_where_the_component_changes() -> None:
    part = most_changed(_shown(azimuth=100, range_m=50.0, view="above"))
    # Azimuth 100 of 400 looks right.
    assert abs(part.right_m - 50) < 3
    assert abs(part.forward_m) < 3


def test_the_azimuths_that_change_are_in_the_middle_of_those_shown() -> None:
    part = most_changed(_shown(azimuth=10, range_m=50.0, view="polar"))
    assert abs((10 - part.azimuth) % 400 - 60) < 3  # 120 azimuths, across the seam
    assert part.span_m == pytest.approx(60, abs=0.05)


@pytest.mark.parametrize("view", ["above", "polar", "overlay"])
def test_a_patch_that_appears_is_brighter_in_the_second_panel(view: str) -> None:
    with Image.open(io.BytesIO(case_figure(_shown(azimuth=100, range_m=50.0, view=view)))) as image:
        panels = np.asarray(image.convert("L")).astype(float)
    width = panels.shape[1] // 3
    off, on = panels[40:-50, :width], panels[40:-50, width : 2 * width]
    assert (on > 200).sum() > (off > 200).sum() + 50


def test_an_artefact_that_changes_nothing_is_shown_around_the_radar() -> None:
    shown = _shown(azimuth=100, range_m=50.0, view="above")
    part = most_changed(replace(shown, scans=(shown.scans[0], shown.scans[0])))
    assert (part.forward_m, part.right_m) == (0, 0)


def test_a_folder_gets_a_figure_for_each_artefact_and_the_table(tmp_path: Path) -> None:
    out = tmp_path / "new" / "folder"
    rows, paths = write_artefacts(out, CONFIG, 1, names=("leakage", "motion_distortion"))
    assert [path.name for path in paths] == ["leakage.png", "motion_distortion.png", "artefacts.md"]
    assert sorted(paths) == sorted(out.iterdir())
    assert [row.artefact for row in rows] == 2 * ["leakage"] + 2 * ["motion_distortion"]
    assert all(path.stat().st_size < 400_000 for path in paths)


def test_nothing_is_left_where_a_figure_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(found: CaseScans) -> bytes:
        raise MemoryError

    monkeypatch.setattr(artefact_figures, "case_figure", fail)
    with pytest.raises(MemoryError):
        write_artefacts(tmp_path / "out", CONFIG, 0, names=("leakage",))
    assert list(tmp_path.iterdir()) == []


def test_a_file_in_the_folders_place_is_refused(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("dear")
    with pytest.raises(DatasetError, match="OUT must be a folder"):
        write_artefacts(tmp_path / "out", CONFIG, 0)
