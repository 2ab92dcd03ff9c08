"""Radars and traces that the laws are measured with."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.scene import Mesh, Mover, Scene
from echoscape.sim.echoes import Echoes
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.sim.settings.tracing import TraceSettings
from echoscape.sim.simulator import Simulator
from tests.sim.worlds import Ride, quad, standing

STEADY = replace(CTS350X, rotation_jitter_s=1e-9, encoder_first=0)
"""Turns take exactly a quarter of a second, and the first azimuth looks straight ahead."""
POINTING = replace(STEADY, rotation_hz=0.01)
"""Rotates so slowly that the beam does not move within a sweep: for radars at rest."""
HEIGHT_M = CTS350X.mount_height_m
ROW_DEG = 360 / CTS350X.azimuths
WAVELENGTH_M = 299792458 / 76.5e9


def traced(
    town: Scene,
    ride: Ride | None = None,
    movers: tuple[Mover, ...] = (),
    *,
    rays: int = 1024,
    max_bounces: int = 1,
    floor_db: float = -60.0,
    sensor=POINTING,
    seed: int = 3,
    **artefacts: bool,
) -> Echoes:
    """The echoes of the first scan of a ride, or of a radar that stands at the origin."""
    settings = TraceSettings(rays=rays, max_bounces=max_bounces, floor_db=floor_db)
    simulator = Simulator(
        town,
        ride or standing(),
        movers,
        seed=seed,
        sensor=sensor,
        settings=settings,
        artefacts=Artefacts(**artefacts),
    )
    return simulator.echoes(0)


def power_of(echoes: Echoes, instance: int) -> float:
    """Mean power (over speckle) of an instance's echoes, summed over the azimuths that receive them [W]."""
    return float(echoes.mean_power[echoes.instance == instance].sum(dtype=np.float64))


def row_power(echoes: Echoes, row: int) -> float:
    """Mean power (over speckle) of the echoes of an azimuth [W]."""
    return float(echoes.mean_power[echoes.azimuth == row].sum(dtype=np.float64))


def facing(
    azimuth_rad: float, elevation_rad: float, distance_m: float, width_m: float, height_m: float
) -> Mesh:
    """A rectangle that faces the radar at the origin from an azimuth (clockwise) and an elevation."""
    ahead = np.array(
        [
            np.cos(elevation_rad) * np.cos(azimuth_rad),
            -np.cos(elevation_rad) * np.sin(azimuth_rad),
            np.sin(elevation_rad),
        ]
    )
    aside: NDArray = np.array([np.sin(azimuth_rad), np.cos(azimuth_rad), 0.0]) * width_m / 2
    up = np.cross(ahead, aside / (width_m / 2)) * height_m / 2
    middle = distance_m * ahead + [0.0, 0.0, HEIGHT_M]
    return quad([list(middle + a * aside + b * up) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
