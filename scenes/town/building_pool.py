"""Ready-made buildings and garden boundaries: to design every building of a town anew would take too long.

Along the driven streets one of some dozen designs of its kind is fitted to the footprint and height of each
building. Beyond them, a few rigid buildings stand many times. Both follow the rules of the preset's parcels;
rigid ones of a row share depth and height, so that their fronts and roofs are flush.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.assets.buildings.building import building
from echoscape.scenes.assets.vegetation import hedge
from echoscape.scenes.assets.walls_fences import fence, wall
from echoscape.scenes.core import portable_math
from echoscape.scenes.core.scene import Mesh, Prototype
from echoscape.scenes.geometry.meshes import prototype
from echoscape.scenes.town.presets import PARCEL_RULES, ParcelRule, Preset

BOUNDARY_M = 5.0
"""Length of a ready-made piece of a boundary [m]."""
_ROWS, _PER_ROW = 3, 4
_DESIGNS = 48
_ALIKE = 5
"""Number of designs nearest in size of which one is drawn."""
_FRONT_M, _BACK_M = 1.1, 1.7


@dataclass(frozen=True, kw_only=True)
class ReadyBuilding:
    """A building of the pool, in a frame with x along its front and y away from it.

    Attributes:
        name: Name of its prototype.
        width_m: Width of its footprint [m].
        depth_m: Depth of its footprint [m].
        middle_m: Place of the prototype's origin relative to the middle of the front (2,) [m].
    """

    name: str
    width_m: float
    depth_m: float
    middle_m: tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Designs:
    """Designs of one kind of building, on footprints from (0, 0) to (width, depth).

    Attributes:
        size_m: Width, depth and height of the walls of each (N, 3) [m].
        parts: Meshes of each by name of the material.
    """

    size_m: NDArray[np.float64]
    parts: tuple[dict[str, Mesh], ...]

    def fitted(
        self, footprint: NDArray[np.float64], *, height_m: float, rng: np.random.Generator
    ) -> dict[str, Mesh]:
        """Draw a design of similar size and fit it to a footprint, bilinearly, and to a height.

        Args:
            footprint: Corners (4, 2) counter-clockwise from the left end of the front [m].
            height_m: Height of the walls [m].
            rng: Random generator.

        Returns:
            Meshes in the world by name of the material.
        """
        width, depth = np.hypot(*(footprint[1] - footprint[0])), np.hypot(*(footprint[2] - footprint[1]))
        misfit = np.abs(portable_math.log(self.size_m / [width, depth, height_m])).sum(axis=1)
        drawn = int(np.argsort(misfit, kind="stable")[rng.integers(min(_ALIKE, len(misfit)))])
        return {
            material: Mesh(
                vertices=_onto(part.vertices / self.size_m[drawn] * [1.0, 1.0, height_m], footprint),
                faces=part.faces,
            )
            for material, part in self.parts[drawn].items()
        }


def _onto(points: NDArray[np.float64], footprint: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return points (V, 3) whose x and y are shares of a footprint's width and depth in the world."""
    first, second, third, fourth = footprint
    x, y = points[:, :1], points[:, 1:2]
    flat = first + x * (second - first) + y * (fourth - first) + x * y * (first - second + third - fourth)
    return np.concatenate([flat, points[:, 2:]], axis=1).astype(np.float32)


@dataclass(frozen=True, kw_only=True)
class BuildingPool:
    """Buildings and boundaries of a preset.

    Attributes:
        designs: Designs of each kind, see `PARCEL_RULES`.
        rows: Buildings that can stand side by side, by kind.
        boundaries: Names of pieces of boundaries by kind and by "front" or "back" gardens.
        prototypes: Shapes of all of them.
    """

    designs: dict[str, Designs]
    rows: dict[str, list[list[ReadyBuilding]]]
    boundaries: dict[tuple[str, str], list[str]]
    prototypes: tuple[Prototype, ...]


