"""Presets: street layout, land use and street furniture of each kind of scene, and its building rules.

All values are ours, chosen to resemble British towns as seen from the road: terraces two to six metres behind
the kerb, ten to twenty metres from wall to wall.
"""

from dataclasses import dataclass
from typing import Literal

from echoscape.scenes.assets.buildings.building import Style
from echoscape.scenes.roads.street_network import AVENUE, ESTATE, NARROW, PLAIN, STREET, WORKS
from echoscape.scenes.roads.subdivision import SubdivisionSettings

Layout = Literal["subdivided", "motorway", "country", "plain", "yard"]
Use = Literal["terrace", "houses", "flats", "shops", "park", "square", "car_park", "works", "yard"]

SIGHT_M = 310.0
"""Distance to which the world goes on beyond every lane [m]: more than any of the radars sees."""


@dataclass(frozen=True, kw_only=True)
class Preset:
    """Settings of a kind of scene.

    Attributes:
        name: Name of the preset.
        layout: Kind of street layout.
        subdivision: Settings of a subdivided street network, None for other layouts.
        uses: Uses of a block with their relative frequencies.
        kerb_height_m: Height of the kerb [m], 0 for none.
        margin_m: Least width of the land beyond the driven streets [m].
        parked: Share of kerbside places that have a parked vehicle.
        trucks: Share of trucks among parked vehicles.
        street_trees: Share of places for street trees that have one.
        lamps_m: Distance between lamp posts [m].
    """

    name: str
    layout: Layout
    subdivision: SubdivisionSettings | None = None
    uses: tuple[tuple[Use, float], ...] = ()
    kerb_height_m: float = 0.12
    margin_m: float = SIGHT_M
    parked: float = 0.2
    trucks: float = 0.05
    street_trees: float = 0.28
    lamps_m: float = 42.0


PRESETS: dict[str, Preset] = {
    preset.name: preset
    for preset in (
        Preset(
            name="town",
            layout="subdivided",
            subdivision=SubdivisionSettings(),
            uses=(
                ("terrace", 0.54),
                ("houses", 0.12),
                ("flats", 0.12),
                ("shops", 0.08),
                ("car_park", 0.06),
                ("park", 0.05),
                ("works", 0.05),
            ),
        ),
        Preset(
            name="suburb",
            layout="subdivided",
            subdivision=SubdivisionSettings(
                block_m2=15000.0,
                swirl_rad=0.7,
                shear=0.38,
                wave_m=430.0,
                bow=0.07,
                spur_share=0.6,
                removed_share=0.15,
                roundabouts=2,
                types=(STREET, STREET, ESTATE, PLAIN, ESTATE, NARROW),
            ),
            uses=(("houses", 0.86), ("terrace", 0.05), ("flats", 0.04), ("car_park", 0.05)),
            parked=0.2,
            street_trees=0.22,
            lamps_m=38.0,
        ),
        Preset(
            name="industrial",
            layout="subdivided",
            subdivision=SubdivisionSettings(
                block_m2=26000.0,
                swirl_rad=0.4,
                shear=0.3,
                bow=0.02,
                spur_share=0.25,
                roundabouts=2,
                types=(AVENUE, WORKS, WORKS, WORKS, PLAIN),
                min_length_m=62.0,
            ),
            uses=(("works", 0.72), ("yard", 0.16), ("car_park", 0.08), ("terrace", 0.04)),
            parked=0.3,
            trucks=0.35,
            street_trees=0.1,
            lamps_m=40.0,
        ),
        Preset(
            name="motorway",
            layout="motorway",
            kerb_height_m=0.0,
            parked=0.0,
            street_trees=0.0,
        ),
        Preset(name="open", layout="country", kerb_height_m=0.0, parked=0.0, street_trees=0.0),
        Preset(name="empty", layout="plain", kerb_height_m=0.0, margin_m=500.0, parked=0.0, street_trees=0.0),
        Preset(name="yard", layout="yard", kerb_height_m=0.0, parked=0.0, street_trees=0.0),
    )
}


@dataclass(frozen=True, kw_only=True)
class ParcelRule:
    """How buildings of one kind are laid out along a street; ranges are drawn from uniformly.

    Attributes:
        style: Style of the buildings.
        width_m: Width of a parcel (low, high) [m].
        depth_m: Depth of the buildings (low, high) [m], drawn per row.
        height_m: Height of the walls (low, high) [m], drawn per row.
        setback_m: Distance from the pavement (low, high) [m], drawn per row.
        side_gap_m: Free width on each side of a building (low, high) [m]; 0 for party walls.
        alley_chance: Probability of an alley after a parcel.
        alley_m: Width of an alley (low, high) [m].
        max_row: Largest number of parcels in a row.
        front_boundaries: Boundaries of front gardens to choose from, "" for none.
        back_fence_chance: Probability that a garden behind is enclosed.
    """

    style: Style
    width_m: tuple[float, float]
    depth_m: tuple[float, float]
    height_m: tuple[float, float]
    setback_m: tuple[float, float]
    side_gap_m: tuple[float, float] = (0.0, 0.0)
    alley_chance: float = 0.0
    alley_m: tuple[float, float] = (1.5, 4.0)
    max_row: int = 1
    front_boundaries: tuple[str, ...] = ("",)
    back_fence_chance: float = 0.0


PARCEL_RULES: dict[str, ParcelRule] = {
    "terrace": ParcelRule(
        style="terrace",
        width_m=(9.0, 15.0),
        depth_m=(8.5, 11.0),
        height_m=(5.4, 9.0),
        setback_m=(0.8, 3.2),
        alley_chance=0.07,
        max_row=7,
        front_boundaries=("wall", "wall", "wall", "railing", "hedge", "", ""),
        back_fence_chance=0.25,
    ),
    "shops": ParcelRule(
        style="terrace",
        width_m=(8.0, 14.0),
        depth_m=(11.0, 14.0),
        height_m=(8.5, 12.0),
        setback_m=(0.8, 1.2),
        alley_chance=0.05,
        max_row=4,
    ),
    "houses": ParcelRule(
        style="house",
        width_m=(13.0, 20.0),
        depth_m=(8.0, 10.0),
        height_m=(4.8, 6.0),
        setback_m=(4.5, 7.0),
        side_gap_m=(1.5, 3.8),
        alley_chance=0.3,
        max_row=3,
        front_boundaries=("hedge", "hedge", "wall", "boards", ""),
        back_fence_chance=0.35,
    ),
    "flats": ParcelRule(
        style="block",
        width_m=(24.0, 44.0),
        depth_m=(12.0, 15.0),
        height_m=(9.0, 18.0),
        setback_m=(2.5, 4.5),
        side_gap_m=(2.0, 5.0),
        max_row=2,
        front_boundaries=("hedge", "railing", ""),
    ),
    "works": ParcelRule(
        style="hall",
        width_m=(38.0, 75.0),
        depth_m=(24.0, 42.0),
        height_m=(6.0, 11.0),
        setback_m=(6.0, 14.0),
        side_gap_m=(3.0, 9.0),
        max_row=1,
        front_boundaries=("chain_link", "chain_link", "wall", ""),
    ),
}
