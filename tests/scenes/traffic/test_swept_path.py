"""Long vehicles use only bends in which their swept path stays clear of the kerb."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from echoscape.scenes.core.lane_graph import Lane, RoadGraph
from echoscape.scenes.driving.route import LaneNetwork
from echoscape.scenes.traffic.swept_path import SweptPaths
from echoscape.scenes.traffic.vehicles import vehicle_track


def _racecourse(radius_m: float, width_m: float) -> RoadGraph:
    """Return two straight streets of 40 m joined by half circles."""
    along, angle = np.linspace(0.0, 40.0, 81), np.linspace(-np.pi / 2, np.pi / 2, 161)
    street = np.column_stack([along, np.full_like(along, -radius_m)])
    bend = radius_m * np.column_stack([np.cos(angle), np.sin(angle)]) + [40.0, 0.0]
    lines = [street, bend, [40.0, 0.0] - street, [40.0, 0.0] - bend]
    lanes = tuple(
        Lane(
            id=number,
            kind="turn" if number % 2 else "street",
            centre=line,
            width_m=width_m if number % 2 else 6.0,
            speed_limit_mps=10.0,
            successors=((number + 1) % 4,),
        )
        for number, line in enumerate(lines)
    )
    return RoadGraph(lanes=lanes, junctions=np.zeros((0, 2)))


@pytest.mark.parametrize("radius_m", [10.0, 12.0, 16.0])
def test_bends_are_open_to_vehicles_that_stay_on_them(radius_m: float) -> None:
    swept = SweptPaths(LaneNetwork(_racecourse(radius_m, 3.3)))
    # Axles 0.6 L apart on the circle, itself drawn in by sigma^2 / 2 R: the rest is 3.3 / 2 + 0.4 (+ 0.05) m.
    for length in (8.0, 10.0, 12.0, 14.0):
        inward = radius_m - np.sqrt(radius_m**2 - (0.3 * length) ** 2) + 0.5 / radius_m
        half = 1.65 + 0.4 - inward
        assert swept.drivable_lanes(length, 2 * (half - 0.08)).all()
        assert not swept.drivable_lanes(length, 2 * (half + 0.13)).any()


@pytest.mark.parametrize("radius_m", [10.0, 12.0, 16.0])
@pytest.mark.parametrize("length_m", [8.0, 12.0])
def test_bends_are_closed_to_vehicles_that_swing_over_the_kerb(radius_m: float, length_m: float) -> None:
    open_roads, width = _racecourse(radius_m, 3.3), 2.0
    assert SweptPaths(LaneNetwork(open_roads)).drivable_lanes(length_m, width).all()
    line = radius_m - 0.5 / radius_m
    middle = np.sqrt(line**2 - (0.3 * length_m) ** 2)
    corner = np.hypot(middle + width / 2, length_m / 2)

    def drivable_lanes(kerb_m: float) -> NDArray[np.bool_]:
        outer = shapely.LineString([(0.0, 0.0), (40.0, 0.0)]).buffer(kerb_m, quad_segs=64).exterior
        kerbs = (np.asarray(outer.coords),)
        return SweptPaths(LaneNetwork(replace(open_roads, kerbs=kerbs))).drivable_lanes(length_m, width)

    # A tenth of a metre, of mirrors, may hang over on either side, and half as much ahead.
    assert drivable_lanes(corner + 0.03).all()
    assert not drivable_lanes(corner - 0.18).any()


def test_long_vehicles_keep_both_axles_on_the_line() -> None:
    roads, length = _racecourse(12.0, 4.0), 10.0
    travel = np.arange(45.0, 70.0, 0.5)
    track = vehicle_track(roads, (0, 1, 2), travel, travel, np.ones_like(travel), length_m=length)
    for share in (-0.3, 0.3):
        ahead = np.column_stack([np.cos(track.state[:, 3]), np.sin(track.state[:, 3])])
        axle = track.state[:, :2] + share * length * ahead - [40.0, 0.0]
        on_bend = axle[:, 0] > 2.0
        np.testing.assert_allclose(np.hypot(*axle[on_bend].T), 12.0 - 0.5 / 12.0, atol=0.05)
