from dataclasses import replace

import numpy as np
import pytest

from echoscape.scenes.core.scene import CLASSES, Scene
from echoscape.sim.datasets.polar_scan import CellTruth, Component, PolarScan
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.sim.settings.tracing import TraceSettings
from echoscape.sim.simulator import Simulator
from tests.sim.worlds import Ride, box_prototype, mover, plate, quad, standing, straight, world

STEADY = replace(CTS350X, rotation_jitter_s=1e-9)
ONLY_ECHOES = Artefacts(
    thermal_noise=False,
    leakage=False,
    phase_noise=False,
    saturation=False,
    quantisation=False,
    sidelobes=False,
)


def scanned(
    town: Scene, artefacts: Artefacts, movers=(), ride: Ride | None = None, seed: int = 1
) -> PolarScan:
    simulator = Simulator(
        town,
        ride or standing(),
        movers,
        seed=seed,
        sensor=STEADY,
        settings=TraceSettings(rays=256),
        artefacts=artefacts,
    )
    return simulator.scan(0)


def cells(scan: PolarScan) -> CellTruth:
    assert scan.truth is not None
    return scan.truth.cells


@pytest.fixture(scope="module")
def yard() -> Scene:
    return world(
        ("metal", "wall", plate([30.0, 0, 5.0], [-1, 0], 120.0, 10.0)),
        ("soil", "car", plate([20.0, 12.0, 2.0], [1, 0], 2.0, 1.5)),
        ("asphalt", "road", quad([[-80, -80, 0], [80, -80, 0], [80, 80, 0], [-80, 80, 0]])),
    )


def test_nothing_but_noise_is_noise() -> None:
    scan = scanned(world(), replace(Artefacts(), leakage=False))
    assert (cells(scan).component == Component.NOISE).all()
    assert not cells(scan).instance.any()
    assert (scan.codes > 0).any()


def test_leakage_is_near_and_called_so() -> None:
    component = cells(scanned(world(), Artefacts())).component
    assert (component[:, :30] == Component.LEAKAGE).mean() > 0.95
    assert not (component[:, 200:] == Component.LEAKAGE).any()


def test_direct_echoes_are_where_things_are(yard: Scene) -> None:
    truth = cells(scanned(yard, replace(ONLY_ECHOES, ghosts=False)))
    wall = truth.instance == 1
    azimuths, bins = np.nonzero(wall)
    azimuth = (13 + 14 * azimuths) * 2 * np.pi / 5600
    ahead = (bins + 0.5) * 0.0432 * np.cos(azimuth)
    assert wall.any()
    # A cell belongs to the wall if the wall lies within the beam and the point spread of it.
    assert np.percentile(np.abs(ahead - 30.0), 95) < 2.0
    assert (truth.class_id[wall] == CLASSES.index("wall")).all()
    assert (truth.bounces[wall] == 1).all()
    assert not truth.moving.any()


def test_ghost_mask_marks_what_vanishes_without_ghosts(yard: Scene) -> None:
    every, direct = scanned(yard, ONLY_ECHOES), scanned(yard, replace(ONLY_ECHOES, ghosts=False))
    ghosts = cells(every).component == Component.GHOST
    alone = cells(every).component == Component.DIRECT
    assert ghosts.sum() > 100
    # Ghost cells lose over half their power, direct ones keep theirs (medians: speckle adds in any phase).
    strong = every.codes > 20
    assert np.median(direct.codes[ghosts & strong] / 2.0 - every.codes[ghosts & strong] / 2.0) < -3.0
    assert np.median(np.abs(direct.codes[alone & strong] / 2.0 - every.codes[alone & strong] / 2.0)) <= 1.5
    assert (cells(every).component != Component.GHOST)[direct.codes >= every.codes].mean() > 0.95
    assert not (cells(direct).component == Component.GHOST).any()
    assert (cells(every).bounces[ghosts] > 1).all()


