import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from echoscape.scenes.core.materials import MATERIALS
from echoscape.scenes.core.scene import Mover, Scene
from echoscape.sim.echoes import Echoes
from echoscape.sim.raytracing.mitsuba_backend import dr, set_threads
from echoscape.sim.raytracing.surface.fresnel import permittivity, reflection
from echoscape.sim.sensor.antenna import Antenna
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.sensor.link_budget import link_w_m2
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.sim.settings.tracing import TraceSettings
from echoscape.sim.simulator import Simulator
from tests.sim.worlds import Ride, box_prototype, decibel, mover, plate, quad, standing, straight, world

FINE = TraceSettings(rays=1024, floor_db=-60.0)
HEIGHT_M = CTS350X.mount_height_m
STEADY = replace(CTS350X, rotation_jitter_s=1e-9, encoder_first=0)
AZIMUTH_RAD = 2 * math.pi / CTS350X.azimuths


def traced(
    town: Scene,
    ride: Ride,
    movers: tuple[Mover, ...] = (),
    *,
    settings: TraceSettings = FINE,
    sensor=STEADY,
    seed: int = 3,
    **artefacts: bool,
) -> Echoes:
    simulator = Simulator(
        town, ride, movers, seed=seed, sensor=sensor, settings=settings, artefacts=Artefacts(**artefacts)
    )
    return simulator.echoes(0)


def azimuth_power(echoes: Echoes, azimuth: int, near_m: float, far_m: float) -> float:
    """Mean power over speckle of the echoes of an azimuth between two ranges [W]."""
    inside = (echoes.azimuth == azimuth) & (echoes.range_m > near_m) & (echoes.range_m < far_m)
    return float(echoes.mean_power[inside].sum(dtype=np.float64))


def quadrature(distance_m: float, material: str, *, width_m: float, height_m: float) -> float:
    """Power from an upright plate straight ahead: the radar equation integrated over it on a fine grid [W].

    Written apart from the simulator: BRDF, Fresnel and roughness from their formulas.
    """
    entry = MATERIALS[material]
    y, z = np.meshgrid(*(np.linspace(-s / 2, s / 2, 801) for s in (width_m, height_m)), indexing="ij")
    r = np.sqrt(distance_m**2 + y**2 + z**2)
    cosine = distance_m / r
    te, tm = (np.abs(c) ** 2 for c in reflection(permittivity(entry, CTS350X.carrier_hz), cosine))
    te_share = y**2 / np.maximum(
        y**2 + z**2, 1e-12
    )  # vertical polarisation: TE where the ray leaves sideways
    power = te_share * te + (1 - te_share) * tm
    rough = np.exp(-((4 * math.pi * entry.rms_height_m * cosine / CTS350X.wavelength_m) ** 2))
    mirror = (1 - entry.scattering**2) * rough
    tangent2 = 1 / cosine**2 - 1
    slopes = np.exp(-tangent2 / (2 * entry.rms_slope_rad**2)) / (
        2 * math.pi * entry.rms_slope_rad**2 * cosine**4
    )
    brdf = mirror * slopes / (4 * cosine**2) + (1 - mirror) / math.pi
    antenna = Antenna(CTS350X)
    gain = antenna.two_way_gain(np.arctan2(y, distance_m), np.arcsin(z / r)) / antenna.peak_gain**2
    solid = cosine / r**2 * (width_m / 800) * (height_m / 800)
    return float(link_w_m2(CTS350X) * np.sum(gain * power * brdf * cosine / r**2 * solid))


@pytest.mark.parametrize("material", ["soil", "metal"])
@pytest.mark.parametrize("distance_m", [12.0, 50.0])
def test_wall_returns_the_integral_of_the_radar_equation(material: str, distance_m: float) -> None:
    wall = plate([distance_m, 0, HEIGHT_M], [-1, 0], distance_m, 0.3 * distance_m)
    echoes = traced(world((material, "wall", wall)), standing())
    expected = quadrature(distance_m, material, width_m=distance_m, height_m=0.3 * distance_m)
    # Some 8,000 rays share the power, the patches' rays are not quite Poisson: 0.5 dB.
    found = azimuth_power(echoes, 0, 0, 160)
    assert decibel(found / expected) == pytest.approx(0, abs=0.5)


def cell_sum(echoes: Echoes, azimuth: int, range_m: float, width_m: float = 0.25) -> complex:
    inside = (echoes.azimuth == azimuth) & (np.abs(echoes.range_m - range_m) < width_m)
    return complex(echoes.amplitude[inside].sum(dtype=np.complex128))


def test_speckle_turns_with_4_pi_r_over_lambda() -> None:
    # A small rough plate straight ahead; the radar steps towards it by fractions of a millimetre;
    # 30 m is well within a step of the patches' edges.
    town = world(("soil", "target", plate([30.0, 0, HEIGHT_M], [-1, 0], 0.3, 0.3)))
    start = cell_sum(traced(town, standing()), 0, 30.0, 1.0)
    for step in (0.2e-3, 0.5e-3, 1.0e-3):
        moved = cell_sum(traced(town, standing(x=step)), 0, 30.0, 1.0)
        turned = np.angle(moved / start)
        expected = np.angle(np.exp(4j * math.pi * step / CTS350X.wavelength_m))
        assert abs(np.angle(np.exp(1j * (turned - expected)))) < 0.1
        assert abs(moved) == pytest.approx(abs(start), rel=0.05)


