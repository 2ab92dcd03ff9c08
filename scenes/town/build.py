"""Generates a scene from a preset and a seed: streets, lanes, ground, and all objects.

Each stage draws from its own seed sequence, so a change to one stage leaves the others unchanged.
"""

from dataclasses import replace

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from echoscape.scenes.assets.street_furniture import furniture_prototypes
from echoscape.scenes.assets.vegetation import tree_prototypes
from echoscape.scenes.assets.vehicles import vehicle_prototypes
from echoscape.scenes.core.checks import check_whole
from echoscape.scenes.core.lane_graph import RoadGraph
from echoscape.scenes.core.scene import Scene
from echoscape.scenes.roads.ground_mesh import (
    KERB_WIDTH_M,
    Ground,
    boundaries,
    footpath_lines,
    footpath_strips,
    ground_plan,
    kerb_runs,
    level_mesh,
)
from echoscape.scenes.roads.junctions import TrimLengths, road_graph
from echoscape.scenes.roads.motorway import motorway
from echoscape.scenes.roads.rural import country_roads, crossroads, straight_road
from echoscape.scenes.roads.street_network import Network
from echoscape.scenes.roads.subdivision import subdivided_network
from echoscape.scenes.town.building_pool import BuildingPool, building_pool
from echoscape.scenes.town.land_use import blocks_of, fill_blocks
from echoscape.scenes.town.outskirts import fill_outskirts
from echoscape.scenes.town.placement import OccupiedArea, SceneBuilder
from echoscape.scenes.town.presets import PRESETS, Preset
from echoscape.scenes.town.roadside import dress_country_roads, dress_motorway
from echoscape.scenes.town.streetscape import dress_streets
from echoscape.scenes.town.yard import dress_yard


def build_town(preset: str = "town", *, seed: int) -> Scene:
    """Generate the scene of a preset.

    Args:
        preset: Name of the preset, a key of `PRESETS`.
        seed: Seed of everything that is drawn.

    Returns:
        The scene, without movers.

    Raises:
        ValueError: The preset is unknown, or the seed no whole number of 0 or more.
    """
    check_whole(seed=seed)
    if preset not in PRESETS:
        raise ValueError(f"preset must be one of {', '.join(PRESETS)}, got {preset!r}")
    settings = PRESETS[preset]
    pool = building_pool(settings, seeds=_stage(seed, 4))
    builder = SceneBuilder(
        (*vehicle_prototypes(), *furniture_prototypes(), *tree_prototypes(), *pool.prototypes)
    )
    if settings.layout == "motorway":
        roads, ground = _motorway(builder, settings, seed)
    else:
        roads, ground = _streets(builder, pool, settings, seed)
    x0, y0, x1, y1 = (float(value) for value in ground.land.bounds)
    return Scene(
        preset=preset,
        seed=seed,
        static=builder.static(),
        prototypes=builder.prototypes,
        placements=builder.placements(),
        instance_class=builder.instance_class(),
        roads=roads,
        bounds_m=(x0, y0, x1, y1),
    )


def road_network(settings: Preset, *, seed: int) -> tuple[Network, RoadGraph, TrimLengths]:
    """Lay out the streets of a preset without a motorway.

    Args:
        settings: The preset.
        seed: Seed of everything that is drawn.

    Returns:
        The streets, their lanes, and the trimmed lengths of the streets.
    """
    network = _network(settings, np.random.default_rng(_stage(seed, 0)))
    roads, trims = road_graph(network)
    return network, roads, trims


def _lies_on(walk: NDArray[np.float64], ground: BaseGeometry) -> bool:
    """Return whether all of a line (P, 2) lies on ground."""
    return bool(shapely.contains_xy(ground, walk).all())


def _streets(
    builder: SceneBuilder, pool: BuildingPool, settings: Preset, seed: int
) -> tuple[RoadGraph, Ground]:
    """Lay out streets and add everything on and beside them."""
    network, roads, trims = road_network(settings, seed=seed)
    ground = ground_plan(network, roads, trims, margin_m=settings.margin_m)
    # Nobody walks where nobody drives.
    walks = tuple(walk for walk in footpath_lines(ground) if _lies_on(walk, ground.driven))
    occupied = OccupiedArea()
    for strip in footpath_strips(walks):
        occupied.add(strip)
    lay_ground(builder, ground, settings)
    dress_streets(builder, occupied, network, trims, ground, settings, seeds=_stage(seed, 2))
    if settings.uses:
        fill_blocks(builder, occupied, ground, network, pool, settings, seeds=_stage(seed, 1))
        fill_outskirts(builder, occupied, ground, network, pool, settings, seeds=_stage(seed, 5))
    if settings.layout == "country":
        dress_country_roads(builder, occupied, network, ground, rng=np.random.default_rng(_stage(seed, 3)))
    if settings.layout == "yard":
        dress_yard(builder, occupied, network, ground, rng=np.random.default_rng(_stage(seed, 3)))
    return replace(roads, footpaths=walks, kerbs=tuple(boundaries(ground.carriageway))), ground


def _motorway(builder: SceneBuilder, settings: Preset, seed: int) -> tuple[RoadGraph, Ground]:
    """Lay out a motorway and add everything beside it."""
    layout = motorway(rng=np.random.default_rng(_stage(seed, 0)), margin_m=settings.margin_m)
    lay_ground(builder, layout.ground, settings)
    dress_motorway(builder, OccupiedArea(), layout, rng=np.random.default_rng(_stage(seed, 3)))
    return replace(layout.roads, kerbs=tuple(boundaries(layout.ground.carriageway))), layout.ground


def _stage(seed: int, stage: int) -> np.random.SeedSequence:
    """Return the seed sequence of a stage."""
    return np.random.SeedSequence([seed, stage])


def _network(settings: Preset, rng: np.random.Generator) -> Network:
    """Return the streets of a preset."""
    if settings.subdivision is not None:
        return subdivided_network(settings.subdivision, rng=rng)
    if settings.layout == "yard":
        return crossroads(rng=rng)
    return country_roads(rng=rng) if settings.layout == "country" else straight_road()


def lay_ground(builder: SceneBuilder, ground: Ground, settings: Preset) -> None:
    """Add carriageways, kerbs, pavements and the soil of every block, each an object of its own.

    Args:
        builder: The scene.
        ground: Plan of the ground.
        settings: The preset.
    """
    high = settings.kerb_height_m
    for piece in (*ground.streets, *ground.junctions, *ground.outskirts):
        surface = level_mesh(piece, 0.0)
        if surface is not None:
            builder.add("road", {"asphalt": surface})
    inner = ground.carriageway
    if high > 0:
        for run in kerb_runs(ground.carriageway, height_m=high):
            builder.add("kerb", {"paving": run})
        inner = ground.carriageway.buffer(KERB_WIDTH_M, join_style="mitre", mitre_limit=2.0)
    paved = level_mesh(ground.corridor.difference(inner), high)
    if paved is not None:
        builder.add("pavement", {"paving": paved})
    for block in blocks_of(ground):
        soil = level_mesh(block, high)
        if soil is not None:
            builder.add("ground", {"soil": soil})
