"""Motion compensation of matches: landmarks measured from a moving car are put back exactly."""

import cmath
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from numpy.typing import NDArray
from torch import Tensor

from echoscape.learn.geometry.matches import Matches
from echoscape.learn.geometry.motion_compensation import (
    Part,
    ScanMotionModel,
    Twist,
    solve_compensated,
    to_mid_scan,
    twist_between,
)
from echoscape.learn.geometry.procrustes import Motion, rotation_of_yaw
from echoscape.learn.geometry.se2 import to_motion, transform
from echoscape.sim.datasets.se2 import IDENTITY, SE2

SCAN_S, BETA_S, GAP_S = 0.25, 0.049, 0.25


def _pose(velocity: tuple[float, float, float], time_s: float) -> NDArray[np.float64]:
    """Return the car's place after a time at steady velocities in its own frame, as a 3 x 3 matrix.

    In complex numbers, forward + i right: v integrated over e^(i yaw t), with yaw no smaller than 1e-9.
    """
    forward, right, yaw = velocity
    yaw = yaw or 1e-9
    turn = cmath.exp(1j * yaw * time_s)
    place = complex(forward, right) * (turn - 1) / (1j * yaw)
    return np.array([[turn.real, -turn.imag, place.real], [turn.imag, turn.real, place.imag], [0, 0, 1]])


def _seen(spot: NDArray[np.float64], velocity: tuple[float, float, float]) -> NDArray[np.float64]:
    """Return where a scan shows a spot (2,) that stands still in the frame of mid-scan."""

    def away(time_s: float) -> NDArray[np.float64]:
        return np.asarray(np.linalg.inv(_pose(velocity, time_s)) @ [*spot, 1.0], np.float64)[:2]

    def late(time_s: float) -> float:
        """How far the beam is past the spot [rad], no jump within the scan."""
        beam = (time_s / SCAN_S + 0.5) * 2 * math.pi
        angle = math.atan2(*away(time_s)[::-1]) % (2 * math.pi)
        return beam - angle

    time_s = bisect(late, -SCAN_S / 2, SCAN_S / 2)
    there = away(time_s)
    beam = there / np.hypot(*there)
    return there - BETA_S * float(beam @ velocity[:2]) * beam


def bisect(rising: Callable[[float], float], low: float, high: float) -> float:
    """Return where a function that rises from below 0 to above is 0."""
    assert rising(low) < 0 < rising(high)
    for _ in range(45):
        middle = (low + high) / 2
        low, high = (middle, high) if rising(middle) < 0 else (low, middle)
    return low


def _spots() -> NDArray[np.float64]:
    """Spots that no car of these tests sees at the seam of the scan, straight ahead."""
    angle, range_m = np.linspace(0.5, 5.8, 12), np.linspace(15.0, 90.0, 12)
    return np.stack([range_m * np.cos(angle), range_m * np.sin(angle)], -1)


def _tensor(points: NDArray[np.float64]) -> Tensor:
    return torch.from_numpy(points)[None]


VELOCITIES = [(12.0, 0.3, 0.4), (-3.0, 0.0, -0.5), (8.0, 0.0, 0.0), (0.0, 0.0, 0.0)]


@pytest.mark.parametrize("velocity", VELOCITIES)
def test_a_spot_is_put_where_it_is_at_mid_scan(velocity: tuple[float, float, float]) -> None:
    seen = np.stack([_seen(spot, velocity) for spot in _spots()])
    twist = Twist(velocity_mps=torch.tensor([velocity[:2]]), yaw_rate_rps=torch.tensor([velocity[2]]))
    found = to_mid_scan(_tensor(seen), twist, scan_s=SCAN_S, seam_rad=0.0, doppler_beta_s=BETA_S)
    assert_allclose(found[0], _spots(), atol=1e-6)


@given(
    yaw=st.floats(-1, 1, allow_subnormal=False),
    forward=st.floats(-20, 20),
    right=st.floats(-3, 3),
    gap_s=st.sampled_from([-0.5, 0.25]),
)
@settings(deadline=None)
def test_steady_velocities_lead_to_the_motion(yaw: float, forward: float, right: float, gap_s: float) -> None:
    motion = Motion(
        rotation=rotation_of_yaw(torch.tensor([yaw], dtype=torch.float64)),
        translation_m=torch.tensor([[forward, right]], dtype=torch.float64),
        certain=torch.ones(1, dtype=torch.bool),
    )
    twist = twist_between(motion, gap_s)
    ahead, aside = twist.velocity_mps[0].tolist()
    pose = _pose((ahead, aside, float(twist.yaw_rate_rps)), gap_s)
    assert_allclose(pose[:2, 2], [forward, right], atol=1e-6)
    assert_allclose(pose[:2, :2], motion.rotation[0], atol=1e-9)


