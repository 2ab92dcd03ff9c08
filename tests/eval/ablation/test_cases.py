"""What an effect changes is counted rightly, and the scans shown are those that a simulation makes."""

from dataclasses import fields, replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from echoscape.eval.ablation.cases import EFFECTS, Effect, chosen
from echoscape.eval.ablation.run import Shown, changes, check_index, shown_effects, table
from echoscape.scenes.driving.ego_drive import EgoDrive
from echoscape.scenes.traffic.plan import plan_traffic
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.setup import build_scene
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.sim.simulator import Simulator
from tests.sim.scans import drawn_scan


def test_every_artefact_is_shown_once() -> None:
    assert [effect.name for effect in EFFECTS] == [field.name for field in fields(Artefacts)]


def test_cells_that_change_by_3_db_are_counted() -> None:
    scan = drawn_scan()
    before = np.full((400, 3768), 30, np.uint8)
    after = before.copy()
    after[:40] = 36  # a tenth: 3 dB more
    after[40:60] = 24  # a twentieth: 3 dB less
    after[60:] = 35  # 2.5 dB are no change
    shown = Shown(
        effect=Effect(name="ghosts", unit="W/W", text="", span_m=10.0),
        strengths=(0.0, 0.5),
        scans=(replace(scan, codes=before), replace(scan, codes=after)),
    )
    off, on = changes(shown)
    assert (off.weaker, off.stronger) == (0, 0)
    assert_allclose((on.weaker, on.stronger), (5, 10))
    assert_allclose(on.mean_code, 0.1 * 36 + 0.05 * 24 + 0.85 * 35)
    assert "| ghosts | 0.5 W/W | 34.55 | 5.0 | 10.0 |" in table([off, on])


def test_scans_shown_are_those_of_a_simulation() -> None:
    config = SimulationConfig(preset="empty", seed=5, scans=2, artefacts=Artefacts(leakage=0.5, rain=3.0))
    leakage, rain = shown_effects(config, 1, names=("rain", "leakage"))
    assert (leakage.strengths, rain.strengths) == ((0.0, 0.5), (0.0, 10.0, 25.0))
    stage = build_scene(config)
    assert isinstance(stage.drive, EgoDrive)
    movers = plan_traffic(stage.town, stage.drive, seed=5, settings=config.traffic)
    for strength, scan in zip(leakage.strengths, leakage.scans, strict=True):
        artefacts = replace(config.artefacts, leakage=strength)
        simulator = Simulator(stage.town, stage.drive, movers, seed=5, artefacts=artefacts)
        assert_array_equal(scan.codes, simulator.scan(1).codes)
    assert [each.codes.mean() for each in rain.scans] == sorted(each.codes.mean() for each in rain.scans)


def test_an_effect_that_is_off_is_shown_at_its_default() -> None:
    config = SimulationConfig(preset="empty", scans=1, artefacts=Artefacts(thermal_noise=0.0))
    (noise,) = shown_effects(config, 0, names=("thermal_noise",))
    # 290 K and a noise figure of 15 dB.
    assert_allclose(noise.strengths, (0.0, 290 * 10**1.5), rtol=1e-3)


def test_unknown_effects_and_scans_are_refused() -> None:
    with pytest.raises(ValueError, match=r"only must name some of speckle, .*, got 'snow'"):
        chosen(("snow",))
    with pytest.raises(ValueError, match="scan must be between 0 and 3, got 4"):
        check_index(SimulationConfig(preset="empty", scans=4), 4)
