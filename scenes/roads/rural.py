"""Roads outside towns: a straight road, a country road with bends and two tracks, and a crossroads."""

import numpy as np
from scipy.interpolate import CubicSpline

from echoscape.scenes.geometry.curves import Line, resampled
from echoscape.scenes.roads.street_network import COUNTRY, Network, Street, StreetType

_TRACK = StreetType(
    name="track", lanes=1, lane_width_m=2.75, parking_m=0.0, pavement_m=0.0, speed_limit_mps=9.0
)
_DRIVEWAY = StreetType(
    name="driveway", lanes=1, lane_width_m=3.25, parking_m=0.0, pavement_m=0.0, speed_limit_mps=8.0
)


def straight_road(length_m: float = 920.0) -> Network:
    """Make one straight two-way road along x, centred on the origin.

    Args:
        length_m: Length [m].

    Returns:
        The street network.
    """
    ends = np.array([[-length_m / 2, 0.0], [length_m / 2, 0.0]])
    return Network(junctions=ends, streets=(Street(start=0, end=1, line=resampled(ends, 1.0), type=COUNTRY),))


def country_roads(*, rng: np.random.Generator) -> Network:
    """Make a winding road about 1.9 km long and two tracks that leave it.

    Args:
        rng: Random generator.

    Returns:
        The street network.
    """
    x = np.linspace(-850.0, 850.0, 7)
    y = np.concatenate([[0.0], rng.uniform(-110.0, 110.0, 5), [0.0]])
    fine = np.linspace(x[0], x[-1], 6001)
    road = resampled(np.stack([fine, CubicSpline(x, y)(fine)], axis=-1), 1.0)
    cuts = np.array([0, int(len(road) * rng.uniform(0.3, 0.36)), int(len(road) * rng.uniform(0.62, 0.7)), -1])
    feet = road[cuts]
    sides = (1.0, -1.0) if rng.random() < 0.5 else (-1.0, 1.0)
    tracks = [_track(road, int(cut), side) for cut, side in zip(cuts[1:3], sides, strict=True)]
    junctions = np.concatenate([feet, [tracks[0][-1], tracks[1][-1]]])
    pieces = [road[cuts[0] : cuts[1] + 1], road[cuts[1] : cuts[2] + 1], road[cuts[2] :]]
    streets = [Street(start=i, end=i + 1, line=piece, type=COUNTRY) for i, piece in enumerate(pieces)]
    streets += [Street(start=1 + i, end=4 + i, line=track, type=_TRACK) for i, track in enumerate(tracks)]
    return Network(junctions=junctions, streets=tuple(streets))


def crossroads(*, rng: np.random.Generator, arm_m: float = 80.0) -> Network:
    """Make a crossroads of four short arms with dead ends, at about right angles.

    Args:
        rng: Random generator.
        arm_m: Distance of the dead ends from the origin [m].

    Returns:
        The street network; junction 0 is the crossing.
    """
    middle = rng.uniform(-6.0, 6.0, 2)
    angle = np.pi / 2 * np.arange(4)
    along = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    ends = arm_m * along + rng.uniform(-8.0, 8.0, 4)[:, None] * along[:, ::-1]
    streets = tuple(
        Street(start=0, end=1 + arm, line=resampled(np.stack([middle, end]), 1.0), type=_DRIVEWAY)
        for arm, end in enumerate(ends)
    )
    return Network(junctions=np.concatenate([middle[None], ends]), streets=streets)


def _track(road: Line, index: int, side: float) -> Line:
    """Return a line that leaves `road` at a right angle and bends a little."""
    along = road[index + 2] - road[index - 2]
    along /= np.linalg.norm(along)
    away = side * np.array([-along[1], along[0]])
    reach = np.linspace(0.0, 260.0, 261)[:, None]
    return resampled(road[index] + reach * away + 22.0 * (1 - np.cos(reach / 260.0 * np.pi)) / 2 * along, 1.0)
