"""The description of a spinning FMCW radar: every number in which sensors differ.

Derived quantities are properties, so that no number is given twice.
"""

import math
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.numerics.constants import BOLTZMANN, SPEED_OF_LIGHT, STANDARD_TEMPERATURE
from echoscape.sim.sensor.antenna_pattern import directivity_db

Table = tuple[tuple[float, float], ...]
"""A function of one variable as (x, y) rows with increasing x."""
_GAIN_SLACK_DB = 0.5
"""How far a stated gain may exceed the directivity of its patterns: the accuracy of the tables."""


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """A spinning FMCW radar with one linear sweep at every azimuth.

    Angles in tables are degrees and gains dB, as data sheets have them; everything else is SI.
    """

    name: str
    """Name of the sensor."""
    azimuths: int
    """Azimuths of a scan."""
    bins: int
    """Range bins of an azimuth."""
    bin_m: float
    """Range step of a bin [m]."""
    rotation_hz: float
    """Revolutions a second."""
    rotation_jitter_s: float
    """Standard deviation of the duration of a revolution [s]."""
    encoder_per_turn: int
    """Encoder counts of a revolution."""
    encoder_first: int
    """Encoder count of the first azimuth, which looks along 2 pi `encoder_first` / `encoder_per_turn`."""
    carrier_hz: float
    """Centre frequency of the sweep [Hz]."""
    bandwidth_hz: float
    """Swept bandwidth within the sampled part of the sweep [Hz]."""
    doppler_beta_s: float
    """Range shift by radial speed of an approaching target, carrier x sweep time / bandwidth [s]."""
    chirps: Literal["rising", "falling", "alternating"]
    """Direction of the sweeps; with rising ones an approaching target appears nearer, with falling ones
    farther; alternating ones begin a scan with a falling sweep."""
    fft_size: int
    """Length of the zero-padded range FFT, a power of two."""
    window: Literal["hann", "hamming", "blackman", "boxcar"]
    """Window over the sweep's samples."""
    sweep_ripple_db: Table
    """Ripple of the amplitude over a sweep: level of its sidelobes [dB] by its periods in a sweep; may be
    empty."""
    adc_bits: int
    """Resolution of the analogue-to-digital converter."""
    full_scale_db: float
    """Power that a sine at the converter's clipping level has in the written scan [dB above one unit]."""
    compression_dbm: float
    """1-dB compression point: received power at which a single echo is written 1 dB too weak [dBm]."""
    tx_power_w: float
    """Transmitted power [W]."""
    antenna_gain_db: float
    """One-way peak gain [dBi]: the directivity of the patterns, or less where it includes losses."""
    system_loss_db: float
    """Two-way losses of dish, feed, radome and mixer that the gain does not include [dB]."""
    noise_figure_db: float
    """Noise figure of the receiver [dB]."""
    noise_units: float
    """Mean of the thermal noise in the integer power at the quantiser's input."""
    range_gain_db: Table
    """Gain of the receiver by range [m], [dB]."""
    azimuth_pattern_db: Table
    """Two-way azimuth pattern by offset from the beam's middle [deg], [dB], symmetric, antenna at rest."""
    elevation_pattern_db: Table
    """One-way elevation pattern by elevation above the beam's middle [deg], [dB]."""
    phase_noise_dbc_hz: float
    """Phase-noise density below the corner [dBc/Hz]."""
    phase_noise_corner_hz: float
    """Corner above which the density falls with 1/f^2 [Hz]."""
    leakage_dbm: Table
    """Transmit-receive leakage and radome echoes by range [m], received power [dBm]."""
    mount_height_m: float
    """Height of the antenna above the road [m]."""
    mount_tilt_deg: float
    """Elevation of the beam's middle above the horizon [deg]."""
    blocking_db: Table
    """Two-way loss by objects on the vehicle, by azimuth clockwise from ahead, 0 to 360 [deg], [dB]."""
    epoch_us: int
    """Time stamp of the start of every simulated drive [us since 1970]; loaders of Boreas go by the date."""

    def __post_init__(self) -> None:
        """Refuse values that no radar can have, naming the field."""
        if not self.name.strip():
            raise ValueError(f"name must not be empty, got {self.name!r}")
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, (int, float)) and not math.isfinite(value):
                raise ValueError(f"{field.name} must be finite, got {value}")
            if isinstance(value, tuple) and (value or field.name != "sweep_ripple_db"):
                _check_table(field.name, value)
        for name in _POSITIVE:
            if getattr(self, name) <= 0:
                raise ValueError(f"{name} must be above 0, got {getattr(self, name)}")
        for name, (least, most) in _RANGES.items():
            if not least <= getattr(self, name) <= most:
                raise ValueError(
                    f"{name} must be between {least:g} and {most:g}, got {getattr(self, name):g}"
                )
        directivity = directivity_db(self.azimuth_pattern_db, self.elevation_pattern_db)
        if self.antenna_gain_db > directivity + _GAIN_SLACK_DB:
            raise ValueError(
                f"antenna_gain_db must be at most {directivity:.2f}, which azimuth_pattern_db and "
                f"elevation_pattern_db integrate to, got {self.antenna_gain_db}: more power than is fed in"
            )
        if min(loss_db for _, loss_db in self.blocking_db) < 0:
            raise ValueError(f"blocking_db must be losses of 0 or more, got {self.blocking_db}")
        if self.rotation_jitter_s < 0:
            raise ValueError(f"rotation_jitter_s must be 0 or more, got {self.rotation_jitter_s}")
        if not 0 <= self.encoder_first < self.encoder_per_turn <= _ENCODER_MOST:
            raise ValueError(
                f"encoder_first must be between 0 and encoder_per_turn, at most {_ENCODER_MOST}, "
                f"got {self.encoder_first} and {self.encoder_per_turn}"
            )
        if self.encoder_per_turn < self.azimuths:
            raise ValueError(
                f"encoder_per_turn must be azimuths ({self.azimuths}) or more, got {self.encoder_per_turn}"
            )
        for name, choices in _CHOICES.items():
            if getattr(self, name) not in choices:
                raise ValueError(f"{name} must be one of {', '.join(choices)}, got {getattr(self, name)!r}")
        if self.fft_size & (self.fft_size - 1) or self.fft_size < 2 * self.bins:
            raise ValueError(
                f"fft_size must be a power of two of {2 * self.bins} or more, got {self.fft_size}"
            )
        if not 8 <= self.samples <= self.fft_size // 4:
            raise ValueError(
                f"bandwidth_hz of {self.bandwidth_hz:g} gives {float(self.samples):g} samples a sweep; "
                f"between 8 and {self.fft_size // 4} are possible with bins of {self.bin_m} m"
            )

    @property
    def rising(self) -> NDArray[np.bool_]:
        """Whether the sweep of each azimuth rises (azimuths,)."""
        if self.chirps == "alternating":
            return np.arange(self.azimuths) % 2 == 1
        return np.full(self.azimuths, self.chirps == "rising")

    @property
    def doppler_shift_s(self) -> NDArray[np.float64]:
        """Range shift by closing speed at each azimuth (azimuths,) [s]: below 0 where the sweep rises."""
        return np.where(self.rising, -self.doppler_beta_s, self.doppler_beta_s)

    @property
    def azimuth_loss_db(self) -> NDArray[np.float64]:
        """Two-way loss by objects on the vehicle at each azimuth (azimuths,) [dB]."""
        azimuth_deg, loss_db = np.array(self.blocking_db).T
        return np.interp(np.degrees(self.azimuth_rad), azimuth_deg, loss_db)

    @property
    def encoder(self) -> NDArray[np.uint16]:
        """Encoder count of each azimuth (azimuths,): even steps of a revolution, rounded down."""
        steps = np.arange(self.azimuths) * self.encoder_per_turn // self.azimuths
        return ((self.encoder_first + steps) % self.encoder_per_turn).astype(np.uint16)

    @property
    def first_azimuth_rad(self) -> float:
        """Direction of the first azimuth, clockwise from ahead, by its encoder count [rad]."""
        return 2 * math.pi * self.encoder_first / self.encoder_per_turn

    @property
    def azimuth_step_rad(self) -> float:
        """Angle from one azimuth to the next [rad]."""
        return 2 * math.pi / self.azimuths

    @property
    def seam_rad(self) -> float:
        """Azimuth at which a revolution begins and ends, half a step before the first azimuth [rad]."""
        return self.first_azimuth_rad - self.azimuth_step_rad / 2

    @property
    def azimuth_rad(self) -> NDArray[np.float64]:
        """Directions of the azimuths, clockwise from ahead (azimuths,) [rad], 0 to 2 pi.

        Evenly spaced from the first one; where the encoder has no whole counts for that, its counts lie up to
        one below.
        """
        steps = np.arange(self.azimuths, dtype=np.float64)
        return (self.first_azimuth_rad + self.azimuth_step_rad * steps) % (2 * math.pi)

    @property
    def wavelength_m(self) -> float:
        """Wavelength of the carrier [m]."""
        return SPEED_OF_LIGHT / self.carrier_hz

    @property
    def sweep_s(self) -> float:
        """Duration of the sampled sweep T = beta B / f0 [s]."""
        return self.doppler_beta_s * self.bandwidth_hz / self.carrier_hz

    @property
    def slope_hz_s(self) -> float:
        """Sweep rate B / T [Hz/s]."""
        return self.bandwidth_hz / self.sweep_s

    @property
    def sample_hz(self) -> float:
        """Sampling rate that puts `fft_size` points `bin_m` apart: f_b = 2 B r / (c T) [Hz]."""
        return self.fft_size * self.bin_m * 2 * self.slope_hz_s / SPEED_OF_LIGHT

    @property
    def samples(self) -> int:
        """Samples in a sweep, even."""
        return 2 * int(self.sample_hz * self.sweep_s / 2)

    @property
    def resolution_m(self) -> float:
        """Range resolution cell c / 2B [m]."""
        return SPEED_OF_LIGHT / (2 * self.bandwidth_hz)

    @property
    def azimuth_period_s(self) -> float:
        """Nominal time from azimuth to azimuth [s]."""
        return 1 / (self.rotation_hz * self.azimuths)

    @property
    def range_m(self) -> float:
        """End of the last bin [m]."""
        return self.bins * self.bin_m

    @property
    def noise_temperature_k(self) -> float:
        """Noise temperature of the receiver T0 F [K]."""
        return STANDARD_TEMPERATURE * 10 ** (self.noise_figure_db / 10)

    @property
    def phase_noise_rad(self) -> float:
        """Standard deviation of the synthesiser's phase [rad]: one-sided density 2 L0 / (1 + (f / fc)^2)."""
        level, corner_hz = 10 ** (self.phase_noise_dbc_hz / 10), self.phase_noise_corner_hz
        return math.sqrt(2 * level * corner_hz * math.atan(self.sample_hz / 2 / corner_hz))

    @property
    def thermal_noise_w(self) -> float:
        """Thermal noise k T0 F in the band of the samples, fs / 2 [W]."""
        figure = 10 ** (self.noise_figure_db / 10)
        return BOLTZMANN * STANDARD_TEMPERATURE * figure * self.sample_hz / 2


