"""The lanes of a street network: traffic keeps to the right, every movement at a junction is a smooth curve.

Streets are cut back where their junction begins; turning lanes, rings of roundabouts and U-turns at dead ends
join what is left with equal position, direction and (but for U-turns) curvature.
"""

import itertools
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.lane_graph import Lane, LaneKind, RoadGraph
from echoscape.scenes.geometry.curves import (
    Line,
    bulb,
    headings,
    offset,
    part,
    placed,
    resampled,
    smallest_radius,
    turn,
)
from echoscape.scenes.roads.street_network import Network, Street

RING_RADIUS_M = 16.0
BULB_RADIUS_M = 7.0
_BULB_ROOM_M = 15.0
_RIGHT_RADIUS_M = 10.0
_SHARPEST_M = 5.2
_LATERAL_MPS2 = 2.0


class LaneBook:
    """Collects lanes and their joins, then closes into a `RoadGraph`."""

    def __init__(self) -> None:
        self._lanes: list[Lane] = []
        self._next: list[list[int]] = []

    def add(
        self, centre: Line, kind: LaneKind, *, width_m: float, speed_mps: float, junction: int | None = None
    ) -> int:
        """Add a lane and return its id; its speed limit falls with its tightest bend."""
        limit = float(np.sqrt(_LATERAL_MPS2 * smallest_radius(centre)))
        speed = speed_mps if kind == "street" else float(np.clip(limit, 5.0, speed_mps))
        lane = Lane(
            id=len(self._lanes),
            kind=kind,
            centre=centre,
            width_m=width_m,
            speed_limit_mps=speed,
            successors=(),
            junction=junction,
        )
        self._lanes.append(lane)
        self._next.append([])
        return lane.id

    def __getitem__(self, lane: int) -> Lane:
        return self._lanes[lane]

    def is_idle(self, lane: int) -> bool:
        """Tell whether nothing follows `lane` yet."""
        return not self._next[lane]

    def join(self, before: int, after: int) -> None:
        """Let traffic go from the end of lane `before` to the start of lane `after`."""
        self._next[before].append(after)

    def connect(self, before: int, after: int, *, junction: int, kind: LaneKind = "turn") -> int:
        """Add a smooth lane from the end of `before` to the start of `after` and return its id."""
        first, second = self._lanes[before], self._lanes[after]
        lane = self.add(
            turn(first.centre, second.centre),
            kind,
            width_m=min(first.width_m, second.width_m),
            speed_mps=min(first.speed_limit_mps, second.speed_limit_mps),
            junction=junction,
        )
        self.join(before, lane)
        self.join(lane, after)
        return lane

    def oppose(self, first: int, second: int) -> None:
        """Say that two lanes are the two directions of one street."""
        self._lanes[first] = replace(self._lanes[first], opposite=second)
        self._lanes[second] = replace(self._lanes[second], opposite=first)

    def let_yield(self, lane: int) -> None:
        """Say that traffic gives way at the end of `lane`."""
        self._lanes[lane] = replace(self._lanes[lane], yields=True)

    def graph(self, junctions: Line) -> RoadGraph:
        """Return the finished graph."""
        lanes = tuple(
            replace(lane, successors=tuple(after))
            for lane, after in zip(self._lanes, self._next, strict=True)
        )
        return RoadGraph(lanes=lanes, junctions=np.asarray(junctions, dtype=np.float64))


class Arm(NamedTuple):
    """A street end at a junction: lanes run from the inmost; `heading_rad` leads away from the junction.

    `ahead_rad` is the heading 15 m further on.
    """

    street: int
    starts: bool
    heading_rad: float
    ahead_rad: float
    incoming: tuple[int, ...] = ()
    outgoing: tuple[int, ...] = ()


Room = list[tuple[float, float]]
"""How far [m] each street is cut back at its start and its end."""


