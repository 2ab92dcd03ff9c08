"""docs/fidelity.md: linked files exist, and the tables agree with the code."""

import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from benchmarks.fidelity_tables import changes_table, filled
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


def test_arcs_of_sidelobes_reach_as_far_as_the_beam_lets_them() -> None:
    section = " ".join(PAGE.partition("### Sidelobes")[2].partition("###")[0].split())
    arcs = re.search(
        r"echo (\d+) dB above .* arc of (\d+) deg .* one of (\d+) dB an arc of (\d+) deg", section
    )
    ring = re.search(r"full ring takes (\d+) dB, .* clips \((\d+) dB\)", section)
    assert arcs is not None
    assert ring is not None
    beam = Antenna(sensor=CTS350X)
    level_db = 10 * np.log10(beam.azimuth_two_way / beam.azimuth_two_way.max())
    for strength_db, reach_deg in ((arcs[1], arcs[2]), (arcs[3], arcs[4])):
        reached = np.abs(beam.azimuth_grid_rad)[level_db >= -float(strength_db)]
        assert np.rad2deg(reached.max()) == pytest.approx(float(reach_deg), abs=0.6)
    assert -level_db.min() == pytest.approx(float(ring[1]), abs=0.6)
    assert CTS350X.full_scale_db == float(ring[2])


def test_a_later_table_replaces_the_rows_of_its_artefacts() -> None:
    head = "| artefact | mean |\n|---|---:|\n"
    first, second = head + "| a | 1 |\n| b | 2 |\n| b | 3 |\n| c | 4 |\n", head + "| b | 5 |\n"
    assert changes_table([first, second]) == head + "| a | 1 |\n| b | 5 |\n| c | 4 |"


def test_tables_are_put_between_their_comments_only() -> None:
    page = "a\n<!-- x -->\nold\n<!-- end of x -->\nb\n<!-- y -->\n<!-- end of y -->\n"
    assert filled(page, "x", "| 1\\2 |\n") == page.replace("old", "| 1\\2 |")
    with pytest.raises(ValueError, match="one table z, got 0"):
        filled(page, "z", "")