def test_spokes_and_saturation_go_together(yard: Scene) -> None:
    clipping = replace(STEADY, full_scale_db=50.0)
    quiet = Simulator(yard, standing(), seed=1, sensor=STEADY, settings=TraceSettings(rays=64)).scan(0)
    clipped = Simulator(yard, standing(), seed=1, sensor=clipping, settings=TraceSettings(rays=64)).scan(0)
    assert clipped.truth is not None
    assert quiet.truth is not None
    azimuths = clipped.truth.saturated
    assert azimuths.sum() > quiet.truth.saturated.sum()
    share = (clipped.truth.cells.component == Component.SPOKE).mean(axis=1)
    assert azimuths.any()
    assert not azimuths.all()
    assert share[azimuths].mean() > 3 * share[~azimuths].mean()


def test_movers_are_marked_and_boxed() -> None:
    box = box_prototype("box", (4.0, 2.0, 2.0), "soil")
    ride = straight([25.0, -3.0], [0.0, 8.0])
    town = world(("asphalt", "road", quad([[-80, -80, 0], [80, -80, 0], [80, 80, 0], [-80, 80, 0]])))
    scan = scanned(town, ONLY_ECHOES, (mover(2, box, ride),))
    truth = cells(scan)
    direct = truth.bounces == 1
    assert (truth.moving[direct] == (truth.instance[direct] == 2)).all()
    assert truth.moving[truth.instance == 2].all()  # what its sides mirror moves as well
    assert truth.moving.any()
    assert (truth.class_id[truth.moving & direct] == CLASSES.index("car")).all()
    assert scan.truth is not None
    boxes = scan.truth.boxes
    np.testing.assert_allclose(boxes.centre, [[25.0, -3.0 + 8.0 * 0.125, 1.0]], atol=0.01)
    np.testing.assert_allclose(boxes.velocity, [[0.0, 8.0, 0.0]], atol=1e-9)
    np.testing.assert_allclose(boxes.extent, [[4.0, 2.0, 2.0]])


def test_first_thing_in_the_beam_is_no_ground(yard: Scene) -> None:
    scan = scanned(yard, ONLY_ECHOES)
    assert scan.truth is not None
    assert scan.truth.first_obstacle_m[0] == pytest.approx(30.0, abs=0.1)
    assert np.isinf(scan.truth.first_obstacle_m[200])


def test_scans_come_out_the_same_in_any_order(yard: Scene) -> None:
    ride = straight([0, 0], [5.0, 0])
    forth = Simulator(yard, ride, seed=9, settings=TraceSettings(rays=64))
    back = Simulator(yard, ride, seed=9, settings=TraceSettings(rays=64))
    first = [forth.scan(k) for k in (0, 1, 2)]
    second = [back.scan(k) for k in (2, 1, 0)][::-1]
    for one, two in zip(first, second, strict=True):
        assert np.array_equal(one.codes, two.codes)
        assert np.array_equal(one.timestamp_us, two.timestamp_us)
        assert np.array_equal(cells(one).component, cells(two).component)
        assert np.array_equal(cells(one).instance, cells(two).instance)


@pytest.mark.parametrize(
    "name", ["speckle", "ghosts", "sidelobes", "saturation", "phase_noise", "thermal_noise"]
)
def test_each_artefact_changes_something(yard: Scene, name: str) -> None:
    clipping = replace(STEADY, full_scale_db=35.0, phase_noise_dbc_hz=-70.0)
    full, without = (
        Simulator(
            yard, standing(), seed=1, sensor=clipping, settings=TraceSettings(rays=64), artefacts=a
        ).scan(0)
        for a in (Artefacts(), replace(Artefacts(), **{name: False}))
    )
    assert not np.array_equal(full.codes, without.codes)


def beyond_box(scan: PolarScan, centre: np.ndarray, yaw: float, extent: np.ndarray) -> np.ndarray:
    """How far the strong direct cells of mover 2 lie outside a box [m]; radar at the origin, heading 0."""
    truth = cells(scan)
    shown = (truth.instance == 2) & (truth.bounces == 1) & (truth.component == Component.DIRECT)
    azimuth, bins = np.nonzero(shown & (scan.codes > scan.codes[shown].max() - 24.0))  # 12 dB below the peak
    angle, range_m = -scan.encoder[azimuth].astype(float) * (2 * np.pi / 5600), (bins + 0.5) * scan.bin_m
    away = np.stack([range_m * np.cos(angle), range_m * np.sin(angle)]) - centre[:2, None]
    turned = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]]) @ away
    outside = np.maximum(np.abs(turned) - extent[:2, None] / 2, 0)
    assert len(bins) > 30
    return np.hypot(*outside)