_ENCODER_MOST = 65_536
_RANGES = {
    "azimuths": (1, 10_000),
    "bins": (16, 65_536),
    "bin_m": (1e-3, 10),
    "rotation_hz": (1e-6, 100),
    "carrier_hz": (1e9, 1e12),
    "bandwidth_hz": (1e6, 1e11),
    "doppler_beta_s": (1e-6, 10),
    "fft_size": (32, 2**18),
    "adc_bits": (1, 16),
    "full_scale_db": (-50, 200),
    "compression_dbm": (-200, 200),
    "tx_power_w": (1e-9, 1e6),
    "antenna_gain_db": (-10, 80),
    "system_loss_db": (-20, 120),
    "noise_figure_db": (0, 60),
    "noise_units": (1e-3, 1e6),
    "phase_noise_dbc_hz": (-250, 0),
    "phase_noise_corner_hz": (1, 1e10),
    "mount_height_m": (0.1, 100),
    "mount_tilt_deg": (-89, 89),
    "epoch_us": (10**15, 4 * 10**15),
}
"""Limits of a radar's numbers, beyond which arithmetic or memory fails; drives begin from 2001 to 2096, in
which microseconds and MulRan's nanoseconds are told apart."""

_POSITIVE = (
    "azimuths",
    "bins",
    "bin_m",
    "rotation_hz",
    "encoder_per_turn",
    "carrier_hz",
    "bandwidth_hz",
    "doppler_beta_s",
    "adc_bits",
    "tx_power_w",
    "noise_units",
    "phase_noise_corner_hz",
    "mount_height_m",
)

_CHOICES = {
    "chirps": ("rising", "falling", "alternating"),
    "window": ("hann", "hamming", "blackman", "boxcar"),
}


def _check_table(name: str, rows: tuple) -> None:
    """Raise ValueError unless `rows` are finite (x, y) pairs with increasing x."""
    if len(rows) < 2 or any(len(row) != 2 for row in rows):
        raise ValueError(f"{name} must hold two or more (x, y) rows, got {len(rows)}")
    if not all(math.isfinite(value) for row in rows for value in row):
        raise ValueError(f"{name} must be finite")
    if any(b[0] <= a[0] for a, b in pairwise(rows)):
        raise ValueError(f"{name} must have increasing first values")
