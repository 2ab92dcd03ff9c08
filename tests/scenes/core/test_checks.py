"""Settings of drives and traffic refuse what cannot be, by the name of the field, and take what is odd."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from echoscape.scenes.driving.ego_drive import DriveSettings, plan_ego_drive
from echoscape.scenes.driving.route import RouteSettings
from echoscape.scenes.driving.speed_profile import SpeedSettings, triangular_quantile
from echoscape.scenes.town.build import build_town
from echoscape.scenes.traffic.plan import TrafficSettings, plan_traffic

CANNOT_BE = [
    (SpeedSettings, {"stop_chance": 2.0}),
    (SpeedSettings, {"stop_chance": float("nan")}),
    (SpeedSettings, {"yield_chance": -0.1}),
    (SpeedSettings, {"town_cruise_mps": (9.0, 5.0, 2.0)}),
    (SpeedSettings, {"town_cruise_mps": (2.0, 9.0, 5.0)}),
    (SpeedSettings, {"town_cruise_mps": (2.0, 5.0, float("inf"))}),
    (SpeedSettings, {"open_share": (0.8, 1.2)}),
    (SpeedSettings, {"bend_mps2": (0.0, 0.0)}),
    (SpeedSettings, {"yaw_rate_rps": (0.0, 0.3)}),
    (SpeedSettings, {"speed_up_mps2": (2.0, 1.0)}),
    (SpeedSettings, {"brake_mps2": (2.0, 1.0)}),
    (SpeedSettings, {"brake_mps2": (0.0, 0.0)}),
    (SpeedSettings, {"stop_range_s": (5.0, 2.0)}),
    (SpeedSettings, {"stop_range_s": (2.0, 1e9)}),
    (SpeedSettings, {"stretch_m": 0.0}),
    (SpeedSettings, {"smoothing_s": 1e9}),
    (SpeedSettings, {"unrest_length_m": 1e9}),
    (RouteSettings, {"revisit_share": 2.0}),
    (DriveSettings, {"wander_m": 1e9}),
    (DriveSettings, {"wander_length_m": 1e9}),
    (DriveSettings, {"knot_s": 1e-9}),
    (TrafficSettings, {"vehicles_per_km2": 1e9}),
    (TrafficSettings, {"pedestrians_per_km2": 1e9}),
    (TrafficSettings, {"near_m": 1e9}),
    (TrafficSettings, {"step_s": 1e-9}),
]


@pytest.mark.parametrize(("kind", "field"), CANNOT_BE)
def test_invalid_settings_are_refused_by_name(kind: Any, field: dict[str, Any]) -> None:
    (name,) = field
    with pytest.raises(ValueError, match=f"^{name} must .*, got "):
        kind(**field)


def test_unusual_but_valid_settings_are_accepted() -> None:
    SpeedSettings(stop_chance=0.0, yield_chance=1.0, stop_range_s=(0.0, 0.0), town_cruise_mps=(5.0, 5.0, 5.0))
    RouteSettings(revisit_share=1.0)
    DriveSettings(wander_m=0.0)
    TrafficSettings(vehicles_per_km2=0.0, pedestrians_per_km2=0.0)


def test_distribution_without_width_has_one_value() -> None:
    assert_array_equal(triangular_quantile(np.linspace(0, 1, 5), 5.0, 5.0, 5.0), np.full(5, 5.0))


@pytest.mark.parametrize(
    ("seed", "message"),
    [
        (1.5, "seed must be a whole number, got 1.5"),
        ("7", "seed must be a whole number, got '7'"),
        (True, "seed must be a whole number, got True"),
        (-1, "seed must be 0 or more, got -1"),
    ],
)
def test_seeds_are_whole_numbers(seed: Any, message: str) -> None:
    numpy_seed: Any = np.int64(1)
    town = build_town("empty", seed=numpy_seed)
    drive = plan_ego_drive(town, seed=1, duration_s=1.0)
    for build in (
        lambda: build_town("empty", seed=seed),
        lambda: plan_ego_drive(town, seed=seed, duration_s=1.0),
        lambda: plan_traffic(town, drive, seed=seed),
    ):
        with pytest.raises(ValueError, match=f"^{message}$"):
            build()
