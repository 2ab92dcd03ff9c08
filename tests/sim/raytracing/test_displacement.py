"""Echoes over several surfaces: which of them show a surface of their path, by geometry done by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from echoscape.scenes.core.scene import Scene
from echoscape.sim.echoes import Echoes
from echoscape.sim.raytracing.displacement import Tolerance, displaced, tolerance
from echoscape.sim.sensor.antenna import Antenna
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.sim.settings.tracing import TraceSettings
from echoscape.sim.simulator import Simulator
from tests.sim.worlds import plate, quad, standing, world

STEADY = replace(CTS350X, rotation_jitter_s=1e-9)
HEIGHT_M = CTS350X.mount_height_m
ALLOWED = Tolerance(range_m=0.35, azimuth_rad=0.03)
GROUND = quad([[-80, -80, 0], [80, -80, 0], [80, 80, 0], [-80, 80, 0]])


def traced(town: Scene) -> Echoes:
    settings = TraceSettings(rays=1024, floor_db=-60.0)
    simulator = Simulator(
        town, standing(), seed=3, sensor=STEADY, settings=settings, artefacts=Artefacts(doppler=False)
    )
    return simulator.echoes(0)


def one(points: list[list[float]], *, same_path: bool) -> bool:
    """Whether the echo of one path from the origin over `points` is displaced; images by path length."""
    legs = np.diff([[0.0, 0.0, 0.0], *points], axis=0)
    length = np.linalg.norm(legs, axis=1).sum()
    out = np.array(points[0]) / np.linalg.norm(points[0]) * length
    back = out if same_path else np.array(points[-1])
    met = [np.array([each]).T for each in points]
    return bool(displaced(out[:, None], back[:, None], met, ALLOWED)[0])


point = st.tuples(st.floats(2, 100), st.floats(-math.pi, math.pi), st.floats(-3, 20)).map(
    lambda p: [p[0] * math.cos(p[1]), p[0] * math.sin(p[1]), p[2]]
)


@given(point)
def test_path_over_one_surface_is_never_displaced(at: list[float]) -> None:
    assert not one([at], same_path=True)
    assert not one([at], same_path=False)


@given(st.floats(5, 80), st.floats(0, 3), st.floats(-math.pi, math.pi))
def test_mirrored_point_is_displaced_from_two_resolution_cells_behind_the_mirror(
    mirror_m: float, behind_m: float, azimuth: float
) -> None:
    # Straight onto the mirror: the echo lies as far behind it as the point in front of it.
    ahead = np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
    path = [list(mirror_m * ahead), list((mirror_m - behind_m) * ahead)]
    if abs(behind_m - ALLOWED.range_m) > 1e-6 and behind_m < mirror_m - 1:
        assert one(path, same_path=True) == (behind_m > ALLOWED.range_m)


@given(st.floats(10, 80), st.floats(-1.2, 1.2))
def test_echo_at_the_range_of_a_surface_in_another_direction_is_displaced(
    range_m: float, turn: float
) -> None:
    # Outwards along x to a mirror at a metre, then onto a point whose own range is half the path.
    mirror = np.array([0.2, 0.0, 0.0])
    at = range_m * np.array([math.cos(turn), math.sin(turn), 0.0])
    if not 0.025 < abs(turn) < 0.035:
        assert one([list(mirror), list(at)], same_path=True) == (abs(turn) > ALLOWED.azimuth_rad)


@given(st.floats(3, 8), st.floats(0.0, 0.034))
def test_loop_is_shown_half_way_between_the_directions_of_its_legs(range_m: float, aside: float) -> None:
    # Two points at one range, to the left and to the right: half the loop is longer by less than two cells.
    there, back = ([range_m * math.cos(turn), range_m * math.sin(turn), 0.0] for turn in (aside, -aside))
    if abs(aside - ALLOWED.azimuth_rad) > 1e-6:
        assert one([there, back], same_path=False) == (aside > ALLOWED.azimuth_rad)


def test_tolerance_is_two_range_cells_and_a_beam_width() -> None:
    # c / 2B and the width at -3 dB of the two-way pattern, that of the table widened by rotation.
    allowed = tolerance(CTS350X, Antenna(CTS350X))
    assert allowed.range_m == pytest.approx(2 * 299_792_458 / (2 * CTS350X.bandwidth_hz))
    offset, level = np.array(CTS350X.azimuth_pattern_db).T
    at_rest = 2 * np.interp(3.0, -level[:4], offset[:4])
    assert at_rest < math.degrees(allowed.azimuth_rad) < at_rest + 0.9


def of(echoes: Echoes, bounces: int, *surfaces: int) -> NDArray[np.bool_]:
    """Which echoes have a bounce order, and these surfaces in order on their outward path."""
    wanted = np.zeros(echoes.returns.surfaces.shape[1], np.uint32)
    wanted[: len(surfaces)] = surfaces
    return ((echoes.returns.surfaces == wanted).all(axis=1) & (echoes.returns.bounces == bounces))[
        echoes.source
    ]


def test_double_bounces_of_a_corner_lie_at_the_corner() -> None:
    # A wall 2 m high, 40 m away, on smooth ground: over the ground, out and back, its top at z = 2 m comes
    # 2 h z / d = 0.2 m later than directly, on one way only half as much; two cells are 0.47 m.
    wall = plate([40.0, 0, 1.0], [-1, 0], 12.0, 2.0)
    echoes = traced(world(("concrete", "wall", wall), ("concrete", "road", GROUND)))
    for bounces, surfaces in ((2, (2, 1)), (3, (2, 1))):
        corner = of(echoes, bounces, *surfaces)
        assert corner.sum() > 1000
        assert not echoes.displaced[corner].any()
    reverse = of(echoes, 2, 1, 2) & (np.abs(echoes.range_m - 40.0) < 0.3)
    power = echoes.mean_power[reverse]
    assert power[echoes.displaced[reverse]].sum() < 1e-3 * power.sum()  # few rays leave to the side
    assert not echoes.displaced[echoes.bounces == 1].any()


def test_plate_mirrored_in_a_wall_is_displaced() -> None:
    # The image of (12, 18) in a wall at x = 30 lies at (48, 18), 51.3 m away; the wall there at 32.
    wall = plate([30.0, 0, 5.0], [-1, 0], 200.0, 10.0)
    behind = plate([12.0, 18.0, HEIGHT_M], [1, 0], 1.5, 1.5)
    echoes = traced(world(("concrete", "wall", wall), ("soil", "car", behind)))
    ghost = of(echoes, 3, 1, 2)
    assert ghost.sum() > 100
    assert np.average(echoes.range_m[ghost], weights=echoes.mean_power[ghost]) == pytest.approx(51.3, abs=0.5)
    assert echoes.displaced[ghost].all()
    assert not echoes.displaced[echoes.bounces == 1].any()


def test_loop_over_two_distant_surfaces_is_displaced() -> None:
    # Radar - wall - plate - radar: half the loop, (51.3 + 21.6) / 2 = 36.4 m, is at neither of them.
    wall = plate([30.0, 0, 5.0], [-1, 0], 200.0, 10.0)
    side = plate([12.0, 18.0, HEIGHT_M], [0.3, -1], 1.5, 1.5)
    echoes = traced(world(("metal", "wall", wall), ("soil", "car", side)))
    loop = of(echoes, 2, 1, 2)
    assert loop.sum() > 100
    assert np.average(echoes.range_m[loop], weights=echoes.mean_power[loop]) == pytest.approx(36.4, abs=0.5)
    assert echoes.displaced[loop].all()


def test_ledge_on_a_mirror_is_seen_in_its_place() -> None:
    # A ledge of 0.3 m stands out of the wall: both paths over wall and ledge show the corner between them.
    wall = plate([30.0, 0, 5.0], [-1, 0], 200.0, 10.0)
    ledge = plate([29.85, 8.0, HEIGHT_M], [0, -1], 0.3, 2.0)
    echoes = traced(world(("metal", "wall", wall), ("soil", "car", ledge)))
    corner = of(echoes, 2, 1, 2) | of(echoes, 3, 1, 2)
    assert corner.sum() > 30
    assert echoes.range_m[corner] == pytest.approx(math.hypot(30.0, 8.0), abs=0.4)
    assert not echoes.displaced[corner].any()
