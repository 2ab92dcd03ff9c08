"""The beam of an antenna on a body that pitches and rolls, against the elevation pattern of the sensor."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from echoscape.scenes.core.attitude import Attitude
from echoscape.scenes.core.scene import Mesh, Scene
from echoscape.scenes.core.target_meshes import with_targets
from echoscape.scenes.core.targets import Target
from echoscape.sim.echoes import Echoes
from echoscape.sim.kinematics.rolling_scan import TILT_CENTRE_M
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.sim.settings.tracing import TraceSettings
from echoscape.sim.simulator import Simulator
from tests.physics.laws import LawRecorder
from tests.physics.tracing import HEIGHT_M, POINTING, facing, power_of
from tests.sim.worlds import Ride, decibel, standing, straight, world

SECTION = "Antenna"
ARM_M = HEIGHT_M - TILT_CENTRE_M
RANGE_M = 60.0


def tilted(pitch_deg: float = 0.0, roll_deg: float = 0.0, ride: Ride | None = None) -> Ride:
    """A ride, or a car that stands, with constant pitch and roll."""
    track = (ride or standing()).trajectory
    angle = np.radians([[pitch_deg, roll_deg]] * 2)
    attitude = Attitude(time_s=track.time_s[[0, -1]], angle_rad=angle, rate_rps=np.zeros((2, 2)))
    return Ride(replace(track, attitude=attitude))


def echoes_of(
    town: Scene, ride: Ride, *, attitude: float = 1.0, max_bounces: int = 1, rays: int = 256
) -> Echoes:
    return Simulator(
        town,
        ride,
        seed=4,
        sensor=POINTING,
        settings=TraceSettings(rays=rays, max_bounces=max_bounces, floor_db=-60.0),
        artefacts=Artefacts(attitude=attitude),
    ).echoes(0)


def one_way_db(elevation_deg: float) -> float:
    """Gain at an elevation of the data of the sensor."""
    return dict(POINTING.elevation_pattern_db)[elevation_deg]


def corner_power_db(bearing_deg: float, elevation_deg: float, ride: Ride) -> float:
    """Power of a point target at a bearing, clockwise, and an elevation from the level antenna [dB]."""
    bearing, level = math.radians(bearing_deg), RANGE_M * math.cos(math.radians(elevation_deg))
    height_m = HEIGHT_M + RANGE_M * math.sin(math.radians(elevation_deg))
    place = (level * math.cos(bearing), -level * math.sin(bearing), height_m)
    town = with_targets(world(), [Target(kind="point", position_m=place, heading_rad=0.0)])
    echoes = echoes_of(town, ride, rays=16)
    row = round(bearing_deg / 0.9) % 400
    amplitude = echoes.amplitude[echoes.azimuth == row].astype(np.complex128).sum()
    return float(decibel(abs(amplitude) ** 2))


CASES = [
    # bearing, pitch, roll, and how much higher the target is in the frame of the antenna (cosines of 1)
    ("ahead, nose up by 1.5 deg", 0.0, 1.5, 0.0, -1.5),
    ("ahead, nose down by 1.5 deg", 0.0, -1.5, 0.0, 1.5),
    ("behind, nose up by 1.5 deg", 180.0, 1.5, 0.0, 1.5),
    ("to the right, nose up by 1.5 deg", 90.0, 1.5, 0.0, 0.0),
    ("to the right, right side down by 1.5 deg", 90.0, 0.0, 1.5, 1.5),
    ("to the left, right side down by 1.5 deg", 270.0, 0.0, 1.5, -1.5),
    ("ahead, right side down by 1.5 deg", 0.0, 0.0, 1.5, 0.0),
    ("half right, nose up and right side down by 1.5 deg", 45.0, 1.5, 1.5, 0.0),
]


@pytest.mark.parametrize(("where", "bearing_deg", "pitch_deg", "roll_deg", "seen_deg"), CASES)
def test_point_is_received_by_its_elevation_in_the_frame_of_the_tilted_antenna(
    where: str,
    bearing_deg: float,
    pitch_deg: float,
    roll_deg: float,
    seen_deg: float,
    law: LawRecorder,
) -> None:
    elevation_deg = -1.5
    level = corner_power_db(bearing_deg, elevation_deg, standing())
    found = corner_power_db(bearing_deg, elevation_deg, tilted(pitch_deg, roll_deg))
    change = one_way_db(elevation_deg + seen_deg) - one_way_db(elevation_deg)
    law(
        f"Point 1.5 deg below the horizon {where}, over level",
        source="elevation pattern of the antenna, both ways, at the elevation less the tilt",
        expected=2 * change,
        simulated=found - level,
        tolerance=0.1,
        unit="dB",
        why="the antenna sways by 4 cm, 0.04 deg of the beam at 60 m",
    )


def turned(mesh: Mesh, rotation: NDArray[np.float64], sway_m: NDArray[np.float64]) -> Mesh:
    """A mesh turned about the level antenna, and moved with it."""
    middle = np.array([0.0, 0.0, HEIGHT_M])
    vertices = (mesh.vertices - middle) @ rotation.T + middle + sway_m
    return Mesh(vertices=vertices.astype(np.float32), faces=mesh.faces)


def rotation_of(pitch_deg: float, roll_deg: float) -> NDArray[np.float64]:
    """Matrix that turns what is level into the frame of the body: roll about x, then pitch about -y."""
    p, r = np.radians([pitch_deg, roll_deg])
    roll = np.array([[1, 0, 0], [0, np.cos(r), -np.sin(r)], [0, np.sin(r), np.cos(r)]])
    pitch = np.array([[np.cos(p), 0, -np.sin(p)], [0, 1, 0], [np.sin(p), 0, np.cos(p)]])
    return pitch @ roll


@pytest.mark.parametrize(
    ("pitch_deg", "roll_deg", "bearing_deg"), [(3.0, 0.0, 0.0), (-2.0, 4.0, 117.0), (1.0, -3.0, 250.0)]
)
def test_world_that_is_tilted_with_the_antenna_looks_the_same(
    pitch_deg: float, roll_deg: float, bearing_deg: float
) -> None:
    # A wall and a slab below it: echoes of one bounce, and ghosts of two between them.
    bearing = math.radians(bearing_deg)
    wall = facing(bearing, math.radians(-2.0), 24.0, 3.0, 3.0)
    slab = facing(bearing, math.radians(-88.0), 1.2, 60.0, 60.0)
    rotation = rotation_of(pitch_deg, roll_deg)
    sway = ARM_M * (rotation[:, 2] - [0, 0, 1])
    straight_up, leaning = (
        echoes_of(world(*(("metal", "wall", mesh) for mesh in meshes)), ride, max_bounces=2)
        for meshes, ride in (
            ((wall, slab), standing()),
            ([turned(mesh, rotation, sway) for mesh in (wall, slab)], tilted(pitch_deg, roll_deg)),
        )
    )
    for instance in (1, 2):
        level, found = (decibel(power_of(each, instance)) for each in (straight_up, leaning))
        # Metal reflects both polarisations alike. Vertices are stored to a micrometre.
        assert found == pytest.approx(float(level), abs=0.15)
    assert (leaning.bounces == 2).any()
    for order in (1, 2):
        level, found = (
            each.mean_power[each.bounces == order].sum(dtype=np.float64) for each in (straight_up, leaning)
        )
        # Ghosts lose a solid angle per cell of the world's lattice, which is not tilted.
        assert decibel(found / level) == pytest.approx(0.0, abs=0.2 if order == 1 else 0.5)


def test_strength_scales_the_angles() -> None:
    scene = world(("concrete", "wall", facing(0.0, 0.0, 20.0, 4.0, 4.0)))
    doubled, whole = echoes_of(scene, tilted(1.0, 0.5), attitude=2.0), echoes_of(scene, tilted(2.0, 1.0))
    np.testing.assert_array_equal(doubled.amplitude, whole.amplitude)


def test_level_car_gives_the_bytes_of_a_drive_without_attitude() -> None:
    scene = world(("concrete", "wall", facing(0.0, 0.0, 20.0, 4.0, 4.0)))
    ride = straight([0, 0], [3.0, 0.0])
    plain, level = (
        Simulator(
            scene, each, seed=4, settings=TraceSettings(rays=16), artefacts=Artefacts(attitude=strength)
        ).scan(1)
        for each, strength in ((ride, 1.0), (tilted(2.0, 1.0, ride), 0.0))
    )
    assert plain.codes.tobytes() == level.codes.tobytes()
    assert level.truth is not None
    assert level.truth.attitude is not None
    assert not level.truth.attitude.any()
    assert plain == level
