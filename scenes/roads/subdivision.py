"""Lays out a street network by subdivision: blocks are split across their longer side until they are small.

Compare Parish & Muller, SIGGRAPH 2001, and the block subdivision of Vanegas et al., Eurographics 2012. Blocks
are convex polygons on a chart. A new street keeps its distance from other junctions or runs into one of them;
angles between streets are checked in the world. Dead ends and roundabouts follow. Around the outer ring the
same rules lay out streets that are not driven, so that a drive along the ring sees a town on either side.
"""

import itertools
from dataclasses import dataclass, replace

import numpy as np

from echoscape.scenes.core import portable_math
from echoscape.scenes.geometry.curves import Line
from echoscape.scenes.roads.chart import Chart, chart_street
from echoscape.scenes.roads.street_network import (
    AVENUE,
    NARROW,
    PLAIN,
    STREET,
    Network,
    OuterStreet,
    Street,
    StreetType,
)

SMALLEST_ANGLE_RAD = np.deg2rad(56.0)
_LATE_DEPTH = 3
"""Number of splits after which the type of a street is drawn."""


@dataclass(frozen=True, kw_only=True)
class SubdivisionSettings:
    """Settings of a subdivided street network.

    Attributes:
        half_size_m: Half the size of the network in x and y [m].
        outskirts_m: Width of the streets around it that are not driven [m], 0 for none.
        block_m2: Typical area below which blocks are not split [m^2].
        swirl_rad: Swirl of the chart [rad], see `Chart`.
        shear: Shear of the chart.
        wave_m: Wavelength of the chart's shear waves [m].
        bow: Greatest sideways bow of a street as a share of its length.
        spur_share: Share of blocks with a dead-end street.
        removed_share: Share of streets that are removed again, as far as enough others meet at their ends.
        roundabouts: Number of roundabouts.
        types: Street types: of the outer ring, of the first splits, and those drawn for all later ones.
        min_length_m: Least distance between junctions [m].
    """

    half_size_m: tuple[float, float] = (590.0, 560.0)
    outskirts_m: float = 270.0
    block_m2: float = 15500.0
    swirl_rad: float = 0.6
    shear: float = 0.35
    wave_m: float = 600.0
    bow: float = 0.03
    spur_share: float = 0.15
    removed_share: float = 0.10
    roundabouts: int = 2
    types: tuple[StreetType, ...] = (AVENUE, STREET, STREET, PLAIN, NARROW)
    min_length_m: float = 52.0


def subdivided_network(settings: SubdivisionSettings, *, rng: np.random.Generator) -> Network:
    """Lay out an irregular street network about the origin.

    Args:
        settings: Settings of the network.
        rng: Random generator.

    Returns:
        The network.
    """
    chart = Chart(
        half_size_m=settings.half_size_m,
        swirl_rad=settings.swirl_rad,
        shear=settings.shear,
        wave_m=settings.wave_m,
        rng=rng,
    )
    plan = _StreetPlan(settings, chart)
    _split_all(plan, settings, rng)
    _remove_some(plan, settings, rng)
    _add_spurs(plan, settings, rng)
    network = _network(plan, settings, rng)
    return replace(network, outskirts=_outskirts(plan, settings, rng) if settings.outskirts_m else ())


@dataclass(frozen=True)
class _Crossing:
    """Where a new street meets the boundary of a block: at corner `node`, or at `place` on an edge."""

    place: Line
    node: int | None
    edge: tuple[int, int]


