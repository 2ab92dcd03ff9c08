"""One pipeline: settings that share steps get the bytes of separate simulators, and each step runs once."""

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

from echoscape.scenes.driving.body_motion import with_body_motion
from echoscape.sim import simulator as scan
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.effects.echo_filter import EchoFilter
from echoscape.sim.receiver.receiver import received
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.sim.settings.tracing import TraceSettings
from echoscape.sim.simulator import Simulator
from tests.sim.worlds import Ride, box_prototype, mover, plate, quad, straight, world

ON = {"rain": 10.0, "interference": 1.0}
SETTINGS = [
    Artefacts(),
    *(replace(Artefacts(), **{each.name: ON.get(each.name, 0.0)}) for each in fields(Artefacts)),
    Artefacts(phase_noise=0.05),
    Artefacts(thermal_noise=1000.0, leakage=0.5),
    Artefacts(speckle=0.5, phase_noise=0.02),
    Artefacts(),
]


def simulator(artefacts: Artefacts | None = None) -> Simulator:
    ground = quad([[-150, -150, 0], [150, -150, 0], [150, 150, 0], [-150, 150, 0]])
    town = world(("asphalt", "road", ground), ("concrete", "building", plate([10, 15, 4], [0, -1], 60, 8)))
    car = box_prototype("box", (4.0, 1.8, 1.5), "metal")
    movers = [mover(10 + k, car, straight([25.0 + 15 * k, -4.0], [-6.0, 0.0])) for k in range(3)]
    level = straight([0.0, 0.0], [10.0, 0.0]).trajectory
    ride = Ride(with_body_motion(level, seed=5, roughness_m3=4e-4))
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
    np.testing.assert_array_equal(among.truth.attitude, alone.truth.attitude)
    np.testing.assert_array_equal(among.truth.boxes.instance, alone.truth.boxes.instance)
    np.testing.assert_array_equal(among.truth.first_obstacle_m, alone.truth.first_obstacle_m)


def test_settings_differ(together: list[PolarScan]) -> None:
    for setting, other in zip(SETTINGS[1:-1], together[1:-1], strict=True):
        assert np.any(other.codes != together[0].codes), setting


def test_without_truth_the_codes_stay(together: list[PolarScan]) -> None:
    bare = simulator().scans(1, SETTINGS[::4], truth=False)
    for plain, whole in zip(bare, together[::4], strict=True):
        assert plain.truth is None
        np.testing.assert_array_equal(plain.codes, whole.codes)


def test_settings_in_another_order_are_the_same_scans(together: list[PolarScan]) -> None:
    # More strengths than the receiver keeps results of, so that some are computed again.
    swept = [Artefacts(leakage=k % 2, phase_noise=0.01 * (1 + k)) for k in range(6)]
    made = simulator()
    there, back = made.scans(1, [*swept, Artefacts()]), made.scans(1, [Artefacts(), *swept[::-1]])
    for one, other in zip(there, back[::-1], strict=True):
        np.testing.assert_array_equal(one.codes, other.codes)
        assert one.truth is not None
        assert other.truth is not None
        np.testing.assert_array_equal(one.truth.cells.component, other.truth.cells.component)
        np.testing.assert_array_equal(one.truth.cells.instance, other.truth.cells.instance)
    np.testing.assert_array_equal(there[6].codes, together[0].codes)


def test_settings_of_equal_strengths_are_one_scan(monkeypatch: pytest.MonkeyPatch) -> None:
    made = simulator()
    count = []
    monkeypatch.setattr(scan, "received", lambda *a, **k: count.append(1) or received(*a, **k))
    same = Artefacts(phase_noise=made.sensor.phase_noise_rad, doppler=made.sensor.doppler_beta_s)
    scans = made.scans(0, [Artefacts(), same, Artefacts(leakage=0.0), Artefacts()], truth=False)
    assert len(count) == 2
    assert scans[0] is scans[1] is scans[3]


def test_scene_is_traced_once(monkeypatch: pytest.MonkeyPatch) -> None:
    made = simulator()
    count = []
    trace = made._tracer.trace
    monkeypatch.setattr(made._tracer, "trace", lambda *a, **k: count.append(1) or trace(*a, **k))
    assert made.scans(0, []) == []
    assert count == []
    made.scans(0, [each for each in SETTINGS if each.movers == each.motion_distortion == each.attitude == 1])
    assert len(count) == 1
    made.scans(0, SETTINGS)
    assert len(count) == 5  # and once for each of movers, motion distortion and attitude


def _counted(monkeypatch: pytest.MonkeyPatch, owner: object, name: str) -> list[int]:
    """Count the calls of a function or method."""
    calls, function = [], getattr(owner, name)
    monkeypatch.setattr(owner, name, lambda *a, **k: calls.append(1) or function(*a, **k))
    return calls


def test_one_scan_has_one_state_and_one_launch_in_rain_and_interference(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made = simulator(Artefacts(rain=10.0, interference=1.0))
    states, poses, launches, movers = (
        _counted(monkeypatch, owner, name)
        for owner, name in (
            (scan, "scan_state"),
            (made._timeline, "poses"),
            (made._tracer, "launch"),
            (made._timeline, "movers"),
        )
    )
    made.scan(0)
    assert (len(states), len(poses), len(launches)) == (1, 1, 1)
    assert len(movers) == 2  # within the range of the sensor, and within that of interference


def test_scans_in_any_order_are_the_same(together: list[PolarScan]) -> None:
    made = simulator()
    made.scan(4)
    again = made.scan(1)
    np.testing.assert_array_equal(again.codes, together[0].codes)


@pytest.mark.parametrize("index", [1.5, -1, "2"])
def test_scans_are_counted_in_whole_numbers_from_zero(index: Any) -> None:
    made = simulator()
    for simulate in (made.scan, made.echoes, made.revolution):
        with pytest.raises(ValueError, match=r"^index must be (a whole number|0 or more), got "):
            simulate(index)


def test_given_echoes_are_not_traced_again(monkeypatch: pytest.MonkeyPatch) -> None:
    made = simulator(Artefacts(rain=10.0))
    whole, echoes = made.scan(2), made.echoes(2)
    traces, launches = (_counted(monkeypatch, made._tracer, name) for name in ("trace", "launch"))
    given = made.scan(2, echoes=echoes)
    np.testing.assert_array_equal(given.codes, whole.codes)
    assert (len(traces), len(launches)) == (0, 1)  # rain needs to know how far the beam reaches
    made.scan(2, echoes=echoes, without=EchoFilter(components=("rain",)))
    assert len(launches) == 1
