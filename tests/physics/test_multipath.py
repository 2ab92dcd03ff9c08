"""Ghosts: where they lie, that a bounce limit removes them, and that the mask marks what it removes."""

import math
from dataclasses import replace

import numpy as np
import pytest

from echoscape.scenes.core.scene import Scene
from echoscape.sim.datasets.polar_scan import Component
from echoscape.sim.echoes import Echoes
from echoscape.sim.receiver.if_signal import echo_grid
from echoscape.sim.receiver.receiver import receive
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.sim.settings.tracing import TraceSettings
from echoscape.sim.simulator import Simulator
from tests.physics.laws import LawRecorder
from tests.physics.tracing import HEIGHT_M, ROW_DEG, STEADY, traced
from tests.sim.worlds import plate, quad, standing, world

SECTION = "Multipath"
IMAGE = "image theory: a wall at x = 30 m images x = 20 m to 40 m"
WALL = ("metal", "wall", plate([30.0, 0, 5.0], [-1, 0], 120.0, 10.0))
CAR = ("soil", "car", plate([20.0, 12.0, HEIGHT_M], [1, 0], 2.0, 1.5))
"""A rough plate that faces the wall: illuminated by way of the wall only."""
ROAD = ("concrete", "road", quad([[-80, -80, 0], [80, -80, 0], [80, 80, 0], [-80, 80, 0]]))
FIRST_CODE = 1.26
"""The least power with a code above 0."""
ONLY_ECHOES = Artefacts(
    thermal_noise=False,
    leakage=False,
    phase_noise=False,
    saturation=False,
    quantisation=False,
    sidelobes=False,
)


@pytest.fixture(scope="module")
def yard() -> Echoes:
    return traced(world(WALL, CAR), max_bounces=3, floor_db=-30.0, sensor=STEADY)


def mean_place(echoes: Echoes, mine: np.ndarray) -> tuple[float, float]:
    """Range [m] and azimuth [deg] of echoes, weighted by power."""
    weight = echoes.mean_power[mine]
    rows = (echoes.azimuth[mine] + 200) % 400 - 200
    return float(np.average(echoes.range_m[mine], weights=weight)), ROW_DEG * float(
        np.average(rows, weights=weight)
    )


def test_ghost_lies_at_the_mirror_image(law: LawRecorder, yard: Echoes) -> None:
    range_m, azimuth_deg = mean_place(yard, (yard.bounces == 3) & (yard.instance == 2) & ~yard.sidelobe)
    law(
        "Ghost of a car in a wall: range",
        source=IMAGE,
        expected=math.hypot(40.0, 12.0),
        simulated=range_m,
        tolerance=0.2,
        unit="m",
        why="the car is 2 m wide, and its power falls across it",
    )
    law(
        "Ghost of a car in a wall: azimuth",
        source=IMAGE,
        expected=-math.degrees(math.atan2(12.0, 40.0)),
        simulated=azimuth_deg,
        tolerance=0.3,
        unit="deg",
        why="a third of an azimuth",
    )


def test_loop_lies_at_half_the_total_path(law: LawRecorder) -> None:
    side = ("soil", "car", plate([25.0, 4.0, HEIGHT_M], [0, -1], 1.0, 2.0))
    echoes = traced(world(WALL, side), max_bounces=2, floor_db=-30.0, sensor=STEADY)
    range_m, _ = mean_place(echoes, (echoes.bounces == 2) & (echoes.instance == 2))
    law(
        "Out by way of the wall and directly back: range",
        source="half the total path",
        expected=(math.hypot(25.0, 4.0) + math.hypot(35.0, 4.0)) / 2,
        simulated=range_m,
        tolerance=0.2,
        unit="m",
        why="the plate is 1 m wide",
    )


def test_bounce_limit_of_one_removes_every_ghost(law: LawRecorder, yard: Echoes) -> None:
    first = traced(world(WALL, CAR), max_bounces=1, floor_db=-30.0, sensor=STEADY)
    assert (yard.bounces == 3).any()
    direct = yard.select(yard.bounces == 1)
    assert np.array_equal(direct.amplitude, first.amplitude)
    assert np.array_equal(direct.range_m, first.range_m)
    law(
        "Echoes of more than one bounce under a bounce limit of 1",
        source="by definition; direct echoes stay as they are, bit for bit",
        expected=0,
        simulated=int(np.sum(first.bounces > 1)),
        tolerance=0,
        why="every one",
    )