@pytest.mark.parametrize("backwards", [False, True])
@pytest.mark.parametrize("velocity", VELOCITIES[:3])
def test_the_motion_between_rolling_scans_is_exact_at_steady_velocity(
    velocity: tuple[float, float, float], backwards: bool
) -> None:
    later = _pose(velocity, GAP_S)
    earlier_spots = _spots()
    later_spots = (np.linalg.inv(later) @ np.c_[earlier_spots, np.ones(12)].T)[:2].T
    kept = np.abs(np.arctan2(later_spots[:, 1], later_spots[:, 0])) > 0.3
    earlier = np.stack([_seen(spot, velocity) for spot in earlier_spots[kept]])
    seen = np.stack([_seen(spot, velocity) for spot in later_spots[kept]])
    source, destination = (earlier, seen) if backwards else (seen, earlier)
    weights = torch.ones(1, len(seen), dtype=torch.float64)
    matches = Matches(source_m=_tensor(source), destination_m=_tensor(destination), weights=weights)
    scan_motion = ScanMotionModel(
        scan_s=SCAN_S, seam_rad=0.0, doppler_beta_s=BETA_S, gap_s=-GAP_S if backwards else GAP_S
    )
    expected = np.linalg.inv(later) if backwards else later
    found, (part,) = solve_compensated(
        [Part(matches=matches, pose=to_motion(IDENTITY, torch.float64))], scan_motion=scan_motion
    )
    moved = part.matches
    assert_allclose(
        moved.destination_m[0], later_spots[kept] if backwards else earlier_spots[kept], atol=1e-3
    )
    assert_allclose(found.translation_m[0], expected[:2, 2], atol=1e-4)
    assert_allclose(found.rotation[0], expected[:2, :2], atol=1e-5)


def test_a_keyframe_at_another_velocity_is_compensated_by_its_own() -> None:
    """The car turned when it saw the keyframe, far off by now, and goes straight on."""
    turning, straight = (8.0, 0.0, 0.4), (8.0, 0.0, 0.0)
    spots = _spots()
    # The keyframe stands at the origin, the scan before at 3 m and a turn, the source one gap after it.
    before = np.array([[math.cos(0.3), -math.sin(0.3), 3.0], [math.sin(0.3), math.cos(0.3), 0.5], [0, 0, 1]])
    source = before @ _pose(straight, GAP_S)

    def away(pose: NDArray[np.float64]) -> NDArray[np.float64]:
        return (np.linalg.inv(pose) @ np.c_[spots, np.ones(len(spots))].T)[:2].T

    clear = [np.abs(np.arctan2(*away(pose).T[::-1])) > 0.3 for pose in (np.eye(3), before, source)]
    kept = np.logical_and.reduce(clear)
    seen = {
        "key": np.stack([_seen(spot, turning) for spot in spots[kept]]),
        "before": np.stack([_seen(spot, straight) for spot in away(before)[kept]]),
        "source": np.stack([_seen(spot, straight) for spot in away(source)[kept]]),
    }
    weights = torch.ones(1, int(kept.sum()), dtype=torch.float64)
    stood = to_motion(SE2(x_m=3.0, y_m=0.5, yaw_rad=0.3), torch.float64)
    twist = Twist(velocity_mps=torch.tensor([turning[:2]]), yaw_rate_rps=torch.tensor([turning[2]]))
    parts = [
        Part(
            matches=Matches(
                source_m=_tensor(seen["source"]), destination_m=_tensor(seen[name]), weights=weights
            ),
            pose=pose,
            twist=own,
        )
        for name, pose, own in (("key", to_motion(IDENTITY, torch.float64), twist), ("before", stood, None))
    ]
    scan_motion = ScanMotionModel(scan_s=SCAN_S, seam_rad=0.0, doppler_beta_s=BETA_S, gap_s=GAP_S)
    found, _ = solve_compensated(parts, scan_motion=scan_motion)
    assert_allclose(found.translation_m[0], source[:2, 2], atol=1e-3)
    assert_allclose(found.rotation[0], source[:2, :2], atol=1e-4)


