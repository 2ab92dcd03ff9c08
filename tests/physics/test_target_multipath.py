"""Coherent targets in mirrors, against image theory and the two-ray model computed from their formulas."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from echoscape.scenes.core.target_meshes import with_targets
from echoscape.scenes.core.targets import Target
from echoscape.sim.echoes import Echoes
from echoscape.sim.sensor.antenna import Antenna
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.sim.settings.surfaces import SurfaceSettings
from echoscape.sim.settings.tracing import TraceSettings
from echoscape.sim.simulator import Simulator
from tests.physics.laws import LawRecorder
from tests.physics.tracing import HEIGHT_M, POINTING, WAVELENGTH_M
from tests.sim.worlds import Ride, decibel, plate, quad, standing, straight, world

SECTION = "Multipath"
IMAGE_THEORY = "image theory: the radar equation at the image, and |Gamma|^4 of the wall"
TWO_RAYS = "two-ray model |1 + rho exp(j phi)|^4 (Skolnik, Radar Handbook, 2008, ch. 26)"
WALL_X_M = 30.0
WALL = ("metal", "wall", plate([WALL_X_M, 0, 5.0], [-1, 0], 120.0, 10.0))
GROUND = ("concrete", "road", quad([[-99, -99, 0], [99, -99, 0], [99, 99, 0], [-99, 99, 0]]))
CONCRETE = 5.24 - 0.323j
"""Permittivity of concrete at 76.5 GHz, ITU-R P.2040-3."""
SMOOTH = SurfaceSettings(rms_height=1e-6, scattering=1e-6)
BARE = TraceSettings(rays=16, floor_db=-60.0)
MIRROR_DB = 10 * math.log10((1 - 0.15**2) * math.exp(-((4 * math.pi * 5e-5 / WAVELENGTH_M) ** 2)))
"""Mirror part of the power that painted sheet reflects, S = 0.15 and s = 0.05 mm, about normal incidence."""


def echoes_of(
    *targets: Target,
    things: tuple[Any, ...] = (WALL,),
    ride: Ride | None = None,
    settings: TraceSettings = BARE,
    surfaces: SurfaceSettings | None = None,
    seed: int = 1,
) -> Echoes:
    """Echoes of the targets alone, whose instance ids follow those of the things."""
    town = with_targets(world(*things), targets)
    simulator = Simulator(
        town, ride or standing(), seed=seed, sensor=POINTING, settings=settings, surfaces=surfaces
    )
    echoes = simulator.echoes(0)
    return echoes.select(echoes.returns.coherent[echoes.source])


def at_azimuth(row: int, distance_m: float, height_m: float = HEIGHT_M) -> tuple[float, float, float]:
    """The point in the middle of the beam of a row, at a horizontal distance from the radar."""
    angle = float(POINTING.azimuth_rad[row])
    return distance_m * math.cos(angle), -distance_m * math.sin(angle), height_m


def row_power_w(echoes: Echoes, row: int) -> float:
    """Power of the echoes of a row, added in phase."""
    return float(abs(echoes.amplitude[echoes.azimuth == row].astype(np.complex128).sum()) ** 2)


def radar_equation_w(sigma_m2: float, out_m: float, back_m: float) -> float:
    """Pt G^2 lambda^2 sigma / ((4 pi)^3 R1^2 R2^2 L) in mid-beam, from the sensor's data sheet."""
    gain = 10 ** ((2 * CTS350X.antenna_gain_db - CTS350X.system_loss_db) / 10)
    spread = (4 * math.pi) ** 3 * out_m**2 * back_m**2
    return CTS350X.tx_power_w * gain * WAVELENGTH_M**2 * sigma_m2 / spread


GHOSTS = [
    ("trihedral", (0.30,), 4 * math.pi * 0.3**4 / (3 * WAVELENGTH_M**2)),
    ("point", (), 1.0),
    ("sphere", (0.10,), math.pi * 0.01),
]
GHOST_ROW = 380


def beside_the_wall(kind: str, size_m: tuple[float, ...]) -> tuple[Target, float]:
    """A target that faces the image of the radar and has its own in the middle of a row, and its range."""
    x_m, y_m, _ = at_azimuth(GHOST_ROW, 41.76)
    place = (2 * WALL_X_M - x_m, y_m, HEIGHT_M)
    towards = math.atan2(-y_m, 2 * WALL_X_M - place[0])
    return Target(kind=kind, position_m=place, heading_rad=towards, size_m=size_m), 41.76


