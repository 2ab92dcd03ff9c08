"""Lanes of a street network: traffic keeps to the right, every movement at a junction is a smooth curve.

Streets are trimmed where their junction begins; turning lanes, roundabouts and turnarounds at dead ends
connect the rest with equal position, direction and (except for turnarounds) curvature.
"""

import itertools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core import portable_math
from echoscape.scenes.core.lane_graph import RoadGraph
from echoscape.scenes.geometry.curves import (
    Line,
    headings,
    offset,
    resampled,
    section,
    smallest_radius,
    transformed,
    turnaround,
)
from echoscape.scenes.roads.lane_graph_builder import LaneGraphBuilder
from echoscape.scenes.roads.street_network import Network, Street

ROUNDABOUT_RADIUS_M = 16.0
TURNAROUND_RADIUS_M = 7.0
_TURNAROUND_ROOM_M = 15.0
_RIGHT_RADIUS_M = 10.0
_SHARPEST_M = 5.2
_NARROWEST_RAD = np.deg2rad(20.0)
"""Angle between two arms below which trimming them further would not part them."""


class Arm(NamedTuple):
    """A street end at a junction.

    Attributes:
        street: Index of the street.
        starts: Whether the street starts at the junction.
        heading_rad: Heading away from the junction [rad].
        ahead_rad: Heading 15 m further on [rad].
        incoming: Ids of the lanes towards the junction, innermost first.
        outgoing: Ids of the lanes away from it, innermost first.
    """

    street: int
    starts: bool
    heading_rad: float
    ahead_rad: float
    incoming: tuple[int, ...] = ()
    outgoing: tuple[int, ...] = ()


TrimLengths = list[tuple[float, float]]
"""Length [m] by which each street is trimmed at its start and its end."""


def road_graph(network: Network) -> tuple[RoadGraph, TrimLengths]:
    """Return the lanes of a street network.

    Junctions are enlarged until no turn is too tight.

    Args:
        network: The street network.

    Returns:
        The road graph, without footpaths and kerbs, and the trimmed lengths of the streets.
    """
    size = np.ones(len(network.junctions))
    trims = _trim_lengths(network, size)
    graph = _graph(network, trims)
    for _ in range(3):
        tight = {
            lane.junction
            for lane in graph.lanes
            if lane.kind == "turn" and smallest_radius(lane.centre) < _SHARPEST_M
        }
        if not tight:
            break
        size[[junction for junction in tight if junction is not None]] *= 1.25
        trims = _trim_lengths(network, size)
        graph = _graph(network, trims)
    return graph, trims


def _graph(network: Network, trims: TrimLengths) -> RoadGraph:
    """Return the lanes of streets that are trimmed by `trims`."""
    builder = LaneGraphBuilder()
    lanes = [_street_lanes(builder, street, trims[number]) for number, street in enumerate(network.streets)]
    for junction in range(len(network.junctions)):
        arms = []
        for arm in _arms(network, junction):
            forward, backward = lanes[arm.street]
            ends = (backward, forward) if arm.starts else (forward, backward)
            arms.append(arm._replace(incoming=ends[0], outgoing=ends[1]))
        if junction in network.roundabouts:
            _add_roundabout(builder, network, junction, arms)
        elif len(arms) == 1:
            _add_dead_end(builder, network.streets[arms[0].street], junction, arms[0])
        else:
            _add_crossing(builder, network, junction, arms)
    return builder.graph(network.junctions)


def _trim_lengths(network: Network, size: NDArray[np.float64]) -> TrimLengths:
    """Return the trim lengths where junction j is `size[j]` times as large as necessary."""
    trims = [[0.0, 0.0] for _ in network.streets]
    for junction in range(len(network.junctions)):
        arms = _arms(network, junction)
        for arm, length in zip(arms, _trim_arms(network, junction, arms), strict=True):
            trims[arm.street][0 if arm.starts else 1] = float(length * size[junction])
    for street, ends in zip(network.streets, trims, strict=True):
        spare = street.length_m - 8.0
        if sum(ends) > spare:
            ends[:] = [end * spare / sum(ends) for end in ends]
    return [(first, last) for first, last in trims]