def test_parts_count_by_direction_in_the_frame_of_the_answer_and_by_weight() -> None:
    """Matches of a stop that stands turned slid ahead along a wall; its precisions turn with it."""
    where = SE2(x_m=3.0, y_m=0.5, yaw_rad=0.6)
    there = SE2(x_m=4.0, y_m=1.0, yaw_rad=0.7)
    world = _tensor(_spots())
    source = transform(there.inverse(), world.float())
    stop = transform(where.inverse(), world.float())
    slid = stop + torch.tensor([0.4, 0.0])
    ahead = torch.diag(torch.tensor([0.0, 1.0])).expand(1, 12, 2, 2)
    part = Part(
        matches=Matches(source_m=source, destination_m=slid, weights=torch.ones(1, 12), precision=ahead),
        pose=to_motion(where),
    )
    few = Matches(
        source_m=source[:, :3],
        destination_m=world[:, :3].float(),
        weights=torch.ones(1, 3),
        precision=torch.eye(2).expand(1, 3, 2, 2),
    )
    found, _ = solve_compensated([Part(matches=few, pose=to_motion(IDENTITY)), part], scale_m=0.5)
    assert_allclose(found.translation_m[0], [4.0, 1.0], atol=1e-3)
    assert_allclose(found.yaw_rad, 0.7, atol=1e-4)
    # Two parts at odds meet at their weights' mean.
    shifted = replace(few, destination_m=few.destination_m + torch.tensor([0.04, 0.0]))
    parts = [
        Part(matches=few, pose=to_motion(IDENTITY), weight=3.0),
        Part(matches=shifted, pose=to_motion(IDENTITY)),
    ]
    found, _ = solve_compensated(parts)
    assert_allclose(found.translation_m[0], [4.01, 1.0], atol=1e-3)


def test_points_taken_as_they_are_are_off_where_the_car_turns() -> None:
    """What de-skewing is for: two scans of a bend, solved without it, are off by more than with it."""
    velocity = (10.0, 0.0, 0.6)
    later = _pose(velocity, GAP_S)
    spots = (np.linalg.inv(later) @ np.c_[_spots(), np.ones(12)].T)[:2].T
    kept = np.abs(np.arctan2(spots[:, 1], spots[:, 0])) > 0.3
    matches = Matches(
        source_m=_tensor(np.stack([_seen(spot, velocity) for spot in spots[kept]])),
        destination_m=_tensor(np.stack([_seen(spot, velocity) for spot in _spots()[kept]])),
        weights=torch.ones(1, int(kept.sum()), dtype=torch.float64),
    )
    off = torch.linalg.vector_norm(matches.motion().translation_m[0] - torch.from_numpy(later[:2, 2]))
    assert float(off) > 0.01


@pytest.mark.parametrize(
    "wrong", [{"scan_s": 0.0}, {"gap_s": 0.0}, {"seam_rad": math.inf}, {"doppler_beta_s": math.nan}]
)
def test_times_and_coefficients_out_of_their_range_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=f"{next(iter(wrong))} must"):
        ScanMotionModel(
            **{"scan_s": SCAN_S, "seam_rad": 0.0, "doppler_beta_s": BETA_S, "gap_s": GAP_S, **wrong}
        )


def test_parts_of_one_destination_are_one_part() -> None:
    """Whichever part a match is in, its own destination is moved with it."""
    velocity = VELOCITIES[0]
    earlier = _tensor(np.array([_seen(spot, velocity) for spot in _spots()]))
    away = np.asarray(np.linalg.inv(_pose(velocity, GAP_S)), np.float64)
    there = [away @ np.array([*spot, 1.0]) for spot in _spots()]
    later = _tensor(np.array([_seen(spot[:2], velocity) for spot in there]))
    weights = torch.linspace(0.5, 1.5, 12, dtype=torch.float64)[None]
    scan_motion = ScanMotionModel(scan_s=SCAN_S, seam_rad=0.0, doppler_beta_s=BETA_S, gap_s=GAP_S)

    def part(which: slice) -> Part:
        matches = Matches(
            source_m=later[:, which], destination_m=earlier[:, which], weights=weights[:, which]
        )
        return Part(matches=matches, pose=to_motion(IDENTITY, torch.float64))

    whole, _ = solve_compensated([part(slice(None))], scan_motion=scan_motion)
    halves, seen = solve_compensated([part(slice(0, 6)), part(slice(6, None))], scan_motion=scan_motion)
    assert_allclose(halves.translation_m, whole.translation_m, atol=1e-9)
    assert_allclose(halves.yaw_rad, whole.yaw_rad, atol=1e-9)
    assert_allclose(whole.translation_m[0], _pose(velocity, GAP_S)[:2, 2], atol=1e-4)
    assert [each.matches.source_m.shape[1] for each in seen] == [6, 6]