def test_speckle_decorrelates_over_the_beams_aperture_length() -> None:
    # A radar that passes a rough wall sideways sees new speckle after some lambda / (2 x beam width) = 0.1 m.
    wall = plate([40.0, 0, HEIGHT_M], [-1, 0], 120.0, 6.0)
    town = world(("soil", "wall", wall))
    azimuths = list(range(-40, 41, 4))

    def profile(y: float) -> NDArray[np.complex128]:
        echoes = traced(town, standing(y=y), settings=TraceSettings(rays=1024, floor_db=-40))
        ranges = [40.0 / math.cos(k * AZIMUTH_RAD) for k in azimuths]
        return np.array([cell_sum(echoes, k % 400, r) for k, r in zip(azimuths, ranges, strict=True)])

    def coherence(a: NDArray, b: NDArray) -> float:
        return float(abs(np.vdot(a, b)) / (np.linalg.norm(a) * np.linalg.norm(b)))

    def flat(values: NDArray, y: float) -> NDArray:
        # Take out the common phase of a sideways step: 4 pi y sin(azimuth) / lambda, clockwise azimuths.
        return values * np.exp(
            4j * math.pi * y * np.sin(-np.array(azimuths) * AZIMUTH_RAD) / CTS350X.wavelength_m * -1
        )

    start = profile(0.0)
    near, far = profile(0.005), profile(0.3)
    assert coherence(start, flat(near, 0.005)) > 0.8
    assert coherence(start, flat(far, 0.3)) < 0.5


def test_rows_see_the_world_from_their_own_place() -> None:
    # At 15 m/s past four plates: each is as far as it is from where the car is when the beam passes it.
    places = [(30.0, -20.0), (-25.0, -30.0), (-30.0, 25.0), (35.0, 20.0)]
    plates = [("soil", "target", plate([x, y, HEIGHT_M], [-x, -y], 0.5, 0.5)) for x, y in places]
    echoes = traced(world(*plates), straight([0, 0], [15.0, 0]), doppler=False)
    for instance, (x, y) in enumerate(places, start=1):
        mine = (echoes.instance == instance) & ~echoes.sidelobe & (echoes.bounces == 1)
        for azimuth in np.unique(echoes.azimuth[mine]):
            here = mine & (echoes.azimuth == azimuth)
            car_x = 15.0 * STEADY.azimuth_period_s * azimuth
            found = np.average(echoes.range_m[here], weights=echoes.mean_power[here])
            assert found == pytest.approx(math.hypot(x - car_x, y), abs=0.1)  # the plate is 0.5 m wide


def test_motion_distortion_can_be_switched_off() -> None:
    wall = world(("soil", "wall", plate([20.0, 0, HEIGHT_M], [-1, 0], 60.0, 4.0)))
    rolling = traced(wall, straight([0, 0], [15.0, 0]), doppler=False)
    still = traced(wall, straight([0, 0], [15.0, 0]), doppler=False, motion_distortion=False)
    # Azimuth 395 is 244 ms after azimuth 5, so the wall ahead is 3.7 m nearer; at mid-scan both are at rest.
    for echoes, nearer in ((rolling, 15 * 390 * STEADY.azimuth_period_s), (still, 0.0)):
        first, last = (
            np.average(echoes.range_m[echoes.azimuth == k], weights=echoes.mean_power[echoes.azimuth == k])
            for k in (5, 395)
        )
        assert first - last == pytest.approx(nearer, abs=0.15)


def test_movers_move_within_the_scan() -> None:
    # A box drives sideways behind the radar; azimuth 200 sees it 125 ms after azimuth 0.
    box = box_prototype("box", (2.0, 2.0, 3.0), "soil")
    ride = straight([-30.0, -6.0], [0.0, 20.0])
    echoes = traced(
        world(("soil", "ground", quad([[900, 900, 0], [901, 900, 0], [901, 901, 0], [900, 901, 0]]))),
        standing(),
        (mover(5, box, ride),),
    )
    mine = (echoes.instance == 5) & (echoes.bounces == 1) & ~echoes.sidelobe
    assert mine.any()
    assert echoes.moving[mine].all()
    power = np.bincount(echoes.azimuth[mine], echoes.mean_power[mine], 400)
    for azimuth in np.flatnonzero(power > 0.1 * power.max()):
        y = -6.0 + 20.0 * STEADY.azimuth_period_s * azimuth
        here = mine & (echoes.azimuth == azimuth)
        near = math.hypot(-29.0, y)
        assert np.average(echoes.range_m[here], weights=echoes.mean_power[here]) == pytest.approx(
            near, abs=0.8
        )
    middle = np.average(echoes.azimuth[mine], weights=echoes.mean_power[mine])
    y = -6.0 + 20.0 * STEADY.azimuth_period_s * middle
    assert (math.pi - middle * AZIMUTH_RAD) == pytest.approx(math.atan2(y, 29.0) * -1, abs=AZIMUTH_RAD)


