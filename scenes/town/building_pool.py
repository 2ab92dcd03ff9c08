"""Ready-made buildings and garden boundaries for plots that are not built one by one.

A few buildings of each kind stand many times beyond the driven streets. They follow the same rules as all
others, and those of a row share depth and height, so that their fronts and roofs are flush.
"""

from dataclasses import dataclass

import numpy as np

from echoscape.scenes.assets.buildings.building import building
from echoscape.scenes.assets.vegetation import hedge
from echoscape.scenes.assets.walls_fences import fence, wall
from echoscape.scenes.core.scene import Mesh, Prototype
from echoscape.scenes.geometry.primitives import prototype
from echoscape.scenes.town.presets import PARCEL_RULES, ParcelRule, Preset

BOUNDARY_M = 5.0
"""Length of a ready-made piece of a boundary [m]."""
_ROWS, _PER_ROW = 3, 4
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
class BuildingPool:
    """Buildings and boundaries of a preset.

    Attributes:
        rows: Buildings that can stand side by side, by kind, see `PARCEL_RULES`.
        boundaries: Names of pieces of boundaries by kind and by "front" or "back" gardens.
        prototypes: Shapes of all of them.
    """

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
    return BuildingPool(rows=rows, boundaries=boundaries, prototypes=tuple(shapes))


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


def _bounds(parts: dict[str, Mesh]) -> tuple[np.ndarray, np.ndarray]:
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