def road_graph(network: Network) -> tuple[RoadGraph, Room]:
    """Return the lanes of a street network, without walks, and how far its streets are cut back.

    Junctions whose turns come out too sharp are made larger.
    """
    size = np.ones(len(network.junctions))
    room = _junction_room(network, size)
    graph = _graph(network, room)
    for _ in range(3):
        tight = {
            lane.junction
            for lane in graph.lanes
            if lane.kind == "turn" and smallest_radius(lane.centre) < _SHARPEST_M
        }
        if not tight:
            break
        size[[junction for junction in tight if junction is not None]] *= 1.25
        room = _junction_room(network, size)
        graph = _graph(network, room)
    return graph, room


def _graph(network: Network, room: Room) -> RoadGraph:
    """Return the lanes of streets that are cut back by `room`."""
    book = LaneBook()
    lanes = [_street_lanes(book, street, room[number]) for number, street in enumerate(network.streets)]
    for junction in range(len(network.junctions)):
        arms = []
        for arm in _arms(network, junction):
            forward, backward = lanes[arm.street]
            ends = (backward, forward) if arm.starts else (forward, backward)
            arms.append(arm._replace(incoming=ends[0], outgoing=ends[1]))
        if junction in network.roundabouts:
            _add_roundabout(book, network, junction, arms)
        elif len(arms) == 1:
            _add_dead_end(book, network.streets[arms[0].street], junction, arms[0])
        else:
            _add_crossing(book, network, junction, arms)
    return book.graph(network.junctions)


def _junction_room(network: Network, size: NDArray[np.float64]) -> Room:
    """Return how far streets are cut back where junction j is `size[j]` times as large as it need be."""
    room = [[0.0, 0.0] for _ in network.streets]
    for junction in range(len(network.junctions)):
        arms = _arms(network, junction)
        for arm, length in zip(arms, _cuts(network, junction, arms), strict=True):
            room[arm.street][0 if arm.starts else 1] = float(length * size[junction])
    for street, ends in zip(network.streets, room, strict=True):
        spare = street.length_m - 8.0
        if sum(ends) > spare:
            ends[:] = [end * spare / sum(ends) for end in ends]
    return [(first, last) for first, last in room]


def _arms(network: Network, junction: int) -> list[Arm]:
    """Return the arms of a junction in counter-clockwise order."""
    arms = []
    for street, starts in network.arms(junction):
        line = network.streets[street].line
        away = headings((line if starts else line[::-1])[:18])
        arms.append(Arm(street, starts, float(away[0] % (2 * np.pi)), float(away[-3])))
    return sorted(arms, key=lambda arm: arm.heading_rad)


def _cuts(network: Network, junction: int, arms: list[Arm]) -> list[float]:
    """Return how far each arm is cut back, so that its right turns have room.

    Two outer lanes meet (o_j + o_i cos g) / sin g along arm i for a gap g; an arc of radius R needs
    R / tan(g/2) beyond.
    """
    if len(arms) == 1:
        return [_BULB_ROOM_M]
    types = [network.streets[arm.street].type for arm in arms]
    if junction in network.roundabouts:
        return [RING_RADIUS_M + 17.0] * len(arms)
    outer = [kind.lane_edge_m - kind.lane_width_m / 2 for kind in types]
    cuts = [max(8.0, max(kind.half_width_m for kind in types) * 0.8 + 2.0)] * len(arms)
    for i in range(len(arms)):
        j = (i + 1) % len(arms)
        gap = min((arms[j].ahead_rad - arms[i].ahead_rad) % (2 * np.pi), _gap_rad(arms[i], arms[j]))
        if gap < np.deg2rad(160):
            tangent = _RIGHT_RADIUS_M / np.tan(gap / 2)
            for near, far in ((i, j), (j, i)):
                corner = (outer[far] + outer[near] * np.cos(gap)) / np.sin(gap)
                cuts[near] = max(cuts[near], corner + tangent)
    return cuts


