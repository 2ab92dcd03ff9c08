"""Ground truth of training pairs: velocities of a drive, and points of scans moved to mid-scan."""

import math

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose
from torch import Tensor

from echoscape.learn.data.ground_truth import (
    EgoMotion,
    GroundTruth,
    ScanDistortion,
    ego_motion,
    scan_distortions,
)
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


def distortion(scan_in_image: SE2, velocity: tuple[float, float, float]) -> ScanDistortion:
    drive = EgoMotion(velocities=np.array([velocity]), scan_s=TURN_S, seam_rad=0.0, doppler_beta_s=BETA_S)
    return scan_distortions([(drive, 0)], to_motion(scan_in_image))


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
@pytest.mark.parametrize("scan_in_image", [IDENTITY, SE2(x_m=5.0, y_m=-3.0, yaw_rad=2.0)])
def test_points_of_an_image_are_moved_to_where_they_are_at_mid_scan(
    velocity: tuple[float, float, float], scan_in_image: SE2
) -> None:
    true = points()
    in_image = torch.tensor([[seen((x, y), velocity) for x, y in true[0].tolist()]])
    found = distortion(scan_in_image, velocity).to_mid_scan(transform(scan_in_image, in_image))
    assert_allclose(found, transform(scan_in_image, true), atol=1e-3)


@pytest.mark.parametrize("scan_in_image", [IDENTITY, SE2(x_m=5.0, y_m=-3.0, yaw_rad=2.0)])
@pytest.mark.parametrize("velocity", [(9.0, 0.2, 0.3), (30.0, 0.0, 0.1)])
def test_from_mid_scan_is_the_inverse_of_to_mid_scan(
    scan_in_image: SE2, velocity: tuple[float, float, float]
) -> None:
    distorted, true = distortion(scan_in_image, velocity), transform(scan_in_image, points())
    assert float((distorted.from_mid_scan(true) - true).abs().max()) > 0.5
    assert_allclose(distorted.to_mid_scan(distorted.from_mid_scan(true)), true, atol=1e-3)


def test_true_places_and_matches_agree_on_the_distortion() -> None:
    """A match with its true place has no error once both points are moved to mid-scan."""
    motion = SE2(x_m=2.0, y_m=0.3, yaw_rad=0.2)
    truth = GroundTruth(
        motion=to_motion(motion),
        source=distortion(SE2(x_m=1.0, y_m=0.5, yaw_rad=0.1), (9.0, 0.0, 0.2)),
        destination=distortion(IDENTITY, (8.0, 0.0, -0.1)),
    )
    source = points()
    matches = Matches(source_m=source, destination_m=truth.true_places(source), weights=torch.ones(1, 40))
    assert float(matches.errors_m(truth.motion).max()) > 0.1
    assert float(truth.to_mid_scan(matches).errors_m(truth.motion).max()) < 5e-3
    still = GroundTruth(motion=to_motion(motion))
    assert_allclose(still.true_places(source), transform(motion, source))
    assert still.to_mid_scan(matches) is matches


def test_velocities_are_those_between_neighbouring_poses(tmp_path) -> None:
    """A car in a circle to the right: speed and yaw rate alike at all scans, the outermost included."""
    radius_m, step = 30.0, 0.05
    poses = [(radius_m * math.sin(step * i), radius_m * (1 - math.cos(step * i)), step * i) for i in range(6)]
    folder = open_folder(write_folder(tmp_path / "drive", poses))
    world = folder.poses()
    assert world is not None
    gap_s = float(np.diff(folder.timestamps_us)[0]) / 1e6
    found = ego_motion(folder, world)
    assert found.scan_s == pytest.approx(1 / folder.sensor.rotation_hz)
    assert found.seam_rad == pytest.approx(math.radians(0.9 * (13 / 14 - 0.5)))
    assert found.doppler_beta_s == pytest.approx(-folder.sensor.doppler_shift_s.mean())
    assert_allclose(found.velocities, [(radius_m * step / gap_s, 0.0, step / gap_s)] * 6, atol=1e-3)
    unknown = world.copy()
    unknown[1:3] = np.nan
    rates = ego_motion(folder, unknown).velocities[:, 2]
    assert rates[0] == 0.0
    assert rates[3] == pytest.approx(step / gap_s, rel=1e-3)


def test_each_scan_of_a_batch_has_its_own_velocity_and_duration() -> None:
    fast = EgoMotion(
        velocities=np.array([(0.0, 0.0, 0.0), (9.0, 0.0, 0.0)]), scan_s=0.2, seam_rad=0.0, doppler_beta_s=0.0
    )
    slow = EgoMotion(velocities=np.array([(1.0, 0.0, 0.0)]), scan_s=0.3, seam_rad=0.4, doppler_beta_s=0.1)
    both = scan_distortions([(fast, 1), (slow, 0)], to_motion([IDENTITY, IDENTITY]))
    assert both.twist.velocity_mps[:, 0].tolist() == [9.0, 1.0]
    alone = scan_distortions([(slow, 0)], to_motion(IDENTITY))
    spots = points().expand(2, -1, -1)
    assert_allclose(both.to_mid_scan(spots)[1:], alone.to_mid_scan(points()), atol=1e-6)
