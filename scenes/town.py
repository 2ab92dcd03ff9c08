"""Towns from one integer seed: streets, lanes, surfaces, what stands on the blocks and along the streets.

Each stage draws from a seed sequence of its own, so that a change to one stage leaves the rest.
"""

import numpy as np

from echoscape.scenes.countryside import country_roads, straight_road
from echoscape.scenes.growth import grown_network
from echoscape.scenes.lanes import road_graph
from echoscape.scenes.presets import PRESETS, Preset
from echoscape.scenes.streets import Network
from echoscape.scenes.world import Placements, Town


def build_town(preset: str = "town", *, seed: int) -> Town:
    """Return the town that `preset` and `seed` name; raises `ValueError` for a preset that is not known."""
    if preset not in PRESETS:
        raise ValueError(f"preset must be one of {', '.join(PRESETS)}, got {preset!r}")
    settings = PRESETS[preset]
    network = _network(settings, _rng(seed, 0))
    roads = road_graph(network)
    bounds = (
        *(network.junctions.min(axis=0) - settings.margin_m),
        *(network.junctions.max(axis=0) + settings.margin_m),
    )
    nothing = np.zeros(0, dtype=np.uint32)
    placements = Placements(
        prototype=nothing, instance=nothing, position=np.zeros((0, 3)), yaw=np.zeros(0), scale=np.zeros(0)
    )
    return Town(
        preset=preset,
        seed=seed,
        static={},
        prototypes=(),
        placements=placements,
        instance_class=np.zeros(1, dtype=np.uint8),
        roads=roads,
        bounds_m=tuple(float(b) for b in bounds),  # pyright: ignore[reportArgumentType]
    )


def _rng(seed: int, stage: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence([seed, stage]))


def _network(settings: Preset, rng: np.random.Generator) -> Network:
    """Return the streets of a preset."""
    if settings.growth is not None:
        return grown_network(settings.growth, rng=rng)
    return country_roads(rng=rng) if settings.layout == "country" else straight_road()