class _StreetPlan:
    """Nodes, edges with the index of their street, and the boundaries of the blocks, on the chart.

    `depths` holds for each street the number of splits before it; street 0 is the outer ring.
    """

    def __init__(self, settings: SubdivisionSettings, chart: Chart) -> None:
        self.chart = chart
        self.settings = settings
        self.nodes: list[Line] = list(_outline(settings.half_size_m))
        count = len(self.nodes)
        self.edges: dict[tuple[int, int], int] = {_key(i, (i + 1) % count): 0 for i in range(count)}
        self.depths: list[int] = [1]
        self.faces: list[list[int]] = [list(range(count))]

    def world(self, first: Line, second: Line) -> Line:
        """Return a coarse line (9, 2) [m] of the street between two chart points."""
        return self.chart(first + np.linspace(0, 1, 9)[:, None] * (second - first))

    def length_m(self, first: Line, second: Line) -> float:
        """Return the length in the world of the street between two chart points [m]."""
        return float(np.hypot(*np.diff(self.world(first, second), axis=0).T).sum())

    def heading(self, node: Line, other: Line) -> float:
        """Return the heading in the world at `node` of the street from `node` to `other` [rad]."""
        near = node + (other - node) * min(2.0 / float(np.linalg.norm(other - node)), 1.0)
        first, second = self.chart(np.stack([node, near]))
        x, y = second - first
        return float(portable_math.arctan2(y, x))

    def neighbours(self, node: int) -> list[int]:
        """Return the nodes connected to `node`."""
        return [b if a == node else a for a, b in self.edges if node in (a, b)]

    def fits(self, node: int, toward: Line, *, smallest_rad: float = SMALLEST_ANGLE_RAD) -> bool:
        """Return whether a street from `node` to `toward` keeps enough angle to the streets at that node."""
        heading = self.heading(self.nodes[node], toward)
        others = [self.heading(self.nodes[node], self.nodes[n]) for n in self.neighbours(node)]
        return len(others) < 4 and all(_apart(heading, other) > smallest_rad for other in others)

    def insert(self, edge: tuple[int, int], place: Line) -> int:
        """Put a node at `place` on `edge` and return its index."""
        node = len(self.nodes)
        self.nodes.append(place)
        street = self.edges.pop(_key(*edge))
        self.edges[_key(edge[0], node)] = self.edges[_key(edge[1], node)] = street
        for face in self.faces:
            for i, corner in enumerate(face):
                if {corner, face[(i + 1) % len(face)]} == set(edge):
                    face.insert(i + 1, node)
                    break
        return node


def _key(first: int, second: int) -> tuple[int, int]:
    """Return the key of an edge: its nodes in ascending order."""
    return min(first, second), max(first, second)


def _apart(first: float, second: float) -> float:
    """Return the absolute difference of two angles [rad]."""
    return abs((first - second + np.pi) % (2 * np.pi) - np.pi)


def _outline(half_size_m: tuple[float, float]) -> Line:
    """Return the corners of a ring (10, 2) [m], a superellipse."""
    angle = np.linspace(0, 2 * np.pi, 10, endpoint=False) + 0.2
    cos, sin = np.cos(angle), np.sin(angle)
    cubes = np.abs(cos) ** 2 * np.abs(cos) + np.abs(sin) ** 2 * np.abs(sin)
    radius = portable_math.power(cubes, -1 / 3.0)
    return np.stack([cos, sin], axis=-1) * radius[:, None] * half_size_m