def displaced_share(echoes: Echoes, mine: np.ndarray) -> float:
    """Share of the power of echoes that shows none of the surfaces on its path."""
    power = echoes.mean_power[mine].astype(np.float64)
    return float(power[echoes.displaced[mine]].sum() / power.sum())


def test_ghosts_are_displaced_and_corners_are_not(law: LawRecorder, yard: Echoes) -> None:
    law(
        "Ghost of a car in a wall: share of its power that is flagged displaced",
        source="its image lies 10 m behind the wall",
        expected=1.0,
        simulated=displaced_share(yard, (yard.bounces == 3) & (yard.instance == 2)),
        tolerance=0,
        why="every echo",
    )
    low_wall = ("concrete", "wall", plate([40.0, 0, 1.0], [-1, 0], 12.0, 2.0))
    echoes = traced(world(low_wall, ROAD), max_bounces=3, floor_db=-30.0, sensor=STEADY)
    corner = (echoes.bounces > 1) & (np.abs(echoes.range_m - 40.2) < 0.3)
    assert corner.sum() > 300
    law(
        "Road and wall of 2 m, 40 m away: share of the double bounces' power that is flagged displaced",
        source="by the road its top appears 2 h z / d = 0.2 m farther, less than two range cells",
        expected=0.0,
        simulated=displaced_share(echoes, corner),
        tolerance=1e-3,
        why="a few rays leave the wall to the side",
    )


def scan_power(town: Scene, *, ghosts: bool, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Power of a scan's cells (400, bins) without noise, and their labels."""
    simulator = Simulator(
        town,
        standing(),
        seed=seed,
        sensor=STEADY,
        settings=TraceSettings(rays=256),
        artefacts=replace(ONLY_ECHOES, ghosts=ghosts),
    )
    rngs = [np.random.default_rng(k) for k in (0, 1)]
    grid = echo_grid(simulator.echoes(0), STEADY)
    received = receive(grid, STEADY, simulator.artefacts, noise_rng=rngs[0], phase_rng=rngs[1])
    truth = simulator.scan(0).truth
    return received.power, np.zeros(0) if truth is None else truth.cells.component


def with_and_without_ghosts(town: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Labels (400, bins) of a scan's cells, and which of them are above 0 only with ghosts."""
    (seen, labels), (alone, _) = (scan_power(town, ghosts=ghosts, seed=1) for ghosts in (True, False))
    return labels, (seen >= FIRST_CODE) & (alone < FIRST_CODE)


def ghosts_outweigh(town: Scene) -> np.ndarray:
    """Cells (400, bins) whose power over six speckles is eight times as high with ghosts as without."""
    seen, alone = (
        np.mean([scan_power(town, ghosts=ghosts, seed=seed)[0] for seed in range(1, 7)], axis=0)
        for ghosts in (True, False)
    )
    return seen > 8 * alone


def test_ghost_mask_marks_what_vanishes(law: LawRecorder) -> None:
    labels, gone = with_and_without_ghosts(world(WALL, CAR))
    ghost, sidelobe = labels == Component.GHOST, labels == Component.SIDELOBE
    assert ghost.sum() > 100
    law(
        "Wall and car alone: cells labelled ghost that remain without ghosts",
        source="the label is the dominant cause of a cell",
        expected=0,
        simulated=int(np.sum(ghost & ~gone)),
        tolerance=0,
        why="every cell",
    )
    law(
        "Wall and car alone: vanishing cells that are neither ghost nor the range window's sidelobe",
        source="the label is the dominant cause of a cell",
        expected=0,
        simulated=int(np.sum(gone & ~ghost & ~sidelobe)),
        tolerance=0,
        why="every cell",
    )
    for ground, tolerance in (("concrete", 0.005), ("asphalt", 0.02)):
        town = world(WALL, CAR, (ground, *ROAD[1:]))
        labels, gone = with_and_without_ghosts(town)
        gone &= ghosts_outweigh(town)
        assert gone.sum() > 400
        law(
            f"Wall, car and a road of {ground}: vanishing cells of mostly ghosts, share labelled ghost",
            source="the label is the dominant cause of a cell",
            expected=1.0,
            simulated=float(np.mean(labels[gone] == Component.GHOST)),
            tolerance=tolerance,
            why="mostly: by 9 dB over six speckles; in one of these a ghost may fade below the road",
        )
