"""Interference: the radars of other cars, whose chirps sweep through the receiver's band.

A chirp of slope S that crosses a sweep of slope s is a beat that runs through the converter's band in fs /
|S - s|, some fraction of a microsecond: by stationary phase its spectrum there is flat, of density A /
sqrt(|S - s|) with the phase of a chirp (Brooker, IEEE Trans. EMC 49(1), 2007). What is a pulse in time is a
raised floor over all ranges of the row. Slopes are taken to differ by so much that a crossing is short.
"""

import math
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.fft import fftfreq, next_fast_len

from echoscape.sim.effects.rain import rain_gain
from echoscape.sim.kinematics.rolling_scan import AzimuthPoses, MoverStates
from echoscape.sim.numerics.fft import ifft
from echoscape.sim.raytracing.intersection import RayScene
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.sensor.antenna import Antenna
from echoscape.sim.sensor.sensor import Sensor

RADAR_STAGE, PHASE_STAGE = 304, 305
"""Numbers of the stages that draw each car's radar, and the phases of its chirps in a scan."""
INTERFERER_REACH_M = 500.0
"""How far away other radars are looked for: one way, power falls with 1/R^2 only [m]."""
_WITH_RADAR = ("car", "van", "truck", "bus")
_BUMPER_HEIGHT_M = 0.5
_HALF_BEAM_DEG = 35.0
"""Half-power half width of a car's forward radar [deg], usual for medium range."""
_LEAST_SENT = 1e-3
"""What it sends to its side and behind over what it sends ahead."""
_FAINT = 1e-3
"""Interference weaker than this against the thermal noise is left out."""


@dataclass(frozen=True, kw_only=True)
class ChirpRadar:
    """A car's own radar: chirps of `slope_hz_s` over `duration_s`, one every `period_s`.

    The first begins at `start_s`, each at the frequency `first_hz`.
    """

    slope_hz_s: float
    duration_s: float
    period_s: float
    start_s: float
    first_hz: float


def drawn_radar(sensor: Sensor, *, seed: int, instance: int) -> ChirpRadar:
    """Draw the radar of the car `instance`: chirps of 20-60 us over 200-900 MHz, as is usual."""
    rng = np.random.default_rng(np.random.SeedSequence([seed, instance, RADAR_STAGE]))
    duration_s, width_hz = rng.uniform(20e-6, 60e-6), rng.uniform(200e6, 900e6)
    return ChirpRadar(
        slope_hz_s=width_hz / duration_s,
        duration_s=duration_s,
        period_s=duration_s * rng.uniform(1.1, 1.6),
        start_s=rng.uniform(0, 1e-3),
        first_hz=sensor.carrier_hz - width_hz / 2 + rng.uniform(-200e6, 200e6),
    )