@pytest.mark.parametrize("start", [(24.0, -8.0), (24.0, 8.0)])
@pytest.mark.parametrize("velocity", [(15.0, 0.0), (-15.0, 0.0), (0.0, 15.0), (0.0, -15.0)])
def test_echoes_of_a_mover_lie_in_its_box_at_the_time_of_their_row(
    start: tuple[float, float], velocity: tuple[float, float]
) -> None:
    # Met at the start of the scan or at its end, 1.6 m and more from where it is in the middle.
    box = box_prototype("box", (0.8, 0.8, 2.0), "soil")
    scan = scanned(
        world(), replace(ONLY_ECHOES, doppler=False), (mover(2, box, straight(list(start), list(velocity))),)
    )
    assert scan.truth is not None
    boxes = scan.truth.boxes
    assert boxes.row is not None
    assert boxes.row_centre is not None
    assert boxes.row_yaw is not None
    # The place at the time of the row, by hand: nearest in direction among all places along its track.
    times = STEADY.azimuth_period_s * np.arange(400)
    track = np.array(start) + times[:, None] * np.array(velocity)
    looks = -2 * np.pi * (13 + 14 * np.arange(400)) / 5600
    aside = np.abs(np.angle(np.exp(1j * (np.arctan2(track[:, 1], track[:, 0]) - looks))))
    assert boxes.row[0] == np.argmin(aside)
    np.testing.assert_allclose(boxes.row_centre[0], [*track[boxes.row[0]], 1.0], atol=1e-6)
    # 12 dB below the peak lie a beam width of 1.1 deg and a resolution cell beside a point.
    in_row = beyond_box(scan, boxes.row_centre[0], boxes.row_yaw[0], boxes.extent[0])
    in_middle = beyond_box(scan, boxes.centre[0], boxes.yaw[0], boxes.extent[0])
    assert in_row.max() < np.radians(1.1) * 25 + STEADY.resolution_m
    assert np.median(in_middle) > 0.9


def test_row_of_a_box_follows_the_turning_car() -> None:
    # A car that turns left by 0.5 rad/s sweeps the right side faster: pi/2 + 0.5 t = 2 pi t / T there.
    ride = straight([0.0, 0.0], [0.0, 0.0], yaw=0.0)
    trajectory = replace(
        ride.trajectory,
        state=ride.trajectory.state + np.array([[0.0] * 4, [0, 0, 0, 50.0]]),
        rate=ride.trajectory.rate + np.array([0, 0, 0, 0.5]),
    )
    box = box_prototype("box", (4.0, 2.0, 2.0), "soil")
    parked = mover(2, box, straight([0.0, -25.0], [0.0, 0.0], yaw=0.0))
    scan = scanned(world(), ONLY_ECHOES, (parked,), Ride(trajectory))
    assert scan.truth is not None
    assert scan.truth.boxes.row is not None
    time = (np.pi / 2 - 2 * np.pi * 13 / 5600) / (2 * np.pi / 0.25 - 0.5)
    assert scan.truth.boxes.row[0] == pytest.approx(time / STEADY.azimuth_period_s, abs=0.51)


def test_flag_displaced_tells_ghosts_in_empty_space_from_double_bounces_in_place(yard: Scene) -> None:
    truth = cells(scanned(yard, ONLY_ECHOES))
    assert truth.displaced is not None
    ghost = truth.component == Component.GHOST
    assert not truth.displaced[truth.bounces <= 1].any()
    azimuths, bins = np.nonzero(ghost & (truth.bounces > 1))
    range_m, shift = (bins + 0.5) * 0.0432, truth.displaced[azimuths, bins]
    # Along the wall at x = 30 double bounces lie in place; 2 m and more behind it nothing does.
    ahead = range_m * np.cos(2 * np.pi * (13 + 14 * azimuths) / 5600)
    in_reach = np.abs(np.cos(2 * np.pi * (13 + 14 * azimuths) / 5600)) > 0.5
    assert (in_reach & (ahead > 33)).sum() > 50
    assert shift[in_reach & (ahead > 33)].mean() > 0.9
    at_wall = in_reach & (np.abs(ahead - 30) < 0.4)
    assert at_wall.sum() > 20
    assert shift[at_wall].mean() < 0.1