@pytest.mark.parametrize(("kind", "size_m", "sigma_m2"), GHOSTS)
def test_ghost_in_a_metal_wall_has_the_power_of_the_image(
    kind: str, size_m: tuple[float, ...], sigma_m2: float, law: LawRecorder
) -> None:
    target, range_m = beside_the_wall(kind, size_m)
    ghost = echoes_of(target)
    ghost = ghost.select((ghost.bounces == 3) & (ghost.instance == 2))
    power = row_power_w(ghost, GHOST_ROW)
    assert power == max(row_power_w(ghost, row) for row in range(400))
    law(
        f"{kind.capitalize()} beside a metal wall: power of its ghost",
        source=IMAGE_THEORY,
        expected=float(decibel(radar_equation_w(sigma_m2, range_m, range_m))) + 30 + 2 * MIRROR_DB,
        simulated=float(decibel(power)) + 30,
        tolerance=0.4,
        unit="dBm",
        why="single bounces of the corner, some 30 dB weaker, add 0.3 dB in any phase",
    )
    law(
        f"{kind.capitalize()} beside a metal wall: range of its ghost",
        source="half the path by way of the wall, out and back",
        expected=range_m - (size_m[0] if kind == "sphere" else 0.0),
        simulated=float(np.average(ghost.range_m, weights=np.abs(ghost.amplitude) ** 2)),
        tolerance=0.002,
        unit="m",
        why="single bounces of the corner are nearer but 40 dB weaker",
    )


def test_out_by_way_of_the_wall_and_directly_back(law: LawRecorder) -> None:
    row = 2
    place = at_azimuth(row, 20.0)
    echoes = echoes_of(Target(kind="point", position_m=place))
    image_m = math.hypot(2 * WALL_X_M - place[0], place[1])
    loop = echoes.select(echoes.bounces == 2)
    # Both directions of the loop are in phase: twice the amplitude. The image lies aside of the beam.
    aside = math.atan2(-place[1], 2 * WALL_X_M - place[0]) - float(POINTING.azimuth_rad[row])
    antenna = Antenna(POINTING)
    lobe = math.sqrt(np.interp(aside, antenna.azimuth_grid_rad, antenna.azimuth_two_way))
    expected = 4 * radar_equation_w(1.0, 20.0, image_m) * lobe
    law(
        "Point before a metal wall: power out by way of the wall and directly back, both ways round",
        source="reciprocity: both directions in phase, four times the power of one",
        expected=float(decibel(expected)) + 30 + MIRROR_DB,
        simulated=float(decibel(row_power_w(loop, row))) + 30,
        tolerance=0.1,
        unit="dBm",
        why="metal loses 0.01 dB; mirror part at normal incidence",
    )
    assert loop.range_m == pytest.approx((20.0 + image_m) / 2, abs=1e-6)


def fresnel_tm(epsilon: complex, cosine: float) -> complex:
    """ITU-R P.2040-3, eq. (31b)."""
    root = np.sqrt(epsilon - (1 - cosine**2))
    return complex((epsilon * cosine - root) / (epsilon * cosine + root))


def two_rays_w(height_m: float, sigma_m2: float, *, rho: float = 1.0) -> float:
    """Power of a small target `DISTANCE_M` away over level concrete, its reflection times `rho`."""
    antenna = Antenna(POINTING)
    grid = antenna.elevation_grid_rad + math.radians(POINTING.mount_tilt_deg)
    rays = []
    for end_m in (height_m, -height_m):
        length_m = math.hypot(DISTANCE_M, end_m - HEIGHT_M)
        gain = np.interp(math.atan2(end_m - HEIGHT_M, DISTANCE_M), grid, antenna.elevation_one_way)
        rays.append(math.sqrt(gain) * np.exp(-2j * math.pi * length_m / WAVELENGTH_M) / length_m)
    cosine = (HEIGHT_M + height_m) / math.hypot(DISTANCE_M, HEIGHT_M + height_m)
    total = rays[0] + rho * fresnel_tm(CONCRETE, cosine) * rays[1]
    return radar_equation_w(sigma_m2, 1.0, 1.0) * abs(total) ** 4


def sweep_db(
    kind: str, size_m: tuple[float, ...], surfaces: SurfaceSettings, ground: str = "concrete"
) -> NDArray[np.float64]:
    """Received power (N,) [dB] of targets `DISTANCE_M` away at `HEIGHTS_M`, each in a row of its own."""
    rows = 3 + 9 * np.arange(len(HEIGHTS_M))
    places = [at_azimuth(int(row), DISTANCE_M, float(h)) for row, h in zip(rows, HEIGHTS_M, strict=True)]
    targets = [Target(kind=kind, position_m=place, size_m=size_m) for place in places]
    echoes = echoes_of(*targets, things=((ground, *GROUND[1:]),), surfaces=surfaces)
    powers = [
        row_power_w(echoes.select(echoes.instance == 2 + k), int(row)) for k, row in enumerate(rows.tolist())
    ]
    return decibel(np.array(powers))