def _arms(network: Network, junction: int) -> list[Arm]:
    """Return the arms of a junction in counter-clockwise order."""
    arms = []
    for street, starts in network.arms(junction):
        line = network.streets[street].line
        away = headings((line if starts else line[::-1])[:18])
        arms.append(Arm(street, starts, float(away[0] % (2 * np.pi)), float(away[-3])))
    return sorted(arms, key=lambda arm: arm.heading_rad)


def _trim_arms(network: Network, junction: int, arms: list[Arm]) -> list[float]:
    """Return the trim length of each arm [m] that leaves space for its right turns.

    Outer lanes at lateral offsets o_i, o_j meet (o_j + o_i cos g) / sin g along arm i for an angle g between
    the arms; an arc of radius R needs R / tan(g/2) more.
    """
    if len(arms) == 1:
        return [_TURNAROUND_ROOM_M]
    types = [network.streets[arm.street].type for arm in arms]
    if junction in network.roundabouts:
        return [ROUNDABOUT_RADIUS_M + 17.0] * len(arms)
    outer = [kind.lane_edge_m - kind.lane_width_m / 2 for kind in types]
    cuts = [max(8.0, max(kind.half_width_m for kind in types) * 0.8 + 2.0)] * len(arms)
    for i in range(len(arms)):
        j = (i + 1) % len(arms)
        gap = min((arms[j].ahead_rad - arms[i].ahead_rad) % (2 * np.pi), _gap_rad(arms[i], arms[j]))
        if gap < np.deg2rad(160):
            gap = max(gap, _NARROWEST_RAD)
            tangent = _RIGHT_RADIUS_M / portable_math.tan(gap / 2)
            for near, far in ((i, j), (j, i)):
                corner = (outer[far] + outer[near] * np.cos(gap)) / np.sin(gap)
                cuts[near] = max(cuts[near], corner + tangent)
    return cuts


