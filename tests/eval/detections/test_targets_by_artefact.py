"""In a small world one artefact at a time is switched on: what it adds is counted as its own cause."""

from dataclasses import replace

import numpy as np
import pytest

from echoscape.eval.detections.k_strongest import KStrongest, KStrongestSettings
from echoscape.eval.detections.targets import LABELS, OUTSIDE, JudgeSettings, ScanTargets
from echoscape.sim.sensor.cts_small import CTS_SMALL
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.sim.settings.tracing import TraceSettings
from echoscape.sim.simulator import Simulator
from tests.sim.worlds import box_prototype, mover, plate, quad, standing, straight, world

ALONE = Artefacts(
    ghosts=0,
    sidelobes=0,
    thermal_noise=0,
    leakage=0,
    phase_noise=0,
    saturation=0,
    quantisation=0,
    motion_distortion=0,
)
ALL = KStrongest(KStrongestSettings(k=10_000, floor_db=3.0, near_m=0.0))
"""Every cell with a code of 6 or more, the lowest that is not 0."""


def simulator(artefacts: Artefacts) -> Simulator:
    town = world(
        ("metal", "wall", plate([30.0, 0, 5.0], [-1, 0], 120.0, 10.0)),
        ("soil", "building", plate([20.0, 12.0, 2.0], [1, 0], 2.0, 1.5)),
        ("asphalt", "road", quad([[-80, -80, 0], [80, -80, 0], [80, 80, 0], [-80, 80, 0]])),
    )
    cars = [mover(4, box_prototype("box", (4.0, 2.0, 2.0), "metal"), straight([20.0, -6.0], [-8.0, 0.0]))]
    return Simulator(
        town,
        standing(),
        cars,
        seed=1,
        sensor=CTS_SMALL,
        settings=TraceSettings(rays=128),
        artefacts=artefacts,
    )


def counts(artefacts: Artefacts, judge: JudgeSettings | None = None) -> dict[str, int]:
    """Number of judged cells by what they fell on."""
    scan = simulator(artefacts).scan(0)
    assert scan.truth is not None
    targets = ScanTargets(scan, scan.truth.cells, CTS_SMALL, judge or JudgeSettings(near_m=0.0))
    labels = targets.label(ALL.detect(scan).detections)
    found = np.bincount(labels[labels != OUTSIDE], minlength=len(LABELS))
    return {label: int(count) for label, count in zip(LABELS, found, strict=True) if count}


@pytest.fixture(scope="module")
def alone() -> dict[str, int]:
    return counts(replace(ALONE, movers=0))


def test_without_artefacts_only_sidelobes_of_the_range_window_are_false(alone: dict[str, int]) -> None:
    assert set(alone) <= {"direct", "sidelobe"}
    assert alone["direct"] > 2 * alone.get("sidelobe", 0)


@pytest.mark.parametrize(
    ("artefact", "strength", "causes"),
    [
        ("ghosts", 1.0, {"ghost", "multipath in place"}),
        ("thermal_noise", True, {"noise"}),
        ("phase_noise", 0.2, {"spoke"}),
        ("quantisation", 0.05, {"spoke"}),
        ("leakage", 1.0, {"leakage"}),
        ("rain", 50.0, {"rain"}),
        ("movers", 1.0, {"mover"}),
    ],
)
def test_an_artefact_is_counted_as_its_own_cause_and_as_no_other(
    artefact: str, strength: float, causes: set[str], alone: dict[str, int]
) -> None:
    found = counts(replace(ALONE, **{"movers": 0, artefact: strength}))
    assert set(found) - set(alone) == causes
    assert all(found[cause] > 20 for cause in causes)


def test_interference_of_a_moving_car_is_counted(alone: dict[str, int]) -> None:
    found = counts(replace(ALONE, interference=100.0, movers=1.0))
    assert set(found) - set(alone) - {"mover"} == {"interference"}
    assert found["interference"] > 20


def test_sidelobes_of_the_beam_add_to_sidelobes_only(alone: dict[str, int]) -> None:
    found = counts(replace(ALONE, movers=0, sidelobes=30.0))
    assert set(found) == {*alone, "sidelobe"}
    assert found["sidelobe"] > 2 * alone.get("sidelobe", 0)


def test_where_movers_are_targets_their_echoes_are_true() -> None:
    judge = JudgeSettings(near_m=0.0, targets="direct")
    found = counts(replace(ALONE, movers=1.0), judge)
    assert "mover" not in found
    assert found["direct"] > counts(replace(ALONE, movers=1.0))["direct"]
