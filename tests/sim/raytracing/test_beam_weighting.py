"""Laws of sidelobes: a strong reflector appears as a ring over the whole revolution, across the seam too."""

import math
from dataclasses import replace

import numpy as np
import pytest

from echoscape.scenes.core.target_meshes import with_targets
from echoscape.scenes.core.targets import Target
from echoscape.sim.echoes import Echoes
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.sim.settings.tracing import TraceSettings
from echoscape.sim.simulator import Simulator
from tests.sim.worlds import Ride, decibel, plate, standing, straight, world

STEADY = replace(CTS350X, rotation_jitter_s=1e-9, encoder_first=0)
HEIGHT_M = CTS350X.mount_height_m
AZIMUTH_RAD = 2 * math.pi / CTS350X.azimuths
RING_DB = {10: -44.0, 50: -74.0, 100: -84.0}
"""The two-way azimuth pattern at 9, 45 and 90 deg."""


def traced(*plates: tuple[float, float, float], ride: Ride, rays: int = 256, floor_db: float = -60) -> Echoes:
    """Echoes of soil plates at (azimuth, distance [m], width [m])."""
    objects = []
    for azimuth, distance_m, width_m in plates:
        x, y = distance_m * math.cos(azimuth * AZIMUTH_RAD), -distance_m * math.sin(azimuth * AZIMUTH_RAD)
        objects.append(("soil", "target", plate([x, y, HEIGHT_M], [-x, -y], width_m, 3.0)))
    settings = TraceSettings(rays=rays, max_bounces=1, floor_db=floor_db)
    artefacts = Artefacts(doppler=0.0)
    made = Simulator(world(*objects), ride, seed=3, sensor=STEADY, settings=settings, artefacts=artefacts)
    return made.echoes(0)


def turning(rate: float) -> Ride:
    """A radar that rotates on the spot, counter-clockwise at `rate` [rad/s]."""
    still = straight([0.0, 0.0], [0.0, 0.0], yaw=0.0).trajectory
    state = still.state + np.array([[0.0] * 4, [0, 0, 0, 100 * rate]])
    return Ride(replace(still, state=state, rate=still.rate + np.array([0, 0, 0, rate])))


@pytest.mark.parametrize("azimuth", [0, 2, 200, 397])
def test_ring_follows_the_pattern_on_both_sides(azimuth: int) -> None:
    echoes = traced((azimuth, 30.0, 0.05), ride=standing())
    power = np.bincount(echoes.azimuth, echoes.mean_power, 400)
    for away, level_db in RING_DB.items():
        right, left = (decibel(power[(azimuth + side) % 400] / power[azimuth]) for side in (away, -away))
        assert right == pytest.approx(level_db, abs=0.5)
        assert left == pytest.approx(right, abs=0.3)


def test_ring_covers_the_whole_revolution_once() -> None:
    echoes = traced((3, 12.0, 0.1), ride=standing())
    count = np.bincount(echoes.azimuth, minlength=400)
    # The azimuth opposite to it, which lies as far on either side, is left out.
    assert np.flatnonzero(count == 0).tolist() == [203]
    far = echoes.source[echoes.sidelobe].astype(np.int64) * 400 + echoes.azimuth[echoes.sidelobe]
    assert len(np.unique(far)) == len(far)


def test_range_of_a_ring_is_that_from_each_azimuth_across_the_seam_too() -> None:
    # At 15 m/s towards a plate a little to the right: the last azimuths are 3.7 m nearer than the first.
    echoes = traced((5, 40.0, 0.05), ride=straight([0, 0], [15.0, 0]))
    x, y = 40.0 * math.cos(5 * AZIMUTH_RAD), -40.0 * math.sin(5 * AZIMUTH_RAD)
    for azimuth in (360, 385, 395, 15, 40):
        found = echoes.range_m[echoes.azimuth == azimuth]
        assert found.size
        expected = math.hypot(x - 15.0 * STEADY.azimuth_period_s * azimuth, y)
        np.testing.assert_allclose(found, expected, atol=0.06)  # 1.5 m up and down: 0.04 m


@pytest.mark.parametrize(("rate", "within_db"), [(0.0, 0.5), (0.2, 1.5), (-0.2, 1.5)])
def test_sidelobes_are_as_strong_at_the_seam_as_elsewhere(rate: float, within_db: float) -> None:
    # A rough ring of plates about the radar. When it yaws, the scan covers some directions never or twice.
    ring = [(400 / 120 * k, 25.0, 1.4) for k in range(120)]
    echoes = traced(*ring, ride=turning(rate), floor_db=-10.0)
    far = echoes.sidelobe
    power = np.bincount(echoes.azimuth[far], echoes.mean_power[far], 400)
    seam = np.concatenate([power[:8], power[-8:]])
    assert abs(decibel(seam.mean() / power[20:380].mean())) < within_db


def test_ring_of_a_corner_is_as_strong_across_the_seam_though_the_car_drives() -> None:
    # All paths over both walls have the same length from any position: they stay in phase.
    bearing, size_m = 10 * AZIMUTH_RAD, 0.6
    walls = []
    for side in (1, -1):
        facing = math.pi - bearing + side * math.pi / 4  # towards the radar, a right angle between both
        along = facing - side * math.pi / 2  # from the corner outwards
        x = 30 * math.cos(bearing) + size_m / 2 * math.cos(along)
        y = -30 * math.sin(bearing) + size_m / 2 * math.sin(along)
        wall = plate([x, y, HEIGHT_M], [math.cos(facing), math.sin(facing)], size_m, 3.0)
        walls.append(("metal", "target", wall))
    settings = TraceSettings(rays=1024, max_bounces=2, floor_db=-60.0)
    drive = straight([0, 0], [8.0, 0])
    echoes = Simulator(world(*walls), drive, seed=3, sensor=STEADY, settings=settings).echoes(0)
    twice = echoes.returns.bounces[echoes.source] == 2
    power = np.zeros(400)
    for azimuth in range(400):
        there = twice & (echoes.azimuth == azimuth)
        power[azimuth] = np.abs(echoes.amplitude[there].sum(dtype=complex)) ** 2
    offset_deg, level_db = np.array(STEADY.azimuth_pattern_db).T
    azimuths = np.array([397, 398, 399, 0, 1, 2])
    pattern_db = np.interp(np.abs((azimuths - 10 + 200) % 400 - 200) * 0.9, offset_deg, level_db)
    np.testing.assert_allclose(decibel(power[azimuths] / power[10]), pattern_db, atol=2.5)


def test_target_skipped_by_the_main_lobe_in_a_left_turn_is_received_by_sidelobes() -> None:
    # 0.6 rad/s to the left for one scan: 9.5 azimuths about straight ahead are in no main lobe.
    rate = 0.6
    bearing = rate * STEADY.azimuth_period_s * 200  # half way from where the scan ends to where it began
    place = (30 * math.cos(bearing), 30 * math.sin(bearing), HEIGHT_M)
    sphere = Target(kind="point", position_m=place, rcs_m2=1e3)
    echoes = Simulator(with_targets(world(), [sphere]), turning(rate), seed=3, sensor=STEADY).echoes(0)
    power = np.bincount(echoes.azimuth, echoes.mean_power, 400)
    assert (power[[0, 1, 2, 397, 398, 399]] > 0).all()
