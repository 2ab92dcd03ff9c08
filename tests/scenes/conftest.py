"""Small hand-made road graphs and towns for tests of traffic."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from echoscape.scenes.core.lane_graph import Lane, LaneKind, RoadGraph
from echoscape.scenes.core.scene import Mesh, Placements, Prototype, Scene
from echoscape.scenes.town.build import road_network
from echoscape.scenes.town.presets import PRESETS

HALF_LANE_M = 1.75
CORNER_M = 9.0
SIZES_M = {
    "car": (4.4, 1.8, 1.5),
    "van": (5.5, 2.0, 2.2),
    "truck": (8.5, 2.5, 3.4),
    "bus": (11.5, 2.55, 3.1),
    "cyclist": (1.8, 0.6, 1.8),
    "pedestrian": (0.5, 0.6, 1.75),
}


def _bezier(
    start: NDArray[np.float64], out: NDArray[np.float64], end: NDArray[np.float64], into: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return a cubic (P, 2) from `start` along `out` to `end` along `into`, samples at most 0.5 m apart."""
    reach = 0.55 * np.linalg.norm(end - start) if out @ into > -0.5 else 7.0
    share = np.linspace(0, 1, 60)[:, None]
    points = [start, start + reach * out, end - reach * into, end]
    weights = [
        factor * (1 - share) ** (3 - power) * share**power for power, factor in enumerate((1, 3, 3, 1))
    ]
    return np.sum([weight * point for weight, point in zip(weights, points, strict=True)], axis=0)


def _block_town(size: int = 3, spacing_m: float = 90.0, limit_mps: float = 13.4) -> RoadGraph:
    """Return a square grid of `size` x `size` junctions: all turns, and U-turns at the grid's corners."""
    junctions = spacing_m * np.stack(np.meshgrid(np.arange(size), np.arange(size)), -1).reshape(-1, 2)
    steps = [np.array(step) for step in ((1, 0), (0, 1), (-1, 0), (0, -1))]
    streets: list[tuple[int, int, NDArray[np.float64], NDArray[np.float64]]] = []
    for a, here in enumerate(junctions):
        for step in steps:
            grid = here / spacing_m + step
            if (grid >= 0).all() and (grid < size).all():
                b = int(grid[1] * size + grid[0])
                right = HALF_LANE_M * np.array([step[1], -step[0]])
                along = np.linspace(CORNER_M, spacing_m - CORNER_M, int(spacing_m))[:, None]
                streets.append((a, b, step.astype(float), here + right + along * step))
    return _joined(junctions.astype(float), streets, limit_mps)


def _straight_road(length_m: float = 400.0, limit_mps: float = 13.4) -> RoadGraph:
    """Return one straight two-way street with a U-turn at each end."""
    ends = np.array([[0.0, 0.0], [length_m, 0.0]])
    along = np.linspace(CORNER_M, length_m - CORNER_M, int(length_m))
    there = np.stack([along, np.full_like(along, -HALF_LANE_M)], -1)
    back = np.stack([along[::-1], np.full_like(along, HALF_LANE_M)], -1)
    east = np.array([1.0, 0.0])
    return _joined(ends, [(0, 1, east, there), (1, 0, -east, back)], limit_mps)


def _joined(
    junctions: NDArray[np.float64],
    streets: list[tuple[int, int, NDArray[np.float64], NDArray[np.float64]]],
    limit_mps: float,
) -> RoadGraph:
    rows: list[tuple[LaneKind, NDArray[np.float64], list[int], int | None, int | None]] = []
    for a, b, _, centre in streets:
        opposite = next(i for i, other in enumerate(streets) if other[:2] == (b, a))
        rows.append(("street", centre, [], opposite, None))
    for i, (a, b, into, centre) in enumerate(streets):
        arms = sum(other[0] == b for other in streets)
        for j, (c, d, out, next_centre) in enumerate(streets):
            if c != b or (d == a and arms > 2):
                continue
            kind: LaneKind = "u_turn" if d == a else "turn"
            rows[i][2].append(len(rows))
            rows.append((kind, _bezier(centre[-1], into, next_centre[0], out), [j], None, b))
    lanes = tuple(
        Lane(
            id=i,
            kind=kind,
            centre=centre,
            width_m=2 * HALF_LANE_M,
            speed_limit_mps=limit_mps,
            successors=tuple(after),
            opposite=opposite,
            junction=junction,
            yields=kind == "street" and i % 3 == 0,
        )
        for i, (kind, centre, after, opposite, junction) in enumerate(rows)
    )
    footpaths = tuple(
        np.asarray(centre + 4.5 * np.array([into[1], -into[0]])) for _, _, into, centre in streets
    )
    return RoadGraph(lanes=lanes, junctions=junctions, footpaths=footpaths)


def _bare_town(roads: RoadGraph) -> Scene:
    """Return a town with nothing but roads."""
    corners = np.concatenate([lane.centre for lane in roads.lanes])
    nothing = np.zeros(0, np.uint32)
    low, high = corners.min(axis=0) - 30, corners.max(axis=0) + 30
    return Scene(
        preset="test",
        seed=0,
        static={},
        prototypes=(),
        placements=Placements(
            prototype=nothing, instance=nothing, position=np.zeros((0, 3)), yaw=np.zeros(0), scale=np.zeros(0)
        ),
        instance_class=np.zeros(7, np.uint8),
        roads=roads,
        bounds_m=(float(low[0]), float(low[1]), float(high[0]), float(high[1])),
    )


def _boxes() -> tuple[Prototype, ...]:
    """Return one prototype of each class of mover, without a shape."""
    empty = Mesh(vertices=np.zeros((0, 3), np.float32), faces=np.zeros((0, 3), np.uint32))
    return tuple(
        Prototype(name=name, class_name=name, parts={"metal": empty}, extent_m=size)
        for name, size in SIZES_M.items()
    )


@pytest.fixture(scope="session")
def blocks() -> RoadGraph:
    """Five by five junctions, 90 m apart."""
    return _block_town(5)


@pytest.fixture(scope="session")
def straight() -> RoadGraph:
    """One street, a U-turn at either end."""
    return _straight_road()


@pytest.fixture(scope="session")
def town_roads() -> RoadGraph:
    """The lanes of the default town, without footpaths."""
    return road_network(PRESETS["town"], seed=1)[1]


@pytest.fixture(scope="session")
def bare_town() -> Callable[[RoadGraph], Scene]:
    """Makes a town with nothing but roads."""
    return _bare_town


@pytest.fixture(scope="session")
def boxes() -> tuple[Prototype, ...]:
    """One prototype of each class of mover, without a shape."""
    return _boxes()
