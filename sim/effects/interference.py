"""Interference: the radars of other vehicles, whose chirps sweep through the band of the receiver.

A chirp of slope S that crosses a sweep of slope s gives a beat that runs through the band of the converter in
fs / |S - s|, a fraction of a microsecond: by stationary phase its spectrum there is flat, of density A /
sqrt(|S - s|) with the phase of a chirp (Brooker, IEEE Trans. EMC 49(1), 2007). A pulse in time is a raised
floor over all ranges of the azimuth. Slopes are assumed to differ so much that a crossing is short.
"""

import math
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.fft import fftfreq, next_fast_len

from echoscape.scenes.core import portable_math
from echoscape.scenes.core.attitude import bearing_and_elevation
from echoscape.sim.effects.rain import rain_gain
from echoscape.sim.kinematics.rolling_scan import AzimuthPoses
from echoscape.sim.numerics.angles import principal_angle
from echoscape.sim.numerics.fft import ifft
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.raytracing.scan_state import ScanState
from echoscape.sim.sensor.antenna import Antenna
from echoscape.sim.sensor.sensor import Sensor

RADAR_STAGE, PHASE_STAGE = 304, 305
"""Numbers of the random stages: the radar of each vehicle, and the phases of its chirps in a scan."""
INTERFERER_REACH_M = 500.0
"""Distance up to which other radars are considered: one way, power falls with 1/R^2 only [m]."""
_WITH_RADAR = ("car", "van", "truck", "bus")
_BUMPER_HEIGHT_M = 0.5
_HALF_BEAM_DEG = 35.0
"""Half-power half width of a forward-looking car radar of medium range [deg]."""
_LEAST_SENT = 1e-3
"""Its gain to the side and backwards over its peak gain."""
_FAINT = 1e-3
"""Interference weaker than this against the thermal noise is left out."""


@dataclass(frozen=True, kw_only=True)
class ChirpRadar:
    """The radar of a vehicle, a sequence of equal chirps.

    Attributes:
        slope_hz_s: Slope of the chirps [Hz/s].
        duration_s: Duration of a chirp [s].
        period_s: Time from chirp to chirp [s].
        start_s: Start of the first chirp [s].
        first_hz: Frequency at which each chirp starts [Hz].
    """

    slope_hz_s: float
    duration_s: float
    period_s: float
    start_s: float
    first_hz: float


