"""Cross-sections of roads from their tags: widths, lanes, directions and speeds add up."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from echoscape.scenes.io.osm.elements.map_data import Way
from echoscape.scenes.io.osm.streets.road_types import (
    DRIVEN,
    LANE_RANGE_M,
    is_driven,
    is_undriven,
    street_type,
)
from echoscape.scenes.roads.street_network import StreetType


def kind(*, built_up: bool = True, seed: int = 0, **tags: str) -> StreetType:
    spelled = {key.replace("__", ":"): value for key, value in {"highway": "residential", **tags}.items()}
    way = Way(id=1, nodes=(1, 2), tags=spelled)
    return street_type(way, built_up=built_up, rng=np.random.default_rng(seed))


@given(st.floats(5.0, 16.0), st.integers(2, 8), st.booleans())
def test_a_carriageway_is_as_wide_as_the_map_says(width: float, lanes: int, oneway: bool) -> None:
    found = kind(
        highway="secondary", width=f"{width:.3f}", lanes=str(lanes), oneway="yes" if oneway else "no"
    )
    total = min(lanes if oneway else 2 * (lanes // 2), 4 if oneway else 8)
    lane = np.clip(width / total, *LANE_RANGE_M)
    assert 2 * found.half_width_m == pytest.approx(total * lane, abs=2e-3 * total)


def test_directions() -> None:
    assert not kind().oneway
    assert kind(oneway="yes").oneway
    assert kind(oneway="-1").oneway
    assert kind(highway="motorway").oneway
    assert not kind(highway="motorway", oneway="no").oneway
    assert kind(junction="roundabout").oneway


def test_lanes_are_shared_by_both_directions() -> None:
    assert kind(lanes="4").lanes == 2
    assert kind(lanes="1").lanes == 1
    assert kind(lanes="3", oneway="yes").lanes == 3


def test_speed_limits_are_kept_within_what_can_be_driven() -> None:
    assert kind(maxspeed="36").speed_limit_mps == pytest.approx(10.0)
    assert kind(maxspeed="5").speed_limit_mps == 5.0
    assert kind(maxspeed="none").speed_limit_mps == DRIVEN["residential"].speed_limit_mps


def test_pavements_run_along_built_up_roads_unless_the_map_says_otherwise() -> None:
    assert kind().pavement_m > 0
    assert kind(built_up=False).pavement_m == 0
    assert kind(sidewalk="no").pavement_m == 0
    assert kind(built_up=False, sidewalk="both").pavement_m > 0


def test_parking_is_drawn_only_where_the_map_says_nothing() -> None:
    drawn = {kind(seed=seed).parking_m for seed in range(20)}
    assert drawn == {0.0, 2.5}
    assert {kind(seed=seed, parking__both="no").parking_m for seed in range(20)} == {0.0}
    assert {kind(seed=seed, parking__both="lane").parking_m for seed in range(20)} == {2.5}
    assert {kind(seed=seed, highway="secondary").parking_m for seed in range(20)} == {0.0}


@pytest.mark.parametrize(
    ("tags", "driven", "undriven"),
    [
        ({"highway": "residential"}, True, False),
        ({"highway": "residential", "tunnel": "yes"}, False, False),
        ({"highway": "residential", "motor_vehicle": "no"}, False, False),
        ({"highway": "service"}, True, False),
        ({"highway": "service", "service": "driveway"}, False, True),
        ({"highway": "track"}, False, True),
        ({"highway": "pedestrian", "area": "yes"}, False, False),
        ({"highway": "construction"}, False, False),
        ({"waterway": "river"}, False, False),
    ],
)
def test_what_is_driven(tags: dict[str, str], driven: bool, undriven: bool) -> None:
    assert is_driven(tags) == driven
    assert is_undriven(tags) == undriven
