"""What each preset is made of: how its streets grow and what stands on its blocks.

All values are ours, chosen to look like British towns from the road: terraces two to six metres behind
the kerb, ten to twenty metres from wall to wall.
"""

from dataclasses import dataclass
from typing import Literal

from echoscape.scenes.roads.street_network import AVENUE, ESTATE, NARROW, PLAIN, STREET, WORKS, Growth

Layout = Literal["grown", "motorway", "country", "plain"]
Use = Literal["terrace", "houses", "flats", "shops", "park", "square", "car_park", "works", "yard"]


@dataclass(frozen=True, kw_only=True)
class Preset:
    """The settings of a town.

    `uses` weighs what a block becomes; `kerb_height_m` is 0 where roads have no kerb; `margin_m` is what is
    built on beyond the outermost streets; `parked` and `street_trees` are the shares of places taken,
    `trucks` that of trucks among the parked, `lamps_m` the distance between lamp posts.
    """

    name: str
    layout: Layout
    growth: Growth | None = None
    uses: tuple[tuple[Use, float], ...] = ()
    kerb_height_m: float = 0.12
    margin_m: float = 60.0
    parked: float = 0.2
    trucks: float = 0.05
    street_trees: float = 0.28
    lamps_m: float = 42.0


PRESETS: dict[str, Preset] = {
    preset.name: preset
    for preset in (
        Preset(
            name="town",
            layout="grown",
            growth=Growth(),
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
            layout="grown",
            growth=Growth(
                block_m2=15000.0,
                swirl_rad=0.7,
                shear=0.38,
                wave_m=430.0,
                bow=0.07,
                spurs=0.6,
                removed=0.15,
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
            layout="grown",
            growth=Growth(
                block_m2=26000.0,
                swirl_rad=0.4,
                shear=0.3,
                bow=0.02,
                spurs=0.25,
                roundabouts=2,
                types=(AVENUE, WORKS, WORKS, WORKS, PLAIN),
                shortest_m=62.0,
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
            margin_m=150.0,
            parked=0.0,
            street_trees=0.0,
        ),
        Preset(
            name="open", layout="country", kerb_height_m=0.0, margin_m=180.0, parked=0.0, street_trees=0.0
        ),
        Preset(name="empty", layout="plain", kerb_height_m=0.0, margin_m=0.0, parked=0.0, street_trees=0.0),
    )
}