def drawn_radar(sensor: Sensor, *, seed: int, instance: int) -> ChirpRadar:
    """Draw the radar of a vehicle: chirps of 20-60 us over 200-900 MHz, as is usual.

    Args:
        sensor: The radar that is interfered with.
        seed: Seed of the simulator.
        instance: Instance id of the vehicle.

    Returns:
        The radar, the same in every scan.
    """
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
    """Return when the chirps of a radar cross the sweep of each azimuth.

    Args:
        radar: The other radar.
        sensor: The radar that is interfered with.
        times_s: Middles of the sweeps (azimuths,) [s].

    Returns:
        Times from the middle of each sweep (azimuths, K) [s]; nan for crossings outside it.
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
    """Return the slope of the chirps relative to the sweep of each azimuth (azimuths,) [Hz/s]."""
    return radar.slope_hz_s - np.where(sensor.rising, sensor.slope_hz_s, -sensor.slope_hz_s)


def interference(
    radar: ChirpRadar,
    sensor: Sensor,
    *,
    power_w: NDArray[np.float64],
    times_s: NDArray[np.float64],
    rng: np.random.Generator,
) -> NDArray[np.float32]:
    """Return what the radar of a vehicle adds to the beat signals.

    The filter of the converter is assumed to end sharply at fs / 2.

    Args:
        radar: The other radar.
        sensor: The radar that is interfered with.
        power_w: Power received at each azimuth while a chirp is in the band (azimuths,) [W].
        times_s: Middles of the sweeps (azimuths,) [s].
        rng: Draws the phases of the chirps.

    Returns:
        Signals (azimuths, samples) float32 [sqrt(W)].
    """
    when = crossings(radar, sensor, times_s)
    phase = rng.uniform(0, 2 * math.pi, when.shape)
    size = cast("int", next_fast_len(sensor.samples + 64))
    frequency = fftfreq(size, 1 / sensor.sample_hz)
    slope = np.abs(_relative_slope(radar, sensor))
    spectrum = np.zeros((len(when), size), np.complex128)
    for k in range(when.shape[1]):
        crossed = np.flatnonzero(np.isfinite(when[:, k]) & (power_w > 0))
        delay = when[crossed, k, None] + sensor.samples // 2 / sensor.sample_hz
        rotation = np.exp(1j * (phase[crossed, k, None] - 2 * math.pi * frequency * delay))
        spectrum[crossed] += np.sqrt(2 * power_w[crossed, None]) * rotation
    for each in np.unique(slope):  # one, or two where rising and falling sweeps alternate
        chirp = np.exp(-1j * math.pi * frequency**2 / each) * (sensor.sample_hz / math.sqrt(each))
        spectrum[slope == each] *= chirp
    return np.ascontiguousarray(ifft(spectrum.astype(np.complex64))[:, : sensor.samples].real)


def other_radars(
    state: ScanState,
    sensor: Sensor,
    antenna: Antenna,
    *,
    eirp_w: float,
    rain_mm_h: float,
    seed: int,
) -> NDArray[np.float32]:
    """Return what the radars of all vehicles in sight add to the beat signals.

    Each looks forward from its bumper, in the polarisation of the receiver. The draws of a vehicle do not
    depend on which others are there.

    Args:
        state: The scan, with the vehicles in reach.
        sensor: The radar that is interfered with.
        antenna: Its patterns.
        eirp_w: Radiated power of each other radar [W].
        rain_mm_h: Rain rate, 0 for none [mm/h].
        seed: Seed of the simulator.

    Returns:
        Signals (azimuths, samples) float32 [sqrt(W)].
    """
    total = np.zeros((sensor.azimuths, sensor.samples), np.float32)
    for mover, motion in zip(state.movers.movers, state.movers.state, strict=True):
        if mover.prototype.class_name not in _WITH_RADAR:
            continue
        bumper = _bumper(motion, mover.prototype.extent_m[0])
        power = eirp_w * received_share(bumper, motion[:, 3], state.poses, sensor, antenna)
        if rain_mm_h:  # two-way loss of amplitude is one-way loss of power
            power *= rain_gain(np.linalg.norm(bumper - state.poses.position, axis=1), rain_mm_h, sensor)
        power *= _in_sight(state, bumper)
        power[power < sensor.thermal_noise_w * _FAINT] = 0.0
        if power.any():
            radar = drawn_radar(sensor, seed=seed, instance=mover.instance)
            draws = np.random.SeedSequence([seed, state.index, PHASE_STAGE, mover.instance])
            total += interference(
                radar,
                sensor,
                power_w=power,
                times_s=state.revolution.times_s,
                rng=np.random.default_rng(draws),
            )
    return total


def _bumper(motion: NDArray[np.float64], length_m: float) -> NDArray[np.float64]:
    """Return the position of the radar of a vehicle at each azimuth (A, 3) [m]."""
    ahead = np.stack([np.cos(motion[:, 3]), np.sin(motion[:, 3]), np.zeros(len(motion))], axis=1)
    return motion[:, :3] + ahead * (length_m / 2 + 0.1) + [0.0, 0.0, _BUMPER_HEIGHT_M]


def received_share(
    position: NDArray[np.float64],
    yaw: NDArray[np.float64],
    poses: AzimuthPoses,
    sensor: Sensor,
    antenna: Antenna,
) -> NDArray[np.float64]:
    """Return received power over radiated power (EIRP), g_tx G_rx lambda^2 / ((4 pi R)^2 L) (Friis).

    L is half of the two-way loss of the sensor [dB], that of objects on its own vehicle included.

    Args:
        position: Position of the other radar at each azimuth (A, 3) [m].
        yaw: Heading of the other radar at each azimuth (A,) [rad].
        poses: The antenna at each azimuth.
        sensor: The radar that is interfered with.
        antenna: Its patterns.

    Returns:
        Shares (A,) [W/W].
    """
    away = position - poses.position
    range_m = np.linalg.norm(away, axis=1)
    right, elevation = bearing_and_elevation(poses.axes, away)
    azimuth = principal_angle(right - sensor.azimuth_rad)
    elevation -= math.radians(sensor.mount_tilt_deg)
    gain = np.sqrt(np.interp(azimuth, antenna.azimuth_grid_rad, antenna.azimuth_two_way))
    gain *= antenna.peak_gain * np.interp(elevation, antenna.elevation_grid_rad, antenna.elevation_one_way)
    off_axis = principal_angle(portable_math.arctan2(-away[:, 1], -away[:, 0]) - yaw)
    sent = np.maximum(np.exp2(-((off_axis / math.radians(_HALF_BEAM_DEG)) ** 2)), _LEAST_SENT)
    loss = 10 ** ((sensor.system_loss_db + sensor.azimuth_loss_db) / 20)  # half of the two-way loss
    return sent * gain * (sensor.wavelength_m / (4 * math.pi * range_m)) ** 2 / loss


def _in_sight(state: ScanState, position: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return whether nothing stands between the radar of a vehicle and the antenna at each azimuth (A,)."""
    away = state.poses.position - position
    length = np.linalg.norm(away, axis=1)
    hidden = state.ray_scene.occluded(
        mi.Point3d(np.ascontiguousarray(position.T)),
        mi.Vector3d(np.ascontiguousarray((away / length[:, None]).T)),
        dr.arange(mi.UInt32, len(position)),
        mi.Float(length.astype(np.float32)),
        dr.full(mi.Bool, True, len(position)),
    )
    return ~hidden.numpy()
