"""What is known of training pairs: velocities of a drive, and points of rolling scans put right."""

import math

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose
from torch import Tensor

from echoscape.learn.data.ground_truth import DriveMotion, Roll, Truth, drive_motion, rolls
from echoscape.learn.geometry.matches import Matches
from echoscape.learn.geometry.se2 import to_motion, transform
from echoscape.sim.datasets.scan_folder import open_folder
from echoscape.sim.datasets.se2 import IDENTITY, SE2
from tests.learn.folders import write_folder

TURN_S, BETA_S = 0.25, 0.05


def points(count: int = 40) -> Tensor:
    """Points that are not straight ahead, where a scan has its seam."""
    angle, range_m = torch.linspace(0.3, 5.9, count), torch.linspace(12.0, 90.0, count)
    return torch.stack([range_m * angle.cos(), range_m * angle.sin()], -1)[None]


def roll(shown_at: SE2, velocity: tuple[float, float, float]) -> Roll:
    drive = DriveMotion(velocities=np.array([velocity]), turn_s=TURN_S, doppler_beta_s=BETA_S)
    return rolls([(drive, 0)], to_motion(shown_at))


def seen(spot: tuple[float, float], velocity: tuple[float, float, float]) -> tuple[float, float]:
    """Where a car of steady velocity sees a spot of its frame at mid-scan, by bisection over time.

    The beam is at 2 pi (t / turn + 1 / 2) at time t; the range is beta times the closing speed too short.
    """
    forward, right, rate = velocity

    def at(time_s: float) -> tuple[float, float]:
        yaw = rate * time_s
        if rate == 0:
            place = complex(forward, right) * time_s
        else:
            place = complex(forward, right) * (np.exp(1j * yaw) - 1) / (1j * rate)
        relative = (complex(*spot) - place) * np.exp(-1j * yaw)
        return math.hypot(relative.real, relative.imag), math.atan2(relative.imag, relative.real) % (
            2 * math.pi
        )

    low, high = -TURN_S / 2, TURN_S / 2
    for _ in range(60):
        middle = (low + high) / 2
        if 2 * math.pi * (middle / TURN_S + 0.5) < at(middle)[1]:
            low = middle
        else:
            high = middle
    range_m, azimuth = at(low)
    range_m -= BETA_S * (forward * math.cos(azimuth) + right * math.sin(azimuth))
    return range_m * math.cos(azimuth), range_m * math.sin(azimuth)


@pytest.mark.parametrize("velocity", [(9.0, 0.2, 0.3), (-2.0, 0.0, 0.0)])
@pytest.mark.parametrize("shown_at", [IDENTITY, SE2(x_m=5.0, y_m=-3.0, yaw_rad=2.0)])
def test_points_of_a_picture_are_put_where_they_are_at_mid_scan(
    velocity: tuple[float, float, float], shown_at: SE2
) -> None:
    true = points()
    pictured = torch.tensor([[seen((x, y), velocity) for x, y in true[0].tolist()]])
    found = roll(shown_at, velocity).undone(transform(shown_at, pictured))
    assert_allclose(found, transform(shown_at, true), atol=1e-3)


@pytest.mark.parametrize("shown_at", [IDENTITY, SE2(x_m=5.0, y_m=-3.0, yaw_rad=2.0)])
@pytest.mark.parametrize("velocity", [(9.0, 0.2, 0.3), (30.0, 0.0, 0.1)])
def test_doing_is_the_inverse_of_undoing(shown_at: SE2, velocity: tuple[float, float, float]) -> None:
    rolled, true = roll(shown_at, velocity), transform(shown_at, points())
    assert float((rolled.done(true) - true).abs().max()) > 0.5
    assert_allclose(rolled.undone(rolled.done(true)), true, atol=1e-3)


def test_places_and_matches_agree_on_how_scans_rolled() -> None:
    """What is matched with its true place is off by nothing once both are put to mid-scan."""
    motion = SE2(x_m=2.0, y_m=0.3, yaw_rad=0.2)
    truth = Truth(
        motion=to_motion(motion),
        source=roll(SE2(x_m=1.0, y_m=0.5, yaw_rad=0.1), (9.0, 0.0, 0.2)),
        destination=roll(IDENTITY, (8.0, 0.0, -0.1)),
    )
    source = points()
    matches = Matches(source_m=source, destination_m=truth.places(source), weights=torch.ones(1, 40))
    assert float(matches.errors_m(truth.motion).max()) > 0.1
    assert float(truth.to_mid_scan(matches).errors_m(truth.motion).max()) < 5e-3
    still = Truth(motion=to_motion(motion))
    assert_allclose(still.places(source), transform(motion, source))
    assert still.to_mid_scan(matches) is matches


def test_velocities_come_of_the_poses_around(tmp_path) -> None:
    """A car in a circle to the right: speed and yaw rate alike at all scans, the outermost included."""
    radius_m, step = 30.0, 0.05
    poses = [(radius_m * math.sin(step * i), radius_m * (1 - math.cos(step * i)), step * i) for i in range(6)]
    folder = open_folder(write_folder(tmp_path / "drive", poses))
    world = folder.poses()
    assert world is not None
    gap_s = float(np.diff(folder.timestamps_us)[0]) / 1e6
    found = drive_motion(folder, world)
    assert found.turn_s == pytest.approx(1 / folder.sensor.rotation_hz)
    assert found.doppler_beta_s == pytest.approx(-folder.sensor.doppler_shift_s.mean())
    assert_allclose(found.velocities, [(radius_m * step / gap_s, 0.0, step / gap_s)] * 6, atol=1e-3)
    unknown = world.copy()
    unknown[1:3] = np.nan
    rates = drive_motion(folder, unknown).velocities[:, 2]
    assert rates[0] == 0.0
    assert rates[3] == pytest.approx(step / gap_s, rel=1e-3)


def test_each_scan_of_a_batch_has_its_own_velocity_and_turn() -> None:
    fast = DriveMotion(
        velocities=np.array([(0.0, 0.0, 0.0), (9.0, 0.0, 0.0)]), turn_s=0.2, doppler_beta_s=0.0
    )
    slow = DriveMotion(velocities=np.array([(1.0, 0.0, 0.0)]), turn_s=0.3, doppler_beta_s=0.1)
    both = rolls([(fast, 1), (slow, 0)], to_motion([IDENTITY, IDENTITY]))
    assert both.twist.velocity_mps[:, 0].tolist() == [9.0, 1.0]
    alone = rolls([(slow, 0)], to_motion(IDENTITY))
    spots = points().expand(2, -1, -1)
    assert_allclose(both.undone(spots)[1:], alone.undone(points()), atol=1e-6)