def crossings(radar: ChirpRadar, sensor: Sensor, times_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return when its chirps cross each row's sweep [s] from the sweep's middle, (rows, K), nan beyond it.

    `times_s` (rows,) are the middles of the sweeps.
    """
    half = sensor.sweep_s / 2
    first = np.floor((times_s - half - radar.start_s) / radar.period_s)
    count = int(sensor.sweep_s / radar.period_s) + 3
    begins = radar.start_s + (first[:, None] + np.arange(count)) * radar.period_s - times_s[:, None]
    offset_hz = sensor.carrier_hz - radar.first_hz
    crossing = (offset_hz + radar.slope_hz_s * begins) / _relative_slope(radar, sensor)[:, None]
    during = (crossing >= begins) & (crossing <= begins + radar.duration_s) & (np.abs(crossing) < half)
    return np.where(during, crossing, np.nan)


def _relative_slope(radar: ChirpRadar, sensor: Sensor) -> NDArray[np.float64]:
    """Return how fast its chirps run through the band of each row (rows,) [Hz/s], whose sweep may fall."""
    return radar.slope_hz_s - np.where(sensor.rising, sensor.slope_hz_s, -sensor.slope_hz_s)


def interference(
    radar: ChirpRadar,
    sensor: Sensor,
    *,
    power_w: NDArray[np.float64],
    times_s: NDArray[np.float64],
    rng: np.random.Generator,
) -> NDArray[np.float32]:
    """Return what a car's radar adds to the beat signals (azimuths, samples) float32 [sqrt(W)].

    power_w (azimuths,): received while its chirp is in the band; times_s (azimuths,): middles of the
    sweeps; `rng` draws the phases. The converter's filter is taken to end sharply at fs / 2.
    """
    when = crossings(radar, sensor, times_s)
    phase = rng.uniform(0, 2 * math.pi, when.shape)
    size = cast("int", next_fast_len(sensor.samples + 64))
    frequency = fftfreq(size, 1 / sensor.sample_hz)
    slope = np.abs(_relative_slope(radar, sensor))
    spectrum = np.zeros((len(when), size), np.complex128)
    for k in range(when.shape[1]):
        heard = np.flatnonzero(np.isfinite(when[:, k]) & (power_w > 0))
        delay = when[heard, k, None] + sensor.samples // 2 / sensor.sample_hz
        turn = np.exp(1j * (phase[heard, k, None] - 2 * math.pi * frequency * delay))
        spectrum[heard] += np.sqrt(2 * power_w[heard, None]) * turn
    for each in np.unique(slope):  # one, or two where sweeps rise and fall by turns
        chirp = np.exp(-1j * math.pi * frequency**2 / each) * (sensor.sample_hz / math.sqrt(each))
        spectrum[slope == each] *= chirp
    return np.ascontiguousarray(ifft(spectrum.astype(np.complex64))[:, : sensor.samples].real)


def other_radars(
    world: RayScene,
    states: MoverStates,
    poses: AzimuthPoses,
    sensor: Sensor,
    antenna: Antenna,
    *,
    times_s: NDArray[np.float64],
    eirp_w: float,
    rain_mm_h: float,
    seed: int,
    scan: int,
) -> NDArray[np.float32]:
    """Return what the radars of all vehicles in sight add to the beat signals (azimuths, samples) [sqrt(W)].

    Each looks forward from its bumper with `eirp_w`, in the receiver's polarisation; times_s (azimuths,):
    middles of the sweeps. A car's draws are its own, whoever else is there.
    """
    total = np.zeros((sensor.azimuths, sensor.samples), np.float32)
    for mover, state in zip(states.movers, states.state, strict=True):
        if mover.prototype.class_name not in _WITH_RADAR:
            continue
        place = _bumper(state, mover.prototype.extent_m[0])
        power = eirp_w * received_share(place, state[:, 3], poses, sensor, antenna)
        if rain_mm_h:  # what rain takes of an amplitude there and back, it takes of a power one way
            power *= rain_gain(np.linalg.norm(place - poses.position, axis=1), rain_mm_h, sensor)
        power *= _in_sight(world, place, poses)
        power[power < sensor.thermal_noise_w * _FAINT] = 0.0
        if power.any():
            radar = drawn_radar(sensor, seed=seed, instance=mover.instance)
            draws = np.random.SeedSequence([seed, scan, PHASE_STAGE, mover.instance])
            rng = np.random.default_rng(draws)
            total += interference(radar, sensor, power_w=power, times_s=times_s, rng=rng)
    return total


def _bumper(state: NDArray[np.float64], length_m: float) -> NDArray[np.float64]:
    """Return where a vehicle's radar is in each row (A, 3) [m]."""
    ahead = np.stack([np.cos(state[:, 3]), np.sin(state[:, 3]), np.zeros(len(state))], axis=1)
    return state[:, :3] + ahead * (length_m / 2 + 0.1) + [0.0, 0.0, _BUMPER_HEIGHT_M]


def received_share(
    place: NDArray[np.float64],
    yaw: NDArray[np.float64],
    poses: AzimuthPoses,
    sensor: Sensor,
    antenna: Antenna,
) -> NDArray[np.float64]:
    """Return received power over EIRP in each row (A,): Friis, g_tx G_rx lambda^2 / ((4 pi R)^2 L).

    place (A, 3) [m] and yaw (A,) [rad] are those of the other radar. L is half the sensor's two-way loss
    [dB], with that of what stands on its own vehicle.
    """
    away = place - poses.position
    range_m = np.linalg.norm(away, axis=1)
    beam = poses.yaw - 2 * math.pi / sensor.azimuths * np.arange(sensor.azimuths)
    bearing = np.arctan2(away[:, 1], away[:, 0])
    elevation = np.arcsin(away[:, 2] / range_m) - math.radians(sensor.mount_tilt_deg)
    azimuth = np.remainder(beam - bearing + math.pi, 2 * math.pi) - math.pi
    gain = np.sqrt(np.interp(azimuth, antenna.azimuth_grid_rad, antenna.azimuth_two_way))
    gain *= antenna.peak_gain * np.interp(elevation, antenna.elevation_grid_rad, antenna.elevation_one_way)
    off_axis = np.remainder(bearing + math.pi - yaw + math.pi, 2 * math.pi) - math.pi
    sent = np.maximum(np.exp2(-((off_axis / math.radians(_HALF_BEAM_DEG)) ** 2)), _LEAST_SENT)
    loss = 10 ** ((sensor.system_loss_db + sensor.row_loss_db) / 20)  # one of two ways
    return sent * gain * (sensor.wavelength_m / (4 * math.pi * range_m)) ** 2 / loss


def _in_sight(world: RayScene, place: NDArray[np.float64], poses: AzimuthPoses) -> NDArray[np.bool_]:
    """Return whether nothing stands between a vehicle's radar and the antenna in each row (A,)."""
    away = poses.position - place
    length = np.linalg.norm(away, axis=1)
    hidden = world.blocked(
        mi.Point3d(np.ascontiguousarray(place.T)),
        mi.Vector3d(np.ascontiguousarray((away / length[:, None]).T)),
        dr.arange(mi.UInt32, len(place)),
        mi.Float(length.astype(np.float32)),
        dr.full(mi.Bool, True, len(place)),
    )
    return ~hidden.numpy()
