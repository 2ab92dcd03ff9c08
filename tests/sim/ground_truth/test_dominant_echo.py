"""The dominant echoes of cells: which kind and return wins, and that earlier queries change no result."""

from dataclasses import replace

import numpy as np

from echoscape.sim.datasets.polar_scan import Component
from echoscape.sim.echoes import Echoes, point_echoes
from echoscape.sim.ground_truth.dominant_echo import DominantEchoIndex
from echoscape.sim.receiver.front_end import PART_STEP
from echoscape.sim.sensor.cts350x import CTS350X

SENSOR = replace(CTS350X, azimuths=4)
STEPS = -(-SENSOR.bins // PART_STEP)
WIDE = np.array([1.0, 0.5, 0.25], np.float32)
FLAT = np.array([1.0, 1.0, 1.0], np.float32)


def echoes(count: int = 300) -> Echoes:
    """Echoes at random ranges, a third of them ghosts."""
    rng = np.random.default_rng(3)
    made = point_echoes(
        azimuth=rng.integers(0, 4, count),
        range_m=rng.uniform(5, 20, count),
        amplitude=rng.uniform(0.1, 1, count) * np.exp(2j * np.pi * rng.random(count)),
        azimuths=4,
    )
    ghosts = np.where(np.arange(count) % 3 == 0, 3, 1).astype(np.uint8)
    return replace(made, returns=replace(made.returns, bounces=ghosts))


def index() -> DominantEchoIndex:
    return DominantEchoIndex(echoes(), SENSOR, steps=STEPS)


def test_stronger_kind_wins_and_powers_add_under_the_point_spread() -> None:
    step_m = SENSOR.bin_m * PART_STEP
    middle = 100  # a step; its centre is half a step beyond its edge
    pair = point_echoes(
        azimuth=np.array([2, 2]),
        range_m=(np.array([middle, middle + 1]) + 0.5) * step_m,
        amplitude=np.array([1.0, 2.0]),
        azimuths=4,
    )
    pair = replace(pair, returns=replace(pair.returns, bounces=np.array([1, 2], np.uint8)))
    made = DominantEchoIndex(pair, SENSOR, steps=STEPS)
    cells = 2 * STEPS + np.array([middle - 1, middle, middle + 1, middle + 4])
    found = made.within(WIDE, cells)
    # Powers 1 and 4, at 1 and 2, 0 and 1, 1 and 0 steps, and beyond the point spread.
    np.testing.assert_allclose(found.power, [0.5 + 4 * 0.25, 1 + 4 * 0.5, 0.5 + 4, 0], rtol=1e-6)
    assert found.kind[:3].tolist() == [Component.GHOST] * 3
    assert found.source[:3].tolist() == [1, 1, 1]


def test_earlier_queries_change_no_result() -> None:
    cells = np.arange(4 * STEPS)
    fresh, used = index().within(WIDE, cells), index()
    used.within(FLAT, cells[::2])  # a point spread of the same length
    used.within(WIDE, cells[5::7])
    again = used.within(WIDE, cells)
    for name in ("power", "kind", "source"):
        np.testing.assert_array_equal(getattr(again, name), getattr(fresh, name))
    assert np.any(used.within(FLAT, cells).power != fresh.power)