HEIGHTS_M = np.linspace(0.6, 1.4, 43)
DISTANCE_M = 60.0


@pytest.mark.parametrize(
    ("kind", "size_m", "sigma_m2"), [("point", (), 1.0), ("sphere", (0.01,), math.pi * 1e-4)]
)
def test_target_over_smooth_ground_interferes_with_its_reflection(
    kind: str, size_m: tuple[float, ...], sigma_m2: float, law: LawRecorder
) -> None:
    simulated = sweep_db(kind, size_m, SMOOTH)
    expected = decibel(np.array([two_rays_w(float(height), sigma_m2) for height in HEIGHTS_M]))
    law(
        f"{kind.capitalize()} over smooth concrete at 60 m, 43 heights: correlation of its power with theory",
        source=TWO_RAYS,
        expected=1.0,
        simulated=float(np.corrcoef(simulated, expected)[0, 1]),
        tolerance=0.01,
        why="permittivity of three digits moves the minima; the sphere's specular points lie apart",
    )
    law(
        f"{kind.capitalize()} over smooth concrete at 60 m, 43 heights: standard deviation of its power",
        source=TWO_RAYS,
        expected=float(np.std(expected)),
        simulated=float(np.std(simulated)),
        tolerance=0.3,
        unit="dB",
        why="as above",
    )
    law(
        f"{kind.capitalize()} over smooth concrete at 60 m, 43 heights: mean power",
        source=TWO_RAYS,
        expected=float(np.mean(expected)) + 30,
        simulated=float(np.mean(simulated)) + 30,
        tolerance=0.2,
        unit="dBm",
        why="as above",
    )


def test_rough_ground_reflects_no_image(law: LawRecorder) -> None:
    ploughed = SurfaceSettings(rms_height=10.0)  # 30 mm: exp(-(4 pi s cos / lambda)^2) < 1e-28
    simulated = sweep_db("point", (), ploughed, ground="soil")
    expected = decibel(np.array([two_rays_w(float(height), 1.0, rho=0.0) for height in HEIGHTS_M]))
    law(
        "Point over soil of 30 mm rms height at 60 m, 43 heights: largest difference from its direct echo",
        source="coherent reflection of rough surfaces, Ament 1953",
        expected=0.0,
        simulated=float(np.max(np.abs(simulated - expected))),
        tolerance=0.05,
        unit="dB",
        why="the reflection is 100 dB weaker; the pattern is tabulated in steps",
    )


def test_ghost_approaches_as_fast_as_the_image(law: LawRecorder) -> None:
    target, range_m = beside_the_wall("point", ())
    # A turn takes 0.25 s, in which the radar passes where it stood in the other tests.
    row_s = 0.25 / 400
    start = [-GHOST_ROW * row_s * 10.0, 0.0]
    town = with_targets(world(WALL), [target])
    sensor = replace(POINTING, rotation_hz=4.0)
    echoes = Simulator(town, straight(start, [10.0, 0.0]), seed=1, sensor=sensor, settings=BARE).echoes(0)
    ghost = echoes.select((echoes.bounces == 3) & (echoes.azimuth == GHOST_ROW) & ~echoes.sidelobe)
    ghost = ghost.select(ghost.returns.coherent[ghost.source])
    expected = 10.0 * math.cos(float(sensor.azimuth_rad[GHOST_ROW]))
    law(
        "Ghost of a point in a wall, radar at 10 m/s: closing speed",
        source="the image of a target at rest is at rest: v cos of its azimuth",
        expected=expected,
        simulated=float(ghost.closing_mps[0]),
        tolerance=0.001,
        unit="m/s",
        why="single precision",
    )
    law(
        "Ghost of a point in a wall, radar at 10 m/s: shift of its range",
        source="-beta v, beta = 0.049 s (Burnett et al., RA-L 2021)",
        expected=-0.049 * expected,
        simulated=float(ghost.range_m[0]) - range_m,
        tolerance=0.001,
        unit="m",
        why="beta has two digits",
    )


def mirrors_of(echoes: Echoes) -> set[int]:
    """Instance ids of the mirrors in which targets are seen."""
    return set(echoes.returns.surfaces[echoes.source][echoes.bounces > 1, 0].tolist())


