"""Conditions: one strength at a time or all together, each with its name, equal ones simulated once."""

from dataclasses import replace

import pytest

from echoscape.eval.ablation.study.conditions import (
    ARTEFACTS,
    FAULTS,
    SUITES,
    Condition,
    chosen_levels,
    conditions,
    parse_levels,
    runs,
    strength_text,
)
from echoscape.sim.effects.sensor_faults import SensorFaults
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.settings.artefacts import Artefacts

BASE = Artefacts(rain=5.0)


def listed(*words: str, suite: str | None = None, grid: bool = False) -> tuple[Condition, ...]:
    return conditions(chosen_levels(words, suite), BASE, CTS350X, grid=grid)


def test_one_strength_is_changed_at_a_time() -> None:
    found = listed("ghosts=0,0.5", "clock-jitter=0.02")
    assert [each.name for each in found] == ["default", "ghosts=0", "ghosts=0.5", "clock_jitter=0.02"]
    assert [each.artefacts for each in found] == [
        BASE,
        replace(BASE, ghosts=0.0),
        replace(BASE, ghosts=0.5),
        BASE,
    ]
    assert [each.faults for each in found] == [SensorFaults()] * 3 + [SensorFaults(clock_jitter=0.02)]


def test_a_grid_has_every_combination() -> None:
    found = listed("ghosts=0,1", "gain_step=-3,0,3", grid=True)
    assert len(found) == 1 + 2 * 3
    assert found[1].name == "ghosts=0,gain_step=-3"
    assert {(each.artefacts.ghosts, each.faults.gain_step) for each in found[1:]} == {
        (ghosts, step) for ghosts in (0.0, 1.0) for step in (-3.0, 0.0, 3.0)
    }


def test_default_is_the_strength_of_the_default_condition() -> None:
    found = {
        each.name: each for each in listed("rain=default,off", "phase_noise=default", "range_scale=default")
    }
    assert found["rain=5"].levels == (("rain", 5.0),)
    assert found["rain=0"].artefacts.rain == 0.0
    assert found["range_scale=0"].faults == SensorFaults()
    assert (
        found[f"phase_noise={CTS350X.phase_noise_rad:.6g}"].artefacts.phase_noise == CTS350X.phase_noise_rad
    )


def test_conditions_of_the_same_scans_are_simulated_once() -> None:
    found = listed("ghosts=1,2", "phase_noise=default", "gain_step=0")
    first = runs(found, CTS350X)
    assert [first[each.name].name for each in found] == [
        "default",
        "default",
        "ghosts=2",
        "default",
        "default",
    ]


def test_the_stress_suite_has_one_strength_of_each() -> None:
    found = listed(suite="stress")
    names = [each.levels[0][0] for each in found[1:]]
    assert len(found) == 1 + len(SUITES["stress"]) == 1 + len(set(names))
    assert set(FAULTS) < set(names)
    assert {"rain", "interference"} < set(names)


def test_a_strength_beside_a_suite_is_added_to_those_of_the_suite() -> None:
    found = [each.name for each in listed("rain=10,50", "ghosts=0", "gain_step=3", suite="stress")]
    assert found[:6] == ["default", "rain=10", "rain=50", "ghosts=0", "gain_step=3", "gain_step=-10"]
    stresses = {each.name for each in listed(suite="stress")}
    assert stresses <= set(found)
    assert len(found) == len(stresses) + 3


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("ghosts", "must be NAME=STRENGTH,STRENGTH,..., got 'ghosts'"),
        ("ghosts=", "must be NAME=STRENGTH"),
        ("snow=1", r"must name an artefact \(speckle, .*\) or a fault \(dropped_scans, .*\), got 'snow'"),
        ("ghosts=0,much", "ghosts must have numbers, off or default as strengths, got 'much'"),
        ("speckle=0,2", "speckle must be between 0 and 1, got 2"),
        ("dropped_scans=1", "dropped_scans must be between 0 and 0.9, got 1"),
    ],
)
def test_words_that_are_no_levels_are_refused(word: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        parse_levels(word)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((), "an artefact or a suite must be given"),
        (("ghosts=0", "ghosts=1"), "ghosts must be given once, got it 2 times"),
        (("ghosts=1,default",), "strengths must differ in their first six digits, got ghosts=1 twice"),
    ],
)
def test_levels_that_do_not_go_together_are_refused(words: tuple[str, ...], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        listed(*words)


def test_unknown_suites_are_refused() -> None:
    with pytest.raises(ValueError, match="suite must be one of stress, got 'hard'"):
        listed(suite="hard")


def test_every_strength_has_a_text() -> None:
    for name in (*ARTEFACTS, *FAULTS):
        assert strength_text(name, 0.0) == "off"
        assert strength_text(name, 0.02) not in ("", "off")
    assert strength_text("clock_jitter", 0.02) == "20 ms"
    assert strength_text("range_scale", 0.01) == "+1 %"