def building_pool(preset: Preset, *, seeds: np.random.SeedSequence) -> BuildingPool:
    """Make the buildings and boundaries that a preset needs.

    Args:
        preset: The preset.
        seeds: Seeds of this stage.

    Returns:
        The pool.
    """
    rng = np.random.default_rng(seeds)
    kinds = [use for use, _ in preset.uses if use in PARCEL_RULES]
    shapes: list[Prototype] = []
    rows = {
        kind: [_row(f"{kind}_{row}", PARCEL_RULES[kind], shapes, rng) for row in range(_ROWS)]
        for kind in kinds
    }
    boundaries = _boundaries(shapes, rng) if kinds else {}
    front = [*kinds, *(["shops"] if {"terrace", "flats"} & set(kinds) and "shops" not in kinds else [])]
    designs = {kind: _designs(PARCEL_RULES[kind], rng) for kind in front}
    return BuildingPool(designs=designs, rows=rows, boundaries=boundaries, prototypes=tuple(shapes))


def _designs(rule: ParcelRule, rng: np.random.Generator) -> Designs:
    """Make designs of one kind; the backs of rows have no windows, they are invisible from the road."""
    detached = rule.side_gap_m[1] > 0
    facades = None if detached else [True, False, False, False]
    sizes, parts = [], []
    for _ in range(_DESIGNS):
        width = rng.uniform(*rule.width_m) - 2 * detached * rng.uniform(*rule.side_gap_m)
        depth, height = rng.uniform(*rule.depth_m), rng.uniform(*rule.height_m)
        corners = np.array([[0.0, 0.0], [width, 0.0], [width, depth], [0.0, depth]])
        parts.append(building(corners, height_m=height, style=rule.style, rng=rng, facades=facades))
        sizes.append((width, depth, height))
    return Designs(size_m=np.array(sizes), parts=tuple(parts))


def _row(
    name: str, rule: ParcelRule, shapes: list[Prototype], rng: np.random.Generator
) -> list[ReadyBuilding]:
    """Make buildings of equal depth and height."""
    depth, height = rng.uniform(*rule.depth_m), rng.uniform(*rule.height_m)
    detached = rule.side_gap_m[1] > 0
    made = []
    for number in range(_PER_ROW):
        width = float(rng.uniform(*rule.width_m) - 2 * detached * np.mean(rule.side_gap_m))
        corners = np.array([[-width / 2, 0.0], [width / 2, 0.0], [width / 2, depth], [-width / 2, depth]])
        facades = None if detached else [True, False, True, False]
        parts = building(corners, height_m=height, style=rule.style, rng=rng, facades=facades)
        low, high = _bounds(parts)
        shapes.append(prototype(f"building_{name}_{number}", "building", parts))
        x, y = ((low + high) / 2).tolist()
        made.append(ReadyBuilding(name=shapes[-1].name, width_m=width, depth_m=float(depth), middle_m=(x, y)))
    return made


def _bounds(parts: dict[str, Mesh]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the smallest and largest x, y (2,) of meshes [m]."""
    points = np.concatenate([part.vertices[np.unique(part.faces)] for part in parts.values()])[:, :2]
    return points.min(axis=0).astype(np.float64), points.max(axis=0).astype(np.float64)


def _boundaries(shapes: list[Prototype], rng: np.random.Generator) -> dict[tuple[str, str], list[str]]:
    """Make pieces of walls, hedges and fences of both heights."""
    line = np.array([[-BOUNDARY_M / 2, 0.0], [BOUNDARY_M / 2, 0.0]])
    names: dict[tuple[str, str], list[str]] = {}
    for place, height in (("front", _FRONT_M), ("back", _BACK_M)):
        stone = wall(line, height_m=height, thickness_m=0.22)
        green = hedge(line, height_m=height, thickness_m=0.65, rng=rng, step_m=1.0)
        made: list[tuple[str, str, dict[str, Mesh]]] = [
            ("wall", "wall", {"brick": stone}),
            ("wall", "wall", {"concrete": stone}),
            ("hedge", "hedge", {"foliage": green}),
            ("boards", "fence", fence(line, height_m=height, kind="boards")),
            ("railing", "fence", fence(line, height_m=height, kind="railing")),
            ("chain_link", "fence", fence(line, height_m=2.0, kind="chain_link")),
        ]
        for kind, class_name, parts in made:
            name = f"boundary_{place}_{kind}_{min(parts)}"
            shapes.append(prototype(name, class_name, parts))
            names.setdefault((kind, place), []).append(name)
    return names
