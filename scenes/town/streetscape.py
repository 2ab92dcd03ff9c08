"""Objects along streets: lamp posts, trees, signs, bins, shelters, bollards, and vehicles parked at the kerb.

Furniture stands in a strip of about 0.7 m at the kerb, and people walk between it and the facades (furniture
zone and pedestrian through zone of the NACTO Urban Street Design Guide, 2013). Vehicles stand in the parking
strip, at least 0.3 m from the lane.
"""

from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from echoscape.scenes.core.scene import Prototype
from echoscape.scenes.geometry.curves import Line, arc_length, headings, left_normals, points_at, section
from echoscape.scenes.roads.ground_mesh import Ground
from echoscape.scenes.roads.junctions import TrimLengths
from echoscape.scenes.roads.street_network import Network, Street
from echoscape.scenes.town.placement import OccupiedArea, SceneBuilder, rectangle
from echoscape.scenes.town.presets import Preset

_LANE_GAP_M = 0.35
_KERB_GAP_M = 0.1
_HEAD_M = 2.0
_CAR_SHARES = {
    "car_hatchback": 0.32,
    "car_saloon": 0.2,
    "car_estate": 0.16,
    "car_suv": 0.2,
    "van_small": 0.07,
    "van_panel": 0.05,
}


def dress_streets(
    builder: SceneBuilder,
    occupied: OccupiedArea,
    network: Network,
    trims: TrimLengths,
    ground: Ground,
    preset: Preset,
    *,
    seeds: np.random.SeedSequence,
) -> None:
    """Add furniture and parked vehicles along every street.

    Args:
        builder: The scene.
        occupied: Occupied ground, which is extended.
        network: The streets.
        trims: Trimmed lengths of the streets.
        ground: Plan of the ground.
        preset: The preset.
        seeds: Seeds of this stage.
    """
    shapely.prepare(ground.carriageway)
    base_extents = {prototype.name: base_extent(prototype) for prototype in builder.prototypes}
    for street, cut, child in zip(network.streets, trims, seeds.spawn(len(network.streets)), strict=True):
        rng = np.random.default_rng(child)
        line = section(street.line, cut[0], street.length_m - cut[1])
        if street.type.pavement_m > 0:
            for side in (line[::-1], line):  # to the right of travel in both directions
                pavement = Pavement(
                    builder, occupied, street, side, ground, base_extents, preset.kerb_height_m, rng
                )
                pavement.add_signs()
                pavement.add_shelter()
                pavement.add_lamps(preset.lamps_m)
                pavement.add_trees(preset.street_trees)
                pavement.add_bins()
            _park(builder, occupied, street, line, preset, rng)


class BaseExtent(NamedTuple):
    """Extent of a prototype below head height, in its own frame.

    Attributes:
        low_m: Smallest x, y (2,) [m].
        high_m: Largest x, y (2,) [m].
    """

    low_m: NDArray[np.float64]
    high_m: NDArray[np.float64]


def base_extent(prototype: Prototype) -> BaseExtent:
    """Return the extent of a prototype below head height: of a lamp its pole, of a tree its trunk.

    Args:
        prototype: The prototype.

    Returns:
        The extent.
    """
    corners = np.concatenate([mesh.vertices[mesh.faces] for mesh in prototype.parts.values()])
    low = corners[corners[..., 2].min(axis=1) < _HEAD_M][..., :2].reshape(-1, 2).astype(np.float64)
    return BaseExtent(low.min(axis=0), low.max(axis=0))


