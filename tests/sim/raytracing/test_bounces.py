"""Laws of single paths: frames, mirrors, loops, shadows, motion, each against a value computed by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest

from echoscape.scenes.core.materials import MATERIALS
from echoscape.scenes.core.scene import Mover, Placements, Scene
from echoscape.sim.echoes import Echoes
from echoscape.sim.raytracing.surface.fresnel import permittivity, reflection
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.sim.settings.tracing import TraceSettings
from echoscape.sim.simulator import Simulator
from tests.sim.worlds import Ride, box_prototype, decibel, mover, plate, standing, straight, world

FINE = TraceSettings(rays=1024, floor_db=-60.0)
STEADY = replace(CTS350X, rotation_jitter_s=1e-9, encoder_first=0)
HEIGHT_M = CTS350X.mount_height_m
AZIMUTH_RAD = 2 * math.pi / CTS350X.azimuths


def traced(
    town: Scene,
    ride: Ride,
    movers: tuple[Mover, ...] = (),
    *,
    sensor=STEADY,
    settings=FINE,
    **artefacts: bool,
) -> Echoes:
    simulator = Simulator(
        town, ride, movers, seed=3, sensor=sensor, settings=settings, artefacts=Artefacts(**artefacts)
    )
    return simulator.echoes(0)


def mean_azimuth(echoes: Echoes, mine: np.ndarray) -> float:
    """Azimuth about which the echoes lie, weighted by power, between -200 and 200."""
    azimuths = (echoes.azimuth[mine] + 200) % 400 - 200
    return float(np.average(azimuths, weights=echoes.mean_power[mine]))


@pytest.mark.parametrize("yaw", [-2.0, 0.9, 3.0])
def test_azimuth_grows_clockwise_from_the_heading(yaw: float) -> None:
    # The plate lies 30 m away, 0.4 rad to the right of where the car heads.
    bearing = yaw - 0.4
    x, y = 30 * math.cos(bearing), 30 * math.sin(bearing)
    echoes = traced(world(("soil", "target", plate([x, y, HEIGHT_M], [-x, -y], 0.5, 0.5))), standing(yaw=yaw))
    assert mean_azimuth(echoes, ~echoes.sidelobe) * AZIMUTH_RAD == pytest.approx(0.4, abs=0.3 * AZIMUTH_RAD)


def test_placed_objects_stand_at_their_placement() -> None:
    # A box 4 m long, twice as large, turned by a right angle: its long side across, its near face 2 m nearer.
    town = replace(
        world(),
        prototypes=(box_prototype("box", (4.0, 2.0, 2.0), "soil"),),
        placements=Placements(
            prototype=np.zeros(1, np.uint32),
            instance=np.ones(1, np.uint32),
            position=np.array([[30.0, 0.0, 0.0]]),
            yaw=np.array([math.pi / 2]),
            scale=np.array([2.0]),
        ),
        instance_class=np.array([0, 16], np.uint8),
    )
    echoes = traced(town, standing())
    ahead = (echoes.azimuth == 0) & (echoes.bounces == 1)
    assert np.average(echoes.range_m[ahead], weights=echoes.mean_power[ahead]) == pytest.approx(28.0, abs=0.1)
    azimuths = (echoes.azimuth[(echoes.bounces == 1) & ~echoes.sidelobe] + 200) % 400 - 200
    assert azimuths.max() * AZIMUTH_RAD == pytest.approx(math.atan2(4.0, 28.0), abs=4 * AZIMUTH_RAD)
    assert (echoes.instance == 1).all()


def test_alternating_sweeps_shift_neighbouring_azimuths_in_opposite_directions() -> None:
    # At 12 m/s towards a plate beta v = 0.588 m: nearer where the sweep rises (odd azimuths), else farther.
    town = world(("soil", "target", plate([40.0, 0, HEIGHT_M], [-1, 0], 3.0, 0.5)))
    sensor = replace(STEADY, chirps="alternating")
    echoes, still = (
        traced(town, straight([0, 0], [12.0, 0]), sensor=sensor, doppler=on) for on in (True, False)
    )
    for azimuth in (0, 1, 2, 3, 397, 398, 399):
        there, here = (
            np.average(
                each.range_m[each.azimuth == azimuth], weights=each.mean_power[each.azimuth == azimuth]
            )
            for each in (still, echoes)
        )
        assert here - there == pytest.approx(-0.588 if azimuth % 2 else 0.588, abs=0.01)


@pytest.mark.parametrize(("speed", "shift"), [(12.0, 0.588), (-12.0, -0.588)])
def test_receding_mover_shifts_outwards_and_approaching_one_inwards(speed: float, shift: float) -> None:
    # beta v = 0.049 s x 12 m/s; a rising sweep shows an approaching object nearer.
    box = box_prototype("box", (2.0, 2.0, 3.0), "soil")
    movers = (mover(1, box, straight([40.0, 0.0], [speed, 0.0], yaw=0.0)),)
    plain, shifted = (traced(world(), standing(), movers, doppler=on) for on in (False, True))
    assert shifted.closing_mps == pytest.approx(-speed, abs=0.3)
    mean = [np.average(echoes.range_m, weights=echoes.mean_power) for echoes in (plain, shifted)]
    assert mean[1] - mean[0] == pytest.approx(shift, abs=0.02)


@pytest.mark.parametrize("distortion", [True, False])
def test_every_row_hears_a_mover_at_its_own_time(distortion: bool) -> None:
    # Dead astern, so that neighbouring azimuths are taken within milliseconds: its near face at 29 m, 30 m/s.
    box = box_prototype("box", (2.0, 8.0, 3.0), "soil")
    movers = (mover(1, box, straight([-30.0, 0.0], [-30.0, 0.0], yaw=0.0)),)
    echoes = traced(world(), standing(), movers, doppler=False, motion_distortion=distortion)
    for azimuth in (196, 200, 204):
        here = (echoes.azimuth == azimuth) & (echoes.bounces == 1)
        time = STEADY.azimuth_period_s * (azimuth if distortion else 199.5)
        near = (29.0 + 30.0 * time) / math.cos((azimuth - 200) * AZIMUTH_RAD)
        found = np.average(echoes.range_m[here], weights=echoes.mean_power[here])
        assert found == pytest.approx(near, abs=0.05)


def test_without_distortion_the_seam_is_no_place_for_jumps() -> None:
    box = box_prototype("box", (2.0, 8.0, 3.0), "soil")
    movers = (mover(1, box, straight([40.0, 0.0], [-20.0, 0.0], yaw=0.0)),)
    echoes = traced(world(), standing(), movers, doppler=False, motion_distortion=False)
    near = 40.0 - 1.0 - 20.0 * STEADY.azimuth_period_s * 199.5
    for azimuth in (398, 399, 0, 1):
        here = echoes.range_m[(echoes.azimuth == azimuth) & (echoes.bounces == 1)]
        assert here.min() > near - 0.3
        assert np.median(here) == pytest.approx(near, abs=0.3)


def test_power_is_even_round_the_turn_while_the_car_turns() -> None:
    # A rough ring about a car that yaws at 0.5 rad/s: no azimuth is stronger, not at the seam either.
    angles = np.arange(120) * 2 * math.pi / 120
    spots = [(25 * math.cos(a), 25 * math.sin(a)) for a in angles]
    ring = [("soil", "wall", plate([x, y, 2.0], [-x, -y], 1.4, 6.0)) for x, y in spots]
    ride = straight([0.0, 0.0], [0.0, 0.0], yaw=0.0)
    turning = replace(ride.trajectory, state=ride.trajectory.state + np.array([[0.0] * 4, [0, 0, 0, 50.0]]))
    turning = replace(turning, rate=ride.trajectory.rate + np.array([0, 0, 0, 0.5]))
    echoes = traced(
        world(*ring), Ride(turning), settings=TraceSettings(rays=256, max_bounces=1, floor_db=-40)
    )
    power = np.bincount(echoes.azimuth, echoes.mean_power, 400)
    inner = decibel(power[20:380] / power[20:380].mean())
    assert np.std(inner) < 0.3
    seam = decibel(power[[396, 397, 398, 399, 0, 1, 2, 3]] / power[20:380].mean())
    assert np.abs(seam).max() < 1.5  # few rays look across the seam
    assert abs(seam.mean()) < 0.6


def mirror_power(material: str, cosine: float) -> float:
    """Share of power that a surface mirrors, by its formulas: |Gamma|^2 (1 - S^2) exp(-g), for TE."""
    entry = MATERIALS[material]
    te, _ = reflection(permittivity(entry, CTS350X.carrier_hz), cosine)
    rough = math.exp(-((4 * math.pi * entry.rms_height_m * cosine / CTS350X.wavelength_m) ** 2))
    return float(abs(te) ** 2) * (1 - entry.scattering**2) * rough


def test_ghost_is_weaker_by_both_its_mirrorings() -> None:
    # Over a concrete wall, a plate has the power of its image times the squared mirror share of the wall.
    wall = plate([30.0, 0, 5.0], [-1, 0], 200.0, 10.0)
    behind = plate([12.0, 18.0, HEIGHT_M], [1, 0], 3.0, 3.0)  # faces the wall
    image = plate([48.0, 18.0, HEIGHT_M], [-1, 0], 3.0, 3.0)
    ghost = traced(world(("concrete", "wall", wall), ("soil", "car", behind)), standing())
    alone = traced(world(("soil", "car", image)), standing(), ghosts=False)
    of_ghost = ghost.mean_power[(ghost.bounces == 3) & (ghost.instance == 2)].sum(dtype=np.float64)
    cosine = 48.0 / math.hypot(48.0, 18.0)
    expected = alone.mean_power.sum(dtype=np.float64) * mirror_power("concrete", cosine) ** 2
    assert decibel(of_ghost / expected) == pytest.approx(0, abs=0.5)  # its solid angle costs it 0.2 dB


def test_loop_with_an_occluded_last_leg_returns_nothing() -> None:
    wall = plate([30.0, 0, 5.0], [-1, 0], 200.0, 10.0)
    side = plate([20.0, 6.0, HEIGHT_M], [0.2, -1], 1.5, 1.5)
    screen = plate([15.0, 4.2, HEIGHT_M], [-1, -0.3], 1.6, 3.0)
    objects = [("metal", "wall", wall), ("soil", "car", side)]
    seen, hidden = (
        traced(world(*objects), standing()),
        traced(world(*objects, ("soil", "fence", screen)), standing()),
    )
    loops = [echoes.mean_power[(echoes.bounces == 2) & (echoes.instance == 2)] for echoes in (seen, hidden)]
    assert loops[0].sum() > 0
    assert loops[1].sum() < 0.02 * loops[0].sum()


def test_ghost_by_way_of_a_moving_mirror_moves_with_it() -> None:
    # A metal box approaches at 3 m/s; the plate behind the radar is seen in it, coming twice as fast.
    box = box_prototype("box", (2.0, 12.0, 4.0), "metal", "bus")
    movers = (mover(2, box, straight([21.0, 0.0], [-3.0, 0.0], yaw=0.0)),)
    target = plate([-14.0, 6.0, HEIGHT_M], [1, 0], 2.0, 2.0)
    echoes = traced(world(("soil", "wall", target)), standing(), movers)
    ghosts = (echoes.bounces == 3) & (echoes.instance == 1)
    assert ghosts.any()
    assert echoes.moving[ghosts].all()
    cosine = 54.0 / math.hypot(54.0, 6.0)  # the mirror at x = 20 shows x = -14 at 54
    assert echoes.closing_mps[ghosts] == pytest.approx(2 * 3.0 * cosine, abs=0.2)


def test_tilting_the_beam_up_raises_high_targets() -> None:
    high = plate([40.0, 0, HEIGHT_M + 40 * math.tan(math.radians(6))], [-1, 0], 1.0, 1.0)
    low = plate([40.0, 0, HEIGHT_M - 40 * math.tan(math.radians(2))], [-1, 0], 1.0, 1.0)
    up = replace(STEADY, mount_tilt_deg=6.0)
    for target, change in ((high, 20.0), (low, -12.0)):
        town = world(("soil", "target", target))
        level, tilted = (
            traced(town, standing(), sensor=sensor).mean_power.sum(dtype=np.float64)
            for sensor in (STEADY, up)
        )
        # One-way, by the table: from 6 deg above the beam (-15 dB) to its middle; from 2 deg below to 8.
        assert np.sign(change) * decibel(tilted / level) > abs(change)


def test_speckled_power_has_its_mean_where_many_rays_share_a_patch() -> None:
    # At 8 m some 12 rays meet each patch; their sum must still have the power that the rays carry.
    wall = plate([8.0, 0, HEIGHT_M], [-1, 0], 60.0, 4.0)
    ratios = []
    for seed in range(6):
        simulator = Simulator(
            world(("soil", "wall", wall)),
            standing(),
            seed=seed,
            sensor=STEADY,
            settings=TraceSettings(rays=256),
        )
        echoes = simulator.echoes(0)
        for azimuth in range(-60, 61, 6):
            here = echoes.azimuth == azimuth % 400
            ranges = echoes.range_m[here]
            for start in np.arange(ranges.min(), ranges.max(), 0.25):
                cell = (ranges >= start) & (ranges < start + 0.25)
                if cell.sum() > 3:
                    total = abs(echoes.amplitude[here][cell].sum(dtype=np.complex128)) ** 2
                    ratios.append(total / echoes.mean_power[here][cell].sum(dtype=np.float64))
    # Exponential ratios: the mean has a standard error of 1 / sqrt(cells).
    assert np.mean(ratios) == pytest.approx(1.0, abs=4 / math.sqrt(len(ratios)) + 0.1)