def _street_lanes(
    book: LaneBook, street: Street, room: tuple[float, float]
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Add the lanes of a street, the inmost first, and return those forward and those backward."""
    kind = street.type
    line = resampled(part(street.line, room[0], street.length_m - room[1]), 0.5)
    forward, backward = [], []
    for number in range(kind.lanes):
        aside = (number + 0.5) * kind.lane_width_m
        for centre, ids in ((offset(line, -aside), forward), (offset(line, aside)[::-1], backward)):
            ids.append(book.add(centre, "street", width_m=kind.lane_width_m, speed_mps=kind.speed_limit_mps))
        book.oppose(forward[-1], backward[-1])
    return tuple(forward), tuple(backward)


def _add_dead_end(book: LaneBook, street: Street, junction: int, arm: Arm) -> None:
    """Join the inmost lanes of a dead end by a U-turn about its tip, and so the outer ones about them."""
    for before, after in zip(arm.incoming, arm.outgoing, strict=True):
        end, start = book[before].centre[-1], book[after].centre[0]
        outward = start - end
        heading = float(np.arctan2(-outward[0], outward[1]))
        aside = float(np.linalg.norm(outward)) / 2
        line = placed(bulb(aside, max(BULB_RADIUS_M, aside + 3.0)), (start + end) / 2, heading)
        line[0], line[-1] = end, start
        lane = book.add(line, "u_turn", width_m=street.type.lane_width_m, speed_mps=5.0, junction=junction)
        book.join(before, lane)
        book.join(lane, after)


def _add_crossing(book: LaneBook, network: Network, junction: int, arms: list[Arm]) -> None:
    """Add every movement from arm to arm: left from the inmost lane, right from the outermost."""
    for arm in arms:
        bends = {i: _bend_rad(arm, other) for i, other in enumerate(arms) if other is not arm}
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
                book.connect(before, after, junction=junction)
        _serve_idle(book, arm, arms[straight], junction)
    _set_yields(book, network, arms)


def _serve_idle(book: LaneBook, arm: Arm, straight: Arm, junction: int) -> None:
    """Give lanes that no movement took a way on, so that nobody is stranded."""
    for before in arm.incoming:
        if book.is_idle(before):
            side = 0 if before == arm.incoming[0] else -1
            book.connect(before, straight.outgoing[side], junction=junction)


def _gap_rad(arm: Arm, other: Arm) -> float:
    """Return the angle from `arm` counter-clockwise to `other`."""
    return (other.heading_rad - arm.heading_rad) % (2 * np.pi)


def _bend_rad(arm: Arm, other: Arm) -> float:
    """Return the change of heading from coming along `arm` to leaving along `other`, left positive."""
    return (other.heading_rad - arm.heading_rad) % (2 * np.pi) - np.pi


def _set_yields(book: LaneBook, network: Network, arms: list[Arm]) -> None:
    """Let the arms give way that are not of the widest and straightest pair."""
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
                book.let_yield(lane)


def _add_roundabout(book: LaneBook, network: Network, junction: int, arms: list[Arm]) -> None:
    """Add a ring driven counter-clockwise, with an entry and an exit for every lane of every arm."""
    centre = network.junctions[junction]
    gaps = [_gap_rad(arm, arms[(i + 1) % len(arms)]) for i, arm in enumerate(arms)]
    half = min(0.55, min(gaps) / 2 - 0.12)
    angles = [arm.heading_rad + side for arm in arms for side in (-half, half)]
    angles.append(angles[0] + 2 * np.pi)
    ring = [
        book.add(_ring_arc(centre, first, last), "roundabout", width_m=4.0, speed_mps=8.0, junction=junction)
        for first, last in itertools.pairwise(angles)
    ]
    for number, lane in enumerate(ring):
        book.join(lane, ring[(number + 1) % len(ring)])
    for i, arm in enumerate(arms):
        for lane in arm.incoming:
            book.connect(lane, ring[2 * i + 1], junction=junction)
            book.let_yield(lane)
        for lane in arm.outgoing:
            book.connect(ring[2 * i - 1], lane, junction=junction)


def _ring_arc(centre: Line, first_rad: float, last_rad: float) -> Line:
    last_rad = first_rad + (last_rad - first_rad) % (2 * np.pi)
    angle = np.linspace(first_rad, last_rad, max(int(RING_RADIUS_M * (last_rad - first_rad) / 0.15), 8) + 1)
    return centre + RING_RADIUS_M * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