def _area(points: Line) -> float:
    """Return the signed area of a polygon [m^2]."""
    x, y = points.T
    return float(0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def _split_all(
    plan: _StreetPlan, settings: SubdivisionSettings, rng: np.random.Generator, *, depth: int = 0
) -> None:
    """Split all blocks, the results of `depth` splits, until they are small."""
    waiting = [(face, depth) for face in plan.faces]
    while waiting:
        face, depth = waiting.pop(0)
        points = np.array([plan.nodes[n] for n in face])
        if _area(points) < settings.block_m2 * rng.uniform(0.7, 2.6):
            continue
        for attempt in range(60):
            halves = _split(plan, face, depth, attempt, rng)
            if halves is not None:
                waiting += [(half, depth + 1) for half in halves]
                break


def _split(
    plan: _StreetPlan, face: list[int], depth: int, attempt: int, rng: np.random.Generator
) -> list[list[int]] | None:
    """Split a block by a street; None where the street would come too near to another.

    Later attempts deviate more from the middle and from the perpendicular.
    """
    points = np.array([plan.nodes[n] for n in face])
    centre = points.mean(axis=0)
    _, axes = np.linalg.eigh(np.cov((points - centre).T))
    long, across = (axes[:, 1], axes[:, 0]) if attempt % 4 < 3 else (axes[:, 0], axes[:, 1])
    spread = 0.15 * min(attempt / 30, 1.0)
    reach = (points - centre) @ long
    through = centre + long * (reach.min() + rng.uniform(0.36 - spread, 0.64 + spread) * np.ptp(reach))
    angle = rng.normal(0.0, 0.16 + 2 * spread)
    direction = across * np.cos(angle) + long * np.sin(angle)
    crossings = _crossings(plan, face, through, direction)
    if len(crossings) != 2:
        return None
    ends = [plan.nodes[h.node] if h.node is not None else h.place for h in crossings]
    if plan.length_m(ends[0], ends[1]) < plan.settings.min_length_m or not _acceptable(plan, crossings, ends):
        return None
    first, second = (h.node if h.node is not None else plan.insert(h.edge, h.place) for h in crossings)
    i, j = sorted((face.index(first), face.index(second)))
    halves = [face[i : j + 1], face[j:] + face[: i + 1]]
    plan.faces.remove(face)
    plan.faces += halves
    plan.edges[_key(first, second)] = len(plan.depths)
    plan.depths.append(depth)
    return halves


def _crossings(plan: _StreetPlan, face: list[int], through: Line, direction: Line) -> list[_Crossing]:
    """Return where a line crosses the boundary of a block; a crossing near a corner is moved to it."""
    crossings: list[_Crossing] = []
    for a, b in zip(face, face[1:] + face[:1], strict=True):
        first, second = plan.nodes[a], plan.nodes[b]
        matrix = np.stack([second - first, -direction], axis=-1)
        if abs(np.linalg.det(matrix)) < 1e-6:
            continue
        share = float(np.linalg.solve(matrix, through - first)[0])
        if not 0.0 <= share < 1.0:
            continue
        place = first + share * (second - first)
        near = [n for n in (a, b) if plan.length_m(plan.nodes[n], place) < plan.settings.min_length_m]
        node = min(near, key=lambda n: float(np.linalg.norm(plan.nodes[n] - place))) if near else None
        crossings.append(_Crossing(place, node, (a, b)))
    return crossings


def _acceptable(plan: _StreetPlan, crossings: list[_Crossing], ends: list[Line]) -> bool:
    """Return whether a street between two crossings keeps enough angle to the others."""
    corners = [hit.node for hit in crossings if hit.node is not None]
    if len(corners) == 2 and (corners[0] == corners[1] or _key(*corners) in plan.edges):
        return False
    for i, hit in enumerate(crossings):
        toward = ends[-1 - i]
        if hit.node is not None:
            if not plan.fits(hit.node, toward):
                return False
        else:
            heading = plan.heading(hit.place, toward)
            rim = [plan.heading(hit.place, plan.nodes[n]) for n in hit.edge]
            if any(_apart(heading, other) < SMALLEST_ANGLE_RAD for other in rim):
                return False
    return True


def _remove_some(plan: _StreetPlan, settings: SubdivisionSettings, rng: np.random.Generator) -> None:
    """Remove streets of late splits at whose ends at least three others meet."""
    keys = sorted(plan.edges)
    late = max(plan.depths) // 2
    for index in rng.permutation(len(keys))[: int(settings.removed_share * 2 * len(keys))]:
        edge = keys[index]
        busy = all(len(plan.neighbours(n)) >= 4 for n in edge)
        if busy and plan.depths[plan.edges[edge]] > late:
            del plan.edges[edge]


def _add_spurs(plan: _StreetPlan, settings: SubdivisionSettings, rng: np.random.Generator) -> None:
    """Add dead-end streets from a long side of some blocks to their middle."""
    for face in list(plan.faces):
        if rng.random() >= settings.spur_share:
            continue
        points = np.array([plan.nodes[n] for n in face])
        sides = [(a, b) for a, b in zip(face, face[1:] + face[:1], strict=True) if _key(a, b) in plan.edges]
        if not sides or _area(points) < 6000:
            continue
        side = max(sides, key=lambda s: plan.length_m(plan.nodes[s[0]], plan.nodes[s[1]]))
        first, second = (plan.nodes[n] for n in side)
        foot = first + rng.uniform(0.45, 0.55) * (second - first)
        tip = points.mean(axis=0)
        if _spur_fits(plan, foot, side, tip):
            node = plan.insert(side, foot)
            plan.nodes.append(tip)
            plan.edges[_key(node, len(plan.nodes) - 1)] = len(plan.depths)
            plan.depths.append(99)


def _spur_fits(plan: _StreetPlan, foot: Line, side: tuple[int, int], tip: Line) -> bool:
    """Return whether a dead-end street has enough space, length and angle."""
    room = min(plan.length_m(foot, plan.nodes[n]) for n in side)
    length = plan.length_m(foot, tip)
    square = _acceptable(plan, [_Crossing(foot, None, side)], [foot, tip]) if room > 0 else False
    return room > plan.settings.min_length_m and 50.0 < length < 170.0 and square


def _network(plan: _StreetPlan, settings: SubdivisionSettings, rng: np.random.Generator) -> Network:
    """Return the network of a finished plan."""
    used = sorted({n for edge in plan.edges for n in edge})
    number = {node: i for i, node in enumerate(used)}
    types = [_type(depth, settings, rng) for depth in plan.depths]
    streets = []
    for (a, b), street in sorted(plan.edges.items()):
        dead = len(plan.neighbours(b)) == 1 or len(plan.neighbours(a)) == 1
        bow = 0.0 if dead else float(rng.uniform(-1, 1)) * settings.bow
        bow *= street != 0  # streets of the outskirts meet the ring anywhere on its straight line
        line = chart_street(plan.chart, plan.nodes[a], plan.nodes[b], bow=bow)
        streets.append(Street(start=number[a], end=number[b], line=line, type=types[street]))
    junctions = plan.chart(np.array([plan.nodes[n] for n in used]))
    network = Network(junctions=junctions, streets=tuple(streets))
    return Network(
        junctions=junctions, streets=network.streets, roundabouts=_roundabouts(network, settings.roundabouts)
    )


def _outskirts(
    plan: _StreetPlan, settings: SubdivisionSettings, rng: np.random.Generator
) -> tuple[OuterStreet, ...]:
    """Add blocks around the outer ring, split them, and return their streets."""
    driven = len(plan.depths)
    plan.faces = _outer_blocks(plan, settings)
    _split_all(plan, settings, rng, depth=_LATE_DEPTH)
    types = [_type(_LATE_DEPTH, settings, rng) for _ in plan.depths]
    streets = []
    for (a, b), street in sorted(plan.edges.items()):
        if street >= driven:
            bow = float(rng.uniform(-1, 1)) * settings.bow
            line = chart_street(plan.chart, plan.nodes[a], plan.nodes[b], bow=bow)
            streets.append(OuterStreet(line=line, type=types[street]))
    return tuple(streets)


def _outer_blocks(plan: _StreetPlan, settings: SubdivisionSettings) -> list[list[int]]:
    """Add a second ring, and a street from each corner of the first one to it; return the blocks between."""
    inner = _ring(plan)
    x, y = settings.half_size_m
    corners = _outline((x + settings.outskirts_m, y + settings.outskirts_m))
    first = len(plan.nodes)
    plan.nodes += list(corners)
    count = len(corners)
    pairs = [(first + i, first + (i + 1) % count) for i in range(count)]
    for edge in [*pairs, *((i, first + i) for i in range(count))]:
        plan.edges[_key(*edge)] = len(plan.depths)
        plan.depths.append(_LATE_DEPTH)
    at = [*(inner.index(i) for i in range(count)), len(inner)]
    sides = [[*inner, inner[0]][a : b + 1] for a, b in itertools.pairwise(at)]
    return [[*pair, *side[::-1]] for pair, side in zip(pairs, sides, strict=True)]


def _ring(plan: _StreetPlan) -> list[int]:
    """Return the nodes of the outer ring, counter-clockwise from node 0."""
    links: dict[int, list[int]] = {}
    for (a, b), street in plan.edges.items():
        if street == 0:
            links.setdefault(a, []).append(b)
            links.setdefault(b, []).append(a)
    x, y = plan.nodes[0]
    ring = [0, max(links[0], key=lambda n: float(x * plan.nodes[n][1] - y * plan.nodes[n][0]))]
    while ring[-1] != 0:
        ring.append(next(n for n in links[ring[-1]] if n != ring[-2]))
    return ring[:-1]


def _type(depth: int, settings: SubdivisionSettings, rng: np.random.Generator) -> StreetType:
    """Return the type of a street that was added at `depth`; the first ones are the widest."""
    if depth == 0:
        return settings.types[0]
    if depth <= 2:
        return settings.types[1]
    return settings.types[2:][int(rng.integers(len(settings.types) - 2))]


def _roundabouts(network: Network, count: int) -> frozenset[int]:
    """Choose the junctions best suited for roundabouts, at least 250 m apart."""
    chosen: list[int] = []
    rated = sorted(((_roominess(network, j), j) for j in range(len(network.junctions))), reverse=True)
    for _, junction in rated:
        place = network.junctions[junction]
        if all(np.linalg.norm(place - network.junctions[c]) > 250.0 for c in chosen) and len(chosen) < count:
            chosen.append(junction)
    return frozenset(chosen)


def _roominess(network: Network, junction: int) -> float:
    """Rate a junction as a roundabout: many arms, wide angles, long streets, near the middle."""
    arms = network.arms(junction)
    if len(arms) < 3:
        return -1e6
    lines = [network.streets[s].line if starts else network.streets[s].line[::-1] for s, starts in arms]
    headings = sorted(float(portable_math.arctan2(*(line[2] - line[0])[::-1])) for line in lines)
    gap = min((b - a) % (2 * np.pi) for a, b in zip(headings, headings[1:] + headings[:1], strict=True))
    shortest = min(network.streets[s].length_m for s, _ in arms)
    wide = sum(network.streets[s].type.lanes > 1 for s, _ in arms)
    room = min(shortest - 85.0, 0.0) * 0.2 + min(gap - np.deg2rad(72), 0.0) * 20
    return room + 2.0 * len(arms) - 4.0 * wide - float(np.linalg.norm(network.junctions[junction])) / 300.0
