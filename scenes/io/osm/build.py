"""Builds the world of an OpenStreetMap extract: what the map shows where it shows it, the rest by seed.

Streets, lanes, kerbs and furniture, and the town beyond the map, are made by the builders of the presets.
Every draw comes from the seed and the id of the element, so that the order of the file changes nothing.
"""

from dataclasses import replace

import numpy as np
import shapely
from shapely.geometry import LineString, Polygon

from echoscape.scenes.assets.street_furniture import furniture_prototypes
from echoscape.scenes.assets.vegetation import tree_prototypes
from echoscape.scenes.assets.vehicles import vehicle_prototypes
from echoscape.scenes.core.checks import check_whole
from echoscape.scenes.core.lane_graph import RoadGraph
from echoscape.scenes.core.scene import Scene
from echoscape.scenes.geometry.curves import Line
from echoscape.scenes.io.osm.areas import LandCover, furnish, land_covers
from echoscape.scenes.io.osm.barriers import add_barriers, add_objects
from echoscape.scenes.io.osm.buildings import building_parts, seen_from
from echoscape.scenes.io.osm.elements.footprints import Shape, shapes_of
from echoscape.scenes.io.osm.elements.map_data import OsmMap
from echoscape.scenes.io.osm.extract import OsmExtract, plane_of, read_extract_map
from echoscape.scenes.io.osm.gardens import lay_gardens
from echoscape.scenes.io.osm.ground import lay_map_ground, map_ground, streets_beyond, walking_lines
from echoscape.scenes.io.osm.mapped_building import MappedBuilding, is_building, mapped_buildings
from echoscape.scenes.io.osm.streets.road_network import Streets, street_plan
from echoscape.scenes.io.strict_toml import SceneError
from echoscape.scenes.roads.ground_mesh import Ground, boundaries, footpath_strips
from echoscape.scenes.roads.street_network import Network
from echoscape.scenes.town.building_pool import building_pool
from echoscape.scenes.town.outskirts import fill_outskirts
from echoscape.scenes.town.parcels import CityBlock
from echoscape.scenes.town.placement import OccupiedArea, SceneBuilder
from echoscape.scenes.town.presets import Preset, Use
from echoscape.scenes.town.roadside import scatter_trees
from echoscape.scenes.town.streetscape import dress_streets

_KERB_M = 0.12
_WINDOWS_M = 60.0
"""Distance from a driven street up to which walls have windows [m]."""
_SPARSE_M, _BEYOND_M = 60.0, 24.0
_TOWN_SHARE, _VILLAGE_SHARE = 0.1, 0.02
_TOWN: tuple[tuple[Use, float], ...] = (("terrace", 0.5), ("houses", 0.3), ("flats", 0.15), ("works", 0.05))
_VILLAGE: tuple[tuple[Use, float], ...] = (("houses", 1.0),)
_ROADS, _SHAPES, _FACADES, _LINES, _GARDENS, _AREAS, _STREETS, _LAND = range(8)
"""Stages of the seed; the ids of elements follow."""


def build_osm_scene(extract: OsmExtract, *, seed: int) -> Scene:
    """Build the world of an extract.

    Args:
        extract: The extract, see `read_osm`.
        seed: Seed of everything that the map does not say.

    Returns:
        The scene, without movers. Its x points east and y north from `Scene.origin_deg`.

    Raises:
        SceneError: The file is broken or has changed since it was described, or has no roads that can be
            driven; the message names it.
        ValueError: The seed is no whole number of 0 or more.
    """
    check_whole(seed=seed)
    osm = read_extract_map(extract)
    return _World(osm, extract, seed).scene()


