"""Ablations of one traced scan: the bytes of a simulator of their own each."""

from dataclasses import fields, replace

import numpy as np
import pytest

from echoscape.sim.artefacts import Artefacts
from echoscape.sim.polar_scan import PolarScan
from echoscape.sim.scan import Simulator
from echoscape.sim.trace_settings import TraceSettings
from tests.sim.worlds import box_prototype, mover, plate, quad, straight, world

ON = {"rain": 10.0, "interference": 1.0}
SETTINGS = [
    Artefacts(),
    *(replace(Artefacts(), **{each.name: ON.get(each.name, 0.0)}) for each in fields(Artefacts)),
    Artefacts(),
]


def simulator(artefacts: Artefacts | None = None) -> Simulator:
    ground = quad([[-150, -150, 0], [150, -150, 0], [150, 150, 0], [-150, 150, 0]])
    town = world(("asphalt", "road", ground), ("concrete", "building", plate([10, 15, 4], [0, -1], 60, 8)))
    car = box_prototype("box", (4.0, 1.8, 1.5), "metal")
    movers = [mover(10 + k, car, straight([25.0 + 15 * k, -4.0], [-6.0, 0.0])) for k in range(3)]
    ride = straight([0.0, 0.0], [10.0, 0.0])
    return Simulator(
        town, ride, movers, seed=5, settings=TraceSettings(rays=16), artefacts=artefacts or Artefacts()
    )


@pytest.fixture(scope="module")
def together() -> list[PolarScan]:
    return simulator().scans(1, SETTINGS)


@pytest.mark.parametrize("number", range(len(SETTINGS)))
def test_scans_are_those_of_separate_simulators(together: list[PolarScan], number: int) -> None:
    alone, among = simulator(SETTINGS[number]).scan(1), together[number]
    np.testing.assert_array_equal(among.codes, alone.codes)
    assert alone.truth is not None
    assert among.truth is not None
    for name in ("component", "instance", "class_id", "bounces", "moving"):
        np.testing.assert_array_equal(getattr(among.truth.cells, name), getattr(alone.truth.cells, name))
    np.testing.assert_array_equal(among.truth.pose, alone.truth.pose)
    np.testing.assert_array_equal(among.truth.boxes.instance, alone.truth.boxes.instance)
    np.testing.assert_array_equal(among.truth.first_m, alone.truth.first_m)


def test_settings_differ(together: list[PolarScan]) -> None:
    for setting, scan in zip(SETTINGS[1:-1], together[1:-1], strict=True):
        assert np.any(scan.codes != together[0].codes), setting


def test_without_truth_the_codes_stay(together: list[PolarScan]) -> None:
    bare = simulator().scans(1, SETTINGS[::4], truth=False)
    for scan, whole in zip(bare, together[::4], strict=True):
        assert scan.truth is None
        np.testing.assert_array_equal(scan.codes, whole.codes)


def test_world_is_traced_once(monkeypatch: pytest.MonkeyPatch) -> None:
    made = simulator()
    count = []
    trace = made._tracer.trace
    monkeypatch.setattr(made._tracer, "trace", lambda *a, **k: count.append(1) or trace(*a, **k))
    assert made.scans(0, []) == []
    assert count == []
    made.scans(0, [each for each in SETTINGS if each.movers == each.motion_distortion == 1])
    assert len(count) == 1
    made.scans(0, SETTINGS)
    assert len(count) == 4  # and once for each of movers and motion distortion