def test_bounce_limit_and_obstacles_remove_ghosts_of_targets() -> None:
    target, _ = beside_the_wall("point", ())
    assert mirrors_of(echoes_of(target)) == {1}
    assert set(echoes_of(target).bounces) == {1, 2, 3}
    assert set(echoes_of(target, settings=replace(BARE, max_bounces=1)).bounces) == {1}
    assert set(echoes_of(target, settings=replace(BARE, max_bounces=2)).bounces) == {1, 2}
    x_m, y_m, _ = target.position_m
    to_wall = ("soil", "wall", plate([x_m + 5.0, 0.875 * y_m, HEIGHT_M], [-1, 0], 1.0, 4.0))
    assert 1 not in mirrors_of(echoes_of(target, things=(WALL, to_wall)))
    on_the_way = ("soil", "wall", plate([WALL_X_M - 5.0, y_m * 0.625, HEIGHT_M], [-1, 0], 1.0, 4.0))
    assert 1 not in mirrors_of(echoes_of(target, things=(WALL, on_the_way)))
    behind = ("metal", "wall", plate([x_m + 5.0, 0.0, HEIGHT_M], [0, 1], 4.0, 4.0))
    assert 1 in mirrors_of(echoes_of(target, things=(WALL, behind)))


def test_echoes_without_mirrors_are_those_without_multipath() -> None:
    target, _ = beside_the_wall("trihedral", (0.3,))
    alone = echoes_of(target, things=())
    assert set(alone.bounces) == {1}
    direct = echoes_of(target)
    direct = direct.select(direct.bounces == 1)
    np.testing.assert_array_equal(direct.amplitude, alone.amplitude)
    np.testing.assert_array_equal(direct.range_m, alone.range_m)


def test_ghost_of_a_target_says_what_it_is() -> None:
    target, _ = beside_the_wall("trihedral", (0.3,))
    echoes = echoes_of(target)
    ghost = echoes.select(echoes.bounces == 3)
    assert set(ghost.instance) == {2}
    returns = ghost.returns
    number = int(ghost.source[0])
    assert returns.surfaces[number].tolist() == [1, 2]
    assert returns.displaced[number]
    assert not returns.moving[number]
    assert not ghost.sidelobe[ghost.azimuth == GHOST_ROW].any()
    over_ground = echoes_of(Target(kind="point", position_m=at_azimuth(5, 30.0)), things=(GROUND,))
    assert {1, 2, 3} == set(over_ground.bounces)
    assert not over_ground.displaced.any()


def test_ghosts_do_not_depend_on_the_rays() -> None:
    target, _ = beside_the_wall("sphere", (0.1,))
    some = echoes_of(target, things=(WALL, GROUND), seed=1)
    settings = replace(BARE, rays=64)
    other = echoes_of(target, things=(WALL, GROUND), seed=2, settings=settings)
    assert len(set(some.source)) > 3
    np.testing.assert_array_equal(some.amplitude, other.amplitude)
    np.testing.assert_array_equal(some.range_m, other.range_m)


SPHERE = Target(kind="sphere", position_m=at_azimuth(0, 30.0, 1.0), size_m=(0.5,))
UPRIGHT = Target(
    kind="plate", position_m=at_azimuth(0, 15.0, 0.6), heading_rad=math.pi - 0.01, size_m=(1.0, 1.0)
)
"""A mirror that makes a corner with the ground."""


@pytest.mark.parametrize("target", [SPHERE, UPRIGHT])
def test_rays_add_no_second_ghost_of_a_target(target: Target) -> None:
    town = with_targets(world(GROUND), [target])
    settings = TraceSettings(rays=1024, floor_db=-60.0)
    simulator = Simulator(town, standing(), seed=1, sensor=POINTING, settings=settings, surfaces=SMOOTH)
    echoes = simulator.echoes(0)
    traced = ~echoes.returns.coherent[echoes.source]
    assert not (echoes.instance[traced] == 2).any()
    ghosts = echoes.bounces > 1
    assert ghosts[~traced].any()
    by_rays = float(echoes.mean_power[ghosts & traced].sum(dtype=np.float64))
    assert by_rays < 1e-3 * float(echoes.mean_power[ghosts & ~traced].sum(dtype=np.float64))


def test_ghosts_of_targets_are_scaled_as_other_ghosts() -> None:
    target, _ = beside_the_wall("trihedral", (0.3,))
    town = with_targets(world(WALL), [target])
    powers = []
    for share in (1.0, 0.25):
        simulator = Simulator(
            town, standing(), seed=1, sensor=POINTING, settings=BARE, artefacts=Artefacts(ghosts=share)
        )
        echoes = simulator.echoes(0)
        powers.append(row_power_w(echoes.select(echoes.returns.coherent[echoes.source]), GHOST_ROW))
    assert powers[1] == pytest.approx(0.25 * powers[0], rel=1e-5)
