"""Domain randomization: sensor, artefacts and surfaces drawn around the given ones, once a data set.

A network trained on one calibrated sensor in one kind of weather is fitted to that sensor, while real sensors
differ among each other and from any model. The ranges are about as wide as sensors of one kind, their
mounting and their surroundings differ (idea: Tobin et al., IROS 2017); docs/fidelity.md lists them.
"""

import math
from dataclasses import replace

import numpy as np

from echoscape.scenes.core import portable_math
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.sensor.sensor import Sensor, Table
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.sim.settings.surfaces import MOST_FACTOR, SurfaceSettings

STAGE = 310
"""Number of this stage in the seeds of random draws."""

LOSS_DB = (-3.0, 4.0)
"""Added to the losses of the link: gain, weather on the radome, age."""
NOISE_DB = (-1.5, 2.0)
"""Added to the noise figure and to the written noise alike."""
BANDWIDTH = (0.85, 1.15)
"""Factor on the swept bandwidth, and so on the range resolution."""
BEAM = (0.85, 1.3)
"""Factor on the azimuth beam's width."""
ELEVATION = (0.8, 1.25)
"""Factor on the elevation beam's width."""
CLIPPING_DB = (-5.0, 4.0)
"""Added to the levels at which the receiver compresses and its converter clips."""
PHASE_NOISE_DB = (-4.0, 4.0)
"""Added to the phase noise's density."""
RANGE_GAIN = (0.3, 1.6)
"""Factor on the receiver's gain by range [dB]."""
LEAKAGE_DB = (-6.0, 4.0)
"""Added to leakage and echoes of the radome."""
HEIGHT_M = (-0.5, 0.5)
"""Added to the height of the antenna [m]."""
TILT_DEG = (-1.0, 1.0)
"""Added to the tilt of the beam [deg]."""
ROUGHNESS = (0.6, 1.6)
"""Factors on rms height and rms slope, drawn independently, uniform in their logarithm."""
SCATTERING = (0.75, 1.2)
"""Factor on the diffuse amplitude share."""
GHOSTS_DB, SIDELOBES_DB = (-6.0, 3.0), (-4.0, 4.0)
"""Added to the power of ghosts and of the beam's sidelobes."""
BLOCKED_CHANCE, BLOCKED_WIDTH_DEG, BLOCKED_LOSS_DB = 0.4, (4.0, 40.0), (3.0, 40.0)
"""How often an object on the vehicle's roof blocks a sector, its width, and its two-way loss."""


def randomized(config: SimulationConfig) -> SimulationConfig:
    """Draw sensor, artefacts and surfaces around those of a configuration.

    Args:
        config: The configuration, whose seed decides the draws.

    Returns:
        The configuration with the drawn values, marked as randomized.

    Raises:
        ValueError: The configuration was randomized before, or a drawn value is outside its range.
    """
    if config.randomized:
        raise ValueError("randomized must be False: the configuration was randomized before")
    rng = np.random.default_rng(np.random.SeedSequence([config.seed, STAGE]))
    try:
        return replace(
            config,
            sensor=_sensor(config.sensor, rng),
            artefacts=_artefacts(config.artefacts, rng),
            surfaces=_surfaces(config.surfaces, rng),
            randomized=True,
        )
    except ValueError as error:
        raise ValueError(f"{error}, as --randomize drew it around the given values") from error


def _sensor(sensor: Sensor, rng: np.random.Generator) -> Sensor:
    """Draw a sensor around the given one; every number is drawn, whether it is used or not."""
    noise_db = _within(rng, NOISE_DB)
    azimuth, elevation = _within(rng, BEAM), _within(rng, ELEVATION)
    wider = replace(
        sensor,
        azimuth_pattern_db=_stretched(sensor.azimuth_pattern_db, azimuth, 180.0),
        elevation_pattern_db=_stretched(sensor.elevation_pattern_db, elevation, 90.0),
        # The last 0.3 dB go into far sidelobes, whose ends are not stretched.
        antenna_gain_db=sensor.antenna_gain_db - 10 * math.log10(azimuth * elevation) - 0.3,
    )
    gain = _within(rng, RANGE_GAIN)
    clipping_db = _within(rng, CLIPPING_DB)
    return replace(
        wider,
        system_loss_db=sensor.system_loss_db + _within(rng, LOSS_DB),
        noise_figure_db=sensor.noise_figure_db + noise_db,
        noise_units=sensor.noise_units * 10 ** (noise_db / 10),
        bandwidth_hz=sensor.bandwidth_hz * _within(rng, BANDWIDTH),
        full_scale_db=sensor.full_scale_db + clipping_db,
        compression_dbm=sensor.compression_dbm + clipping_db,
        phase_noise_dbc_hz=sensor.phase_noise_dbc_hz + _within(rng, PHASE_NOISE_DB),
        range_gain_db=tuple((range_m, level * gain) for range_m, level in sensor.range_gain_db),
        mount_height_m=max(sensor.mount_height_m + _within(rng, HEIGHT_M), 0.3),
        mount_tilt_deg=sensor.mount_tilt_deg + _within(rng, TILT_DEG),
        blocking_db=_blocked(sensor.blocking_db, rng),
    )


def _artefacts(artefacts: Artefacts, rng: np.random.Generator) -> Artefacts:
    """Draw strengths around the given ones; an artefact that is off stays off."""
    leakage, ghosts, sidelobes = (
        10 ** (_within(rng, each) / 10) for each in (LEAKAGE_DB, GHOSTS_DB, SIDELOBES_DB)
    )
    return replace(
        artefacts,
        leakage=artefacts.leakage * leakage,
        ghosts=artefacts.ghosts * ghosts,
        sidelobes=artefacts.sidelobes * sidelobes,
    )


def _surfaces(surfaces: SurfaceSettings, rng: np.random.Generator) -> SurfaceSettings:
    """Draw roughness around the given one."""
    low, high = portable_math.log(ROUGHNESS)
    height, slope = portable_math.exp(rng.uniform(low, high, 2)).tolist()
    return SurfaceSettings(
        rms_height=min(surfaces.rms_height * height, MOST_FACTOR),
        rms_slope=min(surfaces.rms_slope * slope, MOST_FACTOR),
        scattering=min(surfaces.scattering * _within(rng, SCATTERING), MOST_FACTOR),
    )


def _within(rng: np.random.Generator, limits: tuple[float, float]) -> float:
    return float(rng.uniform(*limits))


def _stretched(pattern: Table, factor: float, end_deg: float) -> Table:
    """Return a pattern widened by a factor, with the same end points."""
    inner = [(angle * factor, level) for angle, level in pattern if abs(angle * factor) < end_deg]
    ends = [row for row in pattern if abs(row[0]) == end_deg]
    return tuple(sorted({*inner, *ends}))


def _blocked(before: Table, rng: np.random.Generator) -> Table:
    """Return the loss by azimuth, in some draws with a sector blocked by an object on the roof."""
    there = rng.random() < BLOCKED_CHANCE
    middle, width, loss = rng.uniform(60, 300), _within(rng, BLOCKED_WIDTH_DEG), _within(rng, BLOCKED_LOSS_DB)
    if not there:
        return before
    edges = middle + width * np.array([-0.6, -0.4, 0.4, 0.6])
    azimuth_deg, loss_db = np.array(before).T
    knots = np.union1d(np.clip(azimuth_deg, 0, 360), [0.0, *edges, 360.0])
    more = np.interp(knots, edges, [0.0, loss, loss, 0.0]) + np.interp(knots, azimuth_deg, loss_db)
    return tuple(zip(knots.tolist(), more.tolist(), strict=True))
