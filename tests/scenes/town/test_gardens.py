"""Trees in gardens keep clear of occupied ground."""

import numpy as np
import shapely

from echoscape.scenes.assets.vegetation import tree_prototypes
from echoscape.scenes.town.gardens import plant_garden
from echoscape.scenes.town.parcels import CityBlock
from echoscape.scenes.town.placement import OccupiedArea, SceneBuilder


def test_low_crowns_keep_clear_of_occupied_ground() -> None:
    garden, strip = shapely.box(0.0, 0.0, 8.0, 8.0), shapely.box(8.0, -9.0, 9.0, 17.0)
    kinds, kerb = tree_prototypes(), 0.12
    planted, missing = set(), 0
    for seed in range(150):
        builder, occupied = SceneBuilder(kinds), OccupiedArea()
        occupied.add(strip)
        block = CityBlock(outline=garden, occupied=occupied, base_m=kerb, inradius_m=8.0)
        plant_garden(builder, garden, block, chance=1.0, rng=np.random.default_rng(seed))
        placed = builder.placements()
        missing += len(placed.yaw) == 0
        for number, place, yaw, scale in zip(
            placed.prototype, placed.position, placed.yaw, placed.scale, strict=True
        ):
            corners = np.concatenate([mesh.vertices[mesh.faces] for mesh in kinds[number].parts.values()])
            low = scale * corners[scale * corners[..., 2].min(axis=1) < 1.8].reshape(-1, 3)
            x = place[0] + np.cos(yaw) * low[:, 0] - np.sin(yaw) * low[:, 1]
            assert x.max() < 8.0, kinds[number].name
            planted.add(kinds[number].name)
    assert planted == {"tree_broadleaf", "tree_street", "tree_conifer", "tree_shrub"}
    assert 0 < missing < 30