class _World:
    """A world under construction."""

    def __init__(self, osm: OsmMap, extract: OsmExtract, seed: int) -> None:
        self._osm, self._extract, self._seed = osm, extract, seed
        self._places, self._area = plane_of(osm, extract.origin_deg)
        self._occupied = OccupiedArea()

    def _rng(self, stage: int, kind: int, number: int, part: int = 0) -> np.random.Generator:
        """Return the random generator of an element."""
        key = [self._seed, stage, kind, abs(number), int(number < 0), part]
        return np.random.default_rng(np.random.SeedSequence(key))

    def scene(self) -> Scene:
        """Build everything and return the scene."""
        buildings = self._buildings()
        solid = [each.shape.polygon for each in buildings]
        streets = street_plan(
            self._osm,
            self._places,
            self._area,
            solid,
            rng_of=lambda number: self._rng(_ROADS, 1, number),
        )
        if streets is None:
            raise SceneError(
                f"{self._osm.file}: must hold a road with space to turn round, or a loop; got none"
            )
        settings = self._settings(solid, streets.network)
        pool = building_pool(settings, seeds=np.random.SeedSequence([self._seed, _LAND, 1]))
        self._builder = SceneBuilder(
            (*vehicle_prototypes(), *furniture_prototypes(), *tree_prototypes(), *pool.prototypes)
        )
        rng = np.random.default_rng(np.random.SeedSequence([self._seed, _LAND, 0]))
        beyond = streets_beyond(streets, self._area, ringed=bool(settings.uses), rng=rng)
        network = replace(streets.network, outskirts=(*streets.network.outskirts, *beyond))
        ground = map_ground(network, streets, self._area, shapely.union_all(solid))
        covers = land_covers(self._osm, self._places, ground.land.difference(ground.corridor))
        lay_map_ground(self._builder, ground, covers, high=settings.kerb_height_m)
        self._add_buildings(buildings, streets.network)
        walks = self._add_details(buildings, covers, network, streets, ground, settings)
        fill = replace(ground, driven=shapely.union_all([ground.driven, self._area]))
        if settings.uses:
            fill_outskirts(
                self._builder,
                self._occupied,
                fill,
                replace(network, outskirts=tuple(beyond)),
                pool,
                settings,
                seeds=np.random.SeedSequence([self._seed, _LAND, 2]),
            )
        self._scatter(ground, covers)
        return self._finished(streets.roads, walks, ground)

    def _buildings(self) -> list[MappedBuilding]:
        """Return the buildings of the map, those outside its edges left out."""
        shapes = shapes_of(self._osm, self._places, is_building)
        inside = [each for each in shapes if self._area.contains(each.polygon.representative_point())]
        return mapped_buildings(inside, rng_of=lambda shape: self._of_shape(_SHAPES, shape))

    def _of_shape(self, stage: int, shape: Shape) -> np.random.Generator:
        return self._rng(stage, shape.kind, shape.id, shape.part)

    def _settings(self, solid: list[Polygon], network: Network) -> Preset:
        """Return what lies beyond the map, by how densely it is built up, and the height of kerbs."""
        share = sum(each.area for each in solid) / self._area.area
        uses = _TOWN if share > _TOWN_SHARE else _VILLAGE if share > _VILLAGE_SHARE else ()
        paved = any(street.type.pavement_m > 0 for street in network.streets)
        return Preset(name="osm", layout="plain", uses=uses, kerb_height_m=_KERB_M if paved else 0.0)

    def _add_buildings(self, buildings: list[MappedBuilding], network: Network) -> None:
        """Add all buildings of the map."""
        solid = [each.shape.polygon for each in buildings]
        tree = shapely.STRtree(solid)
        visible = seen_from([LineString(street.line) for street in network.streets], reach_m=_WINDOWS_M)
        for row, each in enumerate(buildings):
            near = [
                solid[other] for other in tree.query(each.shape.polygon.buffer(1.0)).tolist() if other != row
            ]
            rng = self._of_shape(_FACADES, each.shape)
            parts = building_parts(each, shapely.union_all(near), visible=visible, rng=rng)
            self._builder.add("building", parts)
            self._occupied.add(each.shape.polygon)

    def _add_details(
        self,
        buildings: list[MappedBuilding],
        covers: list[LandCover],
        network: Network,
        streets: Streets,
        ground: Ground,
        settings: Preset,
    ) -> tuple[Line, ...]:
        """Add what stands along streets and between them, and return the lines on which people walk."""
        block = CityBlock(
            outline=self._area, occupied=self._occupied, base_m=settings.kerb_height_m, inradius_m=0.0
        )
        water = shapely.union_all([each.area for each in covers if each.cover == "water"])
        solid = shapely.union_all([each.shape.polygon for each in buildings])
        if not water.is_empty:
            self._occupied.add(water)
        dry = self._area.difference(shapely.union_all([water, solid]))
        standing = dry.difference(ground.carriageway.buffer(0.6))
        shapely.prepare(standing)

        def rng_of(stage: int):
            return lambda key: self._rng(stage, *key)

        add_barriers(self._builder, self._osm, self._places, block, standing, rng_of=rng_of(_LINES))
        add_objects(self._builder, self._osm, self._places, block, standing, rng_of=rng_of(_LINES))
        walks = walking_lines(ground, self._occupied) if settings.kerb_height_m > 0 else ()
        for strip in footpath_strips(walks):
            self._occupied.add(strip)
        dress_streets(
            self._builder,
            self._occupied,
            network,
            streets.trims,
            ground,
            settings,
            seeds=np.random.SeedSequence([self._seed, _STREETS]),
        )
        furnish(self._builder, self._occupied, covers, base_m=settings.kerb_height_m, rng_of=rng_of(_AREAS))
        used = shapely.union_all([each.area for each in covers])
        gardens = dry.difference(shapely.union_all([ground.corridor, used]))
        lay_gardens(self._builder, buildings, gardens, block, rng_of=rng_of(_GARDENS))
        return walks

    def _scatter(self, ground: Ground, covers: list[LandCover]) -> None:
        """Plant trees at random: sparsely on land of no use in the map, and densely beyond it."""
        used = shapely.union_all([each.area for each in covers])
        inside = self._area.difference(used)
        beyond = ground.land.difference(self._area)
        for number, (land, spacing) in enumerate(((inside, _SPARSE_M), (beyond, _BEYOND_M))):
            rng = np.random.default_rng(np.random.SeedSequence([self._seed, _LAND, 3, number]))
            if not land.is_empty:
                field = replace(ground, land=land, carriageway=ground.corridor)
                scatter_trees(self._builder, self._occupied, field, spacing_m=spacing, clear_m=2.5, rng=rng)

    def _finished(self, roads: RoadGraph, walks: tuple[Line, ...], ground: Ground) -> Scene:
        x0, y0, x1, y1 = (float(value) for value in ground.land.bounds)
        return Scene(
            preset="osm",
            seed=self._seed,
            static=self._builder.static(),
            prototypes=self._builder.prototypes,
            placements=self._builder.placements(),
            instance_class=self._builder.instance_class(),
            roads=replace(roads, footpaths=walks, kerbs=tuple(boundaries(ground.carriageway))),
            bounds_m=(x0, y0, x1, y1),
            origin_deg=self._extract.origin_deg,
        )
