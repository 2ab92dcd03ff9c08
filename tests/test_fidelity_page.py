"""docs/fidelity.md: linked files exist, and the tables agree with the code."""

import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from benchmarks.fidelity_tables import filled
from echoscape.eval.ablation.cases import CASES
from echoscape.eval.fidelity.reference_values import TARGETS
from echoscape.eval.fidelity.score import span_text, tolerance_text
from echoscape.sim.generation import domain_randomization
from echoscape.sim.raytracing.beam_weighting import MAIN_AZIMUTHS
from echoscape.sim.sensor.antenna import Antenna
from echoscape.sim.sensor.cts350x import CTS350X
from tests.paths import ROOT

DOCS = ROOT / "docs"
PAGE = (DOCS / "fidelity.md").read_text()


def test_linked_files_exist() -> None:
    links = re.findall(r"\]\((?!http)([^)#]+)\)", PAGE)
    assert [link for link in links if not (DOCS / link).exists()] == []
    assert {Path(link).stem for link in links} >= {case.name for case in CASES}


def test_figures_are_small() -> None:
    sizes = {path.name: path.stat().st_size for path in (DOCS / "artefacts").iterdir()}
    assert set(sizes) == {f"{case.name}.png" for case in CASES}
    assert sum(sizes.values()) < 2_500_000
    scan = DOCS / "scan.png"
    assert scan.stat().st_size < 400_000
    with Image.open(scan) as image:
        assert image.width == 900


def test_the_table_has_the_targets_and_tolerances_of_the_code() -> None:
    rows = dict(
        re.findall(r"^\| (\w[^|]*?) \| [-\d.]+ \| (.* \| .*) \| (?:pass|low|high) \|$", PAGE, re.MULTILINE)
    )
    targets = TARGETS["cts350x"]
    assert len(rows) == len(targets)
    for name, target in targets.items():
        assert rows[name.replace("_", " ")] == f"{span_text(target)} | {tolerance_text(target)}"


def test_ranges_of_domain_randomisation_are_those_of_the_code() -> None:
    listed = {
        name: (float(low), float(high))
        for name, low, high in re.findall(r"^\| `([A-Z_]+)` \| ([-\d.]+) to ([-\d.]+) \|", PAGE, re.MULTILINE)
    }
    drawn = {
        name: value
        for name, value in vars(domain_randomization).items()
        if name.isupper() and isinstance(value, tuple)
    }
    assert listed == drawn
    assert f"in {100 * domain_randomization.BLOCKED_CHANCE:g} % of the datasets" in PAGE


def test_levels_of_the_sidelobes_are_those_of_the_beam() -> None:
    section = PAGE.partition("### Sidelobes")[2].partition("###")[0]
    (begin,) = set(re.findall(r"([\d.]+) deg off", section))
    assert float(begin) == pytest.approx(MAIN_AZIMUTHS * 360 / CTS350X.azimuths)
    listed = [(float(db), float(deg)) for db, deg in re.findall(r"(-\d+) dB at ([\d.]+) deg", section)]
    assert len(listed) == 4
    assert listed[0][1] == float(begin)
    beam = Antenna(sensor=CTS350X)
    for level_db, off_deg in listed:
        gain = np.interp(np.deg2rad(off_deg), beam.azimuth_grid_rad, beam.azimuth_two_way)
        assert 10 * np.log10(gain / beam.azimuth_two_way.max()) == pytest.approx(level_db, abs=0.6)


def test_tables_are_put_between_their_comments_only() -> None:
    page = "a\n<!-- x -->\nold\n<!-- end of x -->\nb\n<!-- y -->\n<!-- end of y -->\n"
    assert filled(page, "x", "| 1\\2 |\n") == page.replace("old", "| 1\\2 |")
    with pytest.raises(ValueError, match="one table z, got 0"):
        filled(page, "z", "")