class Pavement:
    """One side of a street under construction, with the pavement to the right of the line.

    Attributes:
        length_m: Length of the line [m].
    """

    def __init__(
        self,
        builder: SceneBuilder,
        occupied: OccupiedArea,
        street: Street,
        line: Line,
        ground: Ground,
        base_extents: dict[str, BaseExtent],
        base_m: float,
        rng: np.random.Generator,
    ) -> None:
        """Prepare one side of a street.

        Args:
            builder: The scene.
            occupied: Occupied ground, which is extended.
            street: The street.
            line: Its middle (P, 2) [m], in the direction of travel on this side.
            ground: Plan of the ground.
            base_extents: Extents of all prototypes below head height, by name.
            base_m: Height of the pavement [m].
            rng: Random generator.
        """
        self._builder, self._occupied, self._base_m, self._rng = builder, occupied, base_m, rng
        self._type, self._carriageway, self._base_extents = street.type, ground.carriageway, base_extents
        self._line, self._along = line, arc_length(line)
        self._normal, self._heading = left_normals(line), headings(line)
        self.length_m = float(self._along[-1])

    def place(
        self, name: str, distance_m: float, from_kerb_m: float, *, turn_rad: float, scale: float = 1.0
    ) -> bool:
        """Place an object if it is clear of the carriageway and of occupied ground.

        Args:
            name: Name of its prototype.
            distance_m: Distance along the line [m].
            from_kerb_m: Distance of the middle of its base behind the kerb [m].
            turn_rad: Heading relative to the direction of travel [rad].
            scale: Scale factor.

        Returns:
            Whether it was placed.
        """
        normal = np.array([np.interp(distance_m, self._along, self._normal[:, axis]) for axis in range(2)])
        at = points_at(self._line, np.array([distance_m]))[0]
        middle = at - normal * (self._type.half_width_m + from_kerb_m)
        yaw = float(np.interp(distance_m, self._along, self._heading)) + turn_rad
        extent = self._base_extents[name]
        ahead = np.array([np.cos(yaw), np.sin(yaw)])
        aside = np.array([-ahead[1], ahead[0]])
        x, y = scale * (extent.low_m + extent.high_m) / 2
        length, width = scale * (extent.high_m - extent.low_m)
        shape = rectangle(middle, yaw, length, width)
        free = not shapely.dwithin(self._carriageway, shape, _KERB_GAP_M) and self._occupied.claim(shape)
        if free:
            self._builder.place(
                name, middle - x * ahead - y * aside, base_m=self._base_m, yaw_rad=yaw, scale=scale
            )
        return free

    def add_lamps(self, spacing_m: float) -> None:
        """Add lamp posts with their arms over the road.

        Args:
            spacing_m: Distance between lamp posts [m].
        """
        name = "lamp_lantern" if self._type.name == "narrow" else "lamp_arm"
        first = self._rng.uniform(0.0, spacing_m)
        for distance in np.arange(first, self.length_m, spacing_m):
            self.place(name, float(distance), 0.45, turn_rad=np.pi / 2)

    def add_trees(self, share: float) -> None:
        """Add street trees where the pavement is wide enough.

        Args:
            share: Share of the places for trees that have one.
        """
        if self._type.pavement_m < 2.2 or self._rng.random() > 0.45:
            return
        for distance in np.arange(self._rng.uniform(3.0, 9.0), self.length_m - 3.0, 11.0):
            if self._rng.random() < share:
                self.place(
                    "tree_street",
                    float(distance),
                    0.45,
                    turn_rad=float(self._rng.uniform(0, 6.28)),
                    scale=float(self._rng.uniform(1.1, 1.5)),
                )

    def add_signs(self) -> None:
        """Add a sign before the junction at the end of the line, and traffic lights on avenues."""
        if self.length_m < 15.0:
            return
        name = str(self._rng.choice(["sign_round", "sign_triangle", "sign_rectangle"]))
        if self._type.lanes > 1:
            self._place_before(0.5, "traffic_light")
        self._place_before(3.0, name)
        if self._rng.random() < 0.25:
            for step in range(4):
                self.place("bollard_concrete", 0.5 + 1.6 * step, 0.4, turn_rad=0.0)

    def _place_before(self, distance_m: float, name: str) -> None:
        """Add a sign `distance_m` before the end, or further before it where the kerb is straight."""
        for back in (0.0, 2.0, 4.0, 6.0):
            if self.place(name, self.length_m - distance_m - back, 0.5, turn_rad=np.pi):
                return

    def add_shelter(self) -> None:
        """Add a bus shelter on a wide pavement."""
        if self._type.pavement_m > 3.5 and self.length_m > 60.0 and self._rng.random() < 0.5:
            distance = float(self._rng.uniform(0.6, 0.8)) * self.length_m
            self.place("bus_shelter", distance, 3.2, turn_rad=np.pi / 2)

    def add_bins(self) -> None:
        """Add litter bins, and wheeled bins put out for collection."""
        for distance in np.arange(self._rng.uniform(5.0, 30.0), self.length_m - 4.0, 34.0):
            if self._rng.random() < 0.3:
                self.place("bin_round", float(distance), 0.43, turn_rad=0.0)
            elif self._rng.random() < 0.3:
                self.place("bin_wheeled", float(distance), 0.43, turn_rad=0.0)


def _park(
    builder: SceneBuilder,
    occupied: OccupiedArea,
    street: Street,
    line: Line,
    preset: Preset,
    rng: np.random.Generator,
) -> None:
    """Park vehicles at both kerbs, most in the direction of traffic on their side."""
    kind = street.type
    if kind.parking_m <= 0 or preset.parked <= 0:
        return
    trucks = kind.parking_m > 3.0
    names = [*_CAR_SHARES, "truck_box", "truck_flatbed"]
    share = preset.trucks if trucks else 0.0
    odds = np.array([*(np.array(list(_CAR_SHARES.values())) * (1 - share)), 0.6 * share, 0.4 * share])
    for side in (line[::-1], line):
        along, normal, heading = arc_length(side), left_normals(side), headings(side)
        place_m = 6.0 + rng.uniform(0.0, 4.0)
        density = preset.parked * rng.uniform(0.4, 1.3)
        while place_m < along[-1] - 12.0:
            name = str(rng.choice(names, p=odds / odds.sum()))
            length, width, _ = builder[name].extent_m
            middle = place_m + length / 2
            if rng.random() < density and middle + length / 2 < along[-1] - 5.0:
                aside = kind.lane_edge_m + _LANE_GAP_M + width / 2 + rng.uniform(0.0, 0.1)
                left = np.array([np.interp(middle, along, normal[:, axis]) for axis in range(2)])
                place = points_at(side, np.array([middle]))[0] - aside * left
                yaw = float(np.interp(middle, along, heading)) + np.pi * (rng.random() < 0.15)
                if occupied.claim(rectangle(place, yaw, length + 0.3, width)):
                    builder.place(name, place, base_m=0.0, yaw_rad=yaw)
            place_m += length + rng.uniform(0.5, 1.6)