def test_mover_returns_are_at_its_prototypes_faces_for_any_pose() -> None:
    box = box_prototype("box", (4.0, 2.0, 2.5), "soil")
    yaw = 0.7
    ride = straight([25.0, 3.0], [0.0, 0.0], yaw=yaw)
    echoes = traced(world(), standing(), (mover(1, box, ride),))
    mine = (echoes.instance == 1) & ~echoes.sidelobe & (echoes.bounces == 1)
    corners = np.array([[a * 2.0, b * 1.0] for a in (-1, 1) for b in (-1, 1)])
    rotation = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    around = corners @ rotation.T + [25.0, 3.0]
    nearest = np.hypot(*around.T).min()
    assert echoes.range_m[mine].min() == pytest.approx(nearest, abs=0.2)
    assert echoes.range_m[mine].max() < np.hypot(*around.T).max() + 0.3


def test_standing_mover_keeps_its_speckle_and_things_behind_it_are_hidden() -> None:
    box = box_prototype("box", (2.0, 6.0, 4.0), "soil")
    wall = plate([30.0, 0, HEIGHT_M], [-1, 0], 4.0, 1.0)
    parked = mover(2, box, straight([15.0, 0.0], [0.0, 0.0], yaw=0.0))
    simulator = Simulator(world(("soil", "wall", wall)), standing(), (parked,), seed=1, sensor=STEADY)
    first, second = simulator.echoes(0), simulator.echoes(3)
    assert np.array_equal(first.amplitude, second.amplitude)
    direct = (first.bounces == 1) & ~first.sidelobe
    assert not ((first.instance == 1) & direct & (first.azimuth == 0)).any()
    assert first.first_obstacle_m[0] == pytest.approx(14.0, abs=0.05)


def test_echoes_do_not_depend_on_threads() -> None:
    wall = plate([30.0, 0, 5.0], [-1, 0.2], 120.0, 10.0)
    ground = quad([[-80, -80, 0], [80, -80, 0], [80, 80, 0], [-80, 80, 0]])
    # Posts at rest and one that moves: rays are aimed at both.
    posts = [
        ("metal", "fence", plate([-20.0, y, 1.5], [1, -y / 20], 0.05, 2.0)) for y in np.arange(-9.0, 9.0)
    ]
    town = world(("metal", "wall", wall), ("asphalt", "road", ground), *posts)
    rod = box_prototype("rod", (0.04, 0.04, 2.5), "metal", "pedestrian")
    movers = (mover(len(posts) + 3, rod, straight([9.0, 6.0], [-1.0, -0.5])),)
    ride, before = straight([0, 0], [8.0, 1.0]), dr.thread_count()
    try:
        set_threads(1)
        one = traced(town, ride, movers, settings=TraceSettings(rays=64))
        set_threads(2)
        two = traced(town, ride, movers, settings=TraceSettings(rays=64))
    finally:
        set_threads(before)
    for name in ("azimuth", "range_m", "amplitude", "mean_power", "source"):
        assert np.array_equal(getattr(one, name), getattr(two, name)), name
    aimed = (one.bounces == 1) & (one.instance > 2)
    assert len(np.unique(one.instance[aimed])) > 10
    assert (one.bounces > 1).any()


@pytest.mark.parametrize("limit", [1, 2, 3])
def test_bounce_limit_leaves_out_the_orders_above_it_and_no_others(limit: int) -> None:
    # Three mirrors round the radar and a rough plate that faces away from it: paths of every order up to 4.
    mirrors = [plate([x, y, 5.0], [-x, -y], 60.0, 10.0) for x, y in ((20.0, 0.0), (-15.0, 0.0), (0.0, 12.0))]
    town = world(
        *(("metal", "wall", mirror) for mirror in mirrors),
        ("soil", "car", plate([9.0, 5.0, HEIGHT_M], [1, 0.3], 2.0, 2.0)),
    )
    every, fewer = (
        traced(town, standing(), settings=TraceSettings(rays=64, max_bounces=most)) for most in (4, limit)
    )
    assert set(np.unique(every.bounces)) == {1, 2, 3, 4}
    assert fewer.bounces.max() == limit
    expected = every.select(every.bounces <= limit)
    for name in ("azimuth", "range_m", "amplitude", "mean_power", "bounces", "instance"):
        found, wanted = (np.sort(getattr(echoes, name)) for echoes in (fewer, expected))
        assert np.array_equal(found, wanted), name


def test_empty_world_is_silent() -> None:
    echoes = traced(world(), standing())
    assert len(echoes) == 0
    assert np.isinf(echoes.first_obstacle_m).all()


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("max_bounces", 0),
        ("floor_db", math.nan),
        ("floor_db", -60.1),
        ("floor_db", 60.1),
        ("rays", 8192),
        ("rays", 8),
        ("rays", 225),
        ("rays", 0),
        ("rays", -16),
        ("draw", -1),
    ],
)
def test_settings_refuse_nonsense(field: str, value: Any) -> None:
    with pytest.raises(ValueError, match=field):
        TraceSettings(**{field: value})
