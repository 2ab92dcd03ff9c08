"""Changes by an artefact are counted correctly, and the scans shown are those that a simulation makes."""

from dataclasses import fields, replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from echoscape.eval.ablation.cases import CASES, ArtefactCase, bits, chosen_cases, percent, quantity
from echoscape.eval.ablation.run import CaseScans, changes, check_index, markdown_table, simulate_cases
from echoscape.scenes.driving.ego_drive import EgoDrive
from echoscape.scenes.traffic.plan import plan_traffic
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.setup import build_scene
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.sim.simulator import Simulator
from tests.sim.scans import drawn_scan


def test_every_artefact_is_shown_once() -> None:
    assert [case.name for case in CASES] == [field.name for field in fields(Artefacts)]


def test_cells_that_change_by_3_db_are_counted() -> None:
    scan = drawn_scan()
    before = np.full((400, 3768), 30, np.uint8)
    after = before.copy()
    after[:40] = 36  # a tenth: 3 dB more
    after[40:60] = 24  # a twentieth: 3 dB less
    after[60:] = 35  # 2.5 dB are no change
    found = CaseScans(
        case=ArtefactCase(name="ghosts", text="", span_m=10.0),
        strengths=(0.0, 0.5),
        scans=(replace(scan, codes=before), replace(scan, codes=after)),
        motion_distortion=(1.0, 1.0),
    )
    off, on = changes(found)
    assert (off.weaker_percent, off.stronger_percent) == (0, 0)
    assert_allclose((on.weaker_percent, on.stronger_percent), (5, 10))
    assert_allclose(on.mean_code, 0.1 * 36 + 0.05 * 24 + 0.85 * 35)
    assert "| ghosts | ×0.5 | 34.55 | 5.0 | 10.0 |" in markdown_table([off, on])


def test_scans_shown_are_those_of_a_simulation() -> None:
    config = SimulationConfig(preset="empty", seed=5, scans=2, artefacts=Artefacts(leakage=0.5, rain=3.0))
    leakage, rain = simulate_cases(config, 1, names=("rain", "leakage"))
    assert (leakage.strengths, rain.strengths) == ((0.0, 0.5), (0.0, 10.0, 25.0))
    setup = build_scene(config)
    assert isinstance(setup.drive, EgoDrive)
    movers = plan_traffic(setup.scene, setup.drive, seed=5, settings=config.traffic)
    for strength, scan in zip(leakage.strengths, leakage.scans, strict=True):
        artefacts = replace(config.artefacts, leakage=strength)
        simulator = Simulator(setup.scene, setup.drive, movers, seed=5, artefacts=artefacts)
        assert_array_equal(scan.codes, simulator.scan(1).codes)
    assert [each.codes.mean() for each in rain.scans] == sorted(each.codes.mean() for each in rain.scans)


def test_an_artefact_that_is_off_is_shown_at_its_default() -> None:
    config = SimulationConfig(preset="empty", scans=1, artefacts=Artefacts(thermal_noise=0.0))
    (noise,) = simulate_cases(config, 0, names=("thermal_noise",))
    # 290 K and a noise figure of 15 dB.
    assert_allclose(noise.strengths, (0.0, 290 * 10**1.5), rtol=1e-3)


def test_unknown_artefacts_and_scans_are_refused() -> None:
    with pytest.raises(ValueError, match=r"only must name some of speckle, .*, got 'snow'"):
        chosen_cases(("snow",))
    with pytest.raises(ValueError, match="scan must be between 0 and 3, got 4"):
        check_index(SimulationConfig(preset="empty", scans=4), 4)


def test_strengths_are_written_in_usual_units() -> None:
    assert percent(1.0) == "100 %"
    assert bits(2.0**-11) == "12 bit"  # 2048 steps up to the clip level, and as many below zero
    assert quantity("K")(9171.2) == "9171 K"
    assert quantity("rad")(0.0583) == "0.0583 rad"
    assert {case.name: case.strength_text(1.0) for case in CASES}["ghosts"] == "×1"


def test_scans_keep_the_motion_distortion_that_they_were_made_with() -> None:
    config = SimulationConfig(preset="empty", scans=1, artefacts=Artefacts(motion_distortion=0.5))
    leakage, distortion = simulate_cases(config, 0, names=("leakage", "motion_distortion"))
    assert leakage.motion_distortion == (0.5, 0.5)
    assert distortion.motion_distortion == (0.0, 0.5)