def _street_lanes(
    builder: LaneGraphBuilder, street: Street, trims: tuple[float, float]
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Add the lanes of a street and return those forward and those backward, innermost first."""
    kind = street.type
    line = resampled(section(street.line, trims[0], street.length_m - trims[1]), 0.5)
    forward, backward = [], []
    if kind.oneway:
        for number in range(kind.lanes):
            centre = offset(line, kind.lane_edge_m - (number + 0.5) * kind.lane_width_m)
            forward.append(
                builder.add(centre, "street", width_m=kind.lane_width_m, speed_mps=kind.speed_limit_mps)
            )
        return tuple(forward), ()
    for number in range(kind.lanes):
        aside = (number + 0.5) * kind.lane_width_m
        for centre, ids in ((offset(line, -aside), forward), (offset(line, aside)[::-1], backward)):
            ids.append(
                builder.add(centre, "street", width_m=kind.lane_width_m, speed_mps=kind.speed_limit_mps)
            )
        builder.pair_directions(forward[-1], backward[-1])
    return tuple(forward), tuple(backward)


def _add_dead_end(builder: LaneGraphBuilder, street: Street, junction: int, arm: Arm) -> None:
    """Connect the lanes of a dead end by turnarounds, the innermost by the smallest; no one-way street."""
    if street.type.oneway:
        return
    for before, after in zip(arm.incoming, arm.outgoing, strict=True):
        end, start = builder[before].centre[-1], builder[after].centre[0]
        outward = start - end
        heading = float(portable_math.arctan2(-outward[0], outward[1]))
        aside = float(np.linalg.norm(outward)) / 2
        line = transformed(
            turnaround(aside, max(TURNAROUND_RADIUS_M, aside + 3.0)), (start + end) / 2, heading
        )
        line[0], line[-1] = end, start
        lane = builder.add(line, "u_turn", width_m=street.type.lane_width_m, speed_mps=5.0, junction=junction)
        builder.join(before, lane)
        builder.join(lane, after)


def _add_crossing(builder: LaneGraphBuilder, network: Network, junction: int, arms: list[Arm]) -> None:
    """Add every movement between arms: left turns from the innermost lane, right turns from the outermost."""
    for arm in arms:
        bends = {
            i: _bend_rad(arm, other)
            for i, other in enumerate(arms)
            if other is not arm and other.outgoing and arm.incoming
        }
        if not bends:  # one-way: nothing comes from this arm, or nothing leads on
            continue
        straight = min(bends, key=lambda i: abs(bends[i]))
        for i, bend in bends.items():
            others = arms[i].outgoing
            if len(arms) == 2 or (i == straight and abs(bend) < np.deg2rad(40)):
                count = max(len(arm.incoming), len(others))
                pairs = {
                    (arm.incoming[min(n, len(arm.incoming) - 1)], others[min(n, len(others) - 1)])
                    for n in range(count)
                }
            else:
                lane = 0 if bend > 0 else -1
                pairs = {(arm.incoming[lane], others[lane])}
            for before, after in sorted(pairs):
                builder.connect(before, after, junction=junction)
        _connect_remaining(builder, arm, arms[straight], junction)
    _set_yields(builder, network, arms)


def _connect_remaining(builder: LaneGraphBuilder, arm: Arm, straight: Arm, junction: int) -> None:
    """Connect lanes without a successor to the street straight ahead."""
    for before in arm.incoming:
        if builder.is_unconnected(before):
            side = 0 if before == arm.incoming[0] else -1
            builder.connect(before, straight.outgoing[side], junction=junction)


def _gap_rad(arm: Arm, other: Arm) -> float:
    """Return the angle counter-clockwise from `arm` to `other` [rad]."""
    return (other.heading_rad - arm.heading_rad) % (2 * np.pi)


def _bend_rad(arm: Arm, other: Arm) -> float:
    """Return the change of heading from `arm` to `other` [rad], left positive."""
    return (other.heading_rad - arm.heading_rad) % (2 * np.pi) - np.pi


def _set_yields(builder: LaneGraphBuilder, network: Network, arms: list[Arm]) -> None:
    """Let all arms give way except the widest and straightest pair."""
    if len(arms) < 3:
        return
    pairs = [(i, j) for i in range(len(arms)) for j in range(i)]

    def rank(pair: tuple[int, int]) -> float:
        width = sum(network.streets[arms[i].street].type.half_width_m for i in pair)
        return width - 6.0 * abs(_bend_rad(arms[pair[0]], arms[pair[1]]))

    major = max(pairs, key=rank)
    for i, arm in enumerate(arms):
        if i not in major:
            for lane in arm.incoming:
                builder.set_yield(lane)


def _add_roundabout(builder: LaneGraphBuilder, network: Network, junction: int, arms: list[Arm]) -> None:
    """Add a counter-clockwise ring with an entry and an exit for every lane of every arm."""
    centre = network.junctions[junction]
    gaps = [_gap_rad(arm, arms[(i + 1) % len(arms)]) for i, arm in enumerate(arms)]
    half = min(0.55, min(gaps) / 2 - 0.12)
    angles = [arm.heading_rad + side for arm in arms for side in (-half, half)]
    angles.append(angles[0] + 2 * np.pi)
    ring = [
        builder.add(
            _ring_arc(centre, first, last), "roundabout", width_m=4.0, speed_mps=8.0, junction=junction
        )
        for first, last in itertools.pairwise(angles)
    ]
    for number, lane in enumerate(ring):
        builder.join(lane, ring[(number + 1) % len(ring)])
    for i, arm in enumerate(arms):
        for lane in arm.incoming:
            builder.connect(lane, ring[2 * i + 1], junction=junction)
            builder.set_yield(lane)
        for lane in arm.outgoing:
            builder.connect(ring[2 * i - 1], lane, junction=junction)


def _ring_arc(centre: Line, first_rad: float, last_rad: float) -> Line:
    """Return an arc of the roundabout between two angles (P, 2) [m]."""
    last_rad = first_rad + (last_rad - first_rad) % (2 * np.pi)
    angle = np.linspace(
        first_rad, last_rad, max(int(ROUNDABOUT_RADIUS_M * (last_rad - first_rad) / 0.15), 8) + 1
    )
    return centre + ROUNDABOUT_RADIUS_M * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
