"""Faults of a radar in service, applied to the scans that it wrote: lost data, wrong clocks, dirt, jammers.

They take simulated scans as well as real ones and work on codes and time stamps, without a ray tracer. The
truth of a scan stays that of the drive: pose, time of mid-scan and labels of the cells before the fault.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.numerics.angles import principal_angle
from echoscape.sim.numerics.decibels import power_ratio
from echoscape.sim.receiver.quantiser import LEAST_POWER, codes, middle_power
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.sensor.sensor import Sensor

SECTOR_RAD = math.radians(60)
"""Width of a jammed or blocked sector [rad]."""
LONGEST_JITTER = 2.5
"""Standard deviations at which errors of the clock are cut off, so that scans keep their order."""
_STAGES = {
    "dropped_scans": 311,
    "blank_azimuths": 312,
    "jammed_sector": 313,
    "clock_jitter": 314,
    "gain_step": 315,
    "blocked_sector": 316,
    "zeros": 317,
    "jammed_place": 318,
    "blocked_place": 319,
}
"""Numbers of the random stages."""
_PLACES = {"jammed_sector": "jammed_place", "blocked_sector": "blocked_place"}
"""Stages in which sectors are placed."""


@dataclass(frozen=True, kw_only=True)
class SensorFaults:
    """Strength of each fault; 0 is none."""

    dropped_scans: float = 0.0
    """Share of the scans that are lost, each by itself [0 to 0.9]; the first and the last always arrive."""
    blank_azimuths: float = 0.0
    """Share of the azimuths that are lost, each by itself: all codes 0, marked as not valid [0 to 1]."""
    jammed_sector: float = 0.0
    """Mean power of white noise from another transmitter in a sector of 60 deg, fixed to the car for a drive,
    relative to the noise of the receiver [W/W, up to 1e6]."""
    clock_jitter: float = 0.0
    """Standard deviation of the time stamps of scans [s, up to 0.04]: all azimuths of a scan are stamped too
    early or too late by one draw, cut off at 2.5 standard deviations. Names of files follow the stamps."""
    gain_step: float = 0.0
    """Change of the receiver's gain, noise included, from a scan in the middle third of the drive on
    [dB, -40 to 40]."""
    range_scale: float = 0.0
    """Error of the slope of the sweep: what is at range r appears at r (1 + error) [m/m, -0.2 to 0.2]."""
    blocked_sector: float = 0.0
    """Two-way loss by dirt on the radome in a sector of 60 deg, fixed to the car for a drive
    [dB, up to 100]."""

    def __post_init__(self) -> None:
        """Refuse values that are no strength, naming the fault."""
        for field in fields(self):
            value, (least, most) = getattr(self, field.name), _RANGES[field.name]
            if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
                raise ValueError(f"{field.name} must be a number, got {value!r}")
            if not least <= value <= most:
                raise ValueError(f"{field.name} must be between {least:g} and {most:g}, got {value:g}")
            object.__setattr__(self, field.name, float(value))

    @property
    def any(self) -> bool:
        """Whether there is a fault."""
        return any(getattr(self, field.name) for field in fields(self))


_RANGES = {
    "dropped_scans": (0.0, 0.9),
    "blank_azimuths": (0.0, 1.0),
    "jammed_sector": (0.0, 1e6),
    "clock_jitter": (0.0, 0.04),
    "gain_step": (-40.0, 40.0),
    "range_scale": (-0.2, 0.2),
    "blocked_sector": (0.0, 100.0),
}


class Drive(Protocol):
    """Scans in order of time, such as a list or a `ScanFolder`."""

    def __len__(self) -> int:
        """Return the number of scans."""
        ...

    def __iter__(self) -> Iterator[PolarScan]:
        """Give the scans."""
        ...


def faulty_scans(
    drive: Drive | Sequence[PolarScan], faults: SensorFaults, *, seed: int, sensor: Sensor = CTS350X
) -> Iterator[PolarScan]:
    """Apply faults to the scans of a drive.

    Args:
        drive: The scans in order of time.
        faults: The faults.
        seed: Decides all draws.
        sensor: The radar that took the scans.

    Yields:
        The scans that arrive, each with its faults.

    Raises:
        ValueError: `seed` is negative.
    """
    arrives = arriving(faults, len(drive), seed=seed)
    for index, scan in enumerate(drive):
        if arrives[index]:
            yield with_faults(scan, faults, index=index, count=len(drive), seed=seed, sensor=sensor)


def arriving(faults: SensorFaults, count: int, *, seed: int) -> NDArray[np.bool_]:
    """Draw which scans of a drive arrive.

    Args:
        faults: The faults, of which `dropped_scans` counts.
        count: Scans of the drive.
        seed: Decides the draws.

    Returns:
        Whether each scan arrives (count,); the first and the last do.

    Raises:
        ValueError: `seed` is negative.
    """
    kept = np.array(
        [_rng(seed, "dropped_scans", index).random() >= faults.dropped_scans for index in range(count)], bool
    )
    kept[:1] = kept[-1:] = True
    return kept


def recorded_us(
    timestamp_us: NDArray[np.int64], faults: SensorFaults, *, index: int, seed: int
) -> NDArray[np.int64]:
    """Return the time stamps that a faulty clock gives a scan.

    Args:
        timestamp_us: True times of the azimuths (azimuths,) [us].
        faults: The faults, of which `clock_jitter` counts.
        index: Number of the scan in its drive.
        seed: Decides the draw.

    Returns:
        Recorded times (azimuths,) [us].

    Raises:
        ValueError: `seed` or `index` is negative.
    """
    if not faults.clock_jitter:
        return timestamp_us
    draw = _rng(seed, "clock_jitter", index).standard_normal()
    late_s = faults.clock_jitter * min(max(draw, -LONGEST_JITTER), LONGEST_JITTER)
    return timestamp_us + round(late_s * 1e6)


def with_faults(
    scan: PolarScan,
    faults: SensorFaults,
    *,
    index: int,
    count: int,
    seed: int,
    sensor: Sensor = CTS350X,
) -> PolarScan:
    """Apply faults to a scan, in the order of the signal: radome, jammer, sweep, gain, lost data, clock.

    Args:
        scan: The scan.
        faults: The faults. Whether the scan arrives at all is drawn by `arriving`.
        index: Number of the scan in its drive, from 0.
        count: Scans of the drive.
        seed: Decides all draws; those of a fault do not depend on the other faults.
        sensor: The radar that took the scan, which gives the power of the receiver's noise.

    Returns:
        The scan as it is recorded, with the truth unchanged; the scan itself where there is no fault.

    Raises:
        ValueError: `seed` or `index` is negative.
    """
    written = scan.codes
    if faults.blocked_sector:
        written = _blocked(scan, written, faults.blocked_sector, index=index, seed=seed, sensor=sensor)
    if faults.jammed_sector:
        written = _jammed(scan, written, faults.jammed_sector, index=index, seed=seed, sensor=sensor)
    if faults.range_scale:
        written = _range_scaled(written, faults.range_scale)
    if faults.gain_step and index >= gain_step_scan(count, seed=seed):
        zeros = _rng(seed, "zeros", index)
        written = codes(_powers(written, zeros) * np.float32(power_ratio(faults.gain_step)))
    valid = scan.valid
    if faults.blank_azimuths:
        lost = _rng(seed, "blank_azimuths", index).random(len(valid)) < faults.blank_azimuths
        written, valid = np.where(lost[:, None], np.uint8(0), written), valid & ~lost
    stamps = recorded_us(scan.timestamp_us, faults, index=index, seed=seed)
    return replace(scan, codes=written, valid=valid, timestamp_us=stamps) if faults.any else scan


def gain_step_scan(count: int, *, seed: int) -> int:
    """Draw the scan from which a changed gain holds.

    Args:
        count: Scans of the drive.
        seed: Decides the draw.

    Returns:
        Its number, in the middle third of the drive; 1 or more.

    Raises:
        ValueError: `seed` is negative.
    """
    first = max(1, count // 3)
    return int(_rng(seed, "gain_step").integers(first, max(2 * count // 3, first) + 1))


def sector(scan: PolarScan, fault: str, *, seed: int) -> NDArray[np.bool_]:
    """Draw the azimuths of a jammed or blocked sector, which stays for the whole drive.

    Args:
        scan: Any scan of the drive.
        fault: `jammed_sector` or `blocked_sector`.
        seed: Decides the draw.

    Returns:
        Whether each azimuth lies in the sector (azimuths,).

    Raises:
        ValueError: `seed` is negative.
    """
    middle_rad = _rng(seed, _PLACES[fault]).uniform(0, 2 * math.pi)
    return np.abs(principal_angle(scan.azimuth_rad - middle_rad)) <= SECTOR_RAD / 2


def _rng(seed: int, stage: str, index: int | None = None) -> np.random.Generator:
    """Return the generator of a stage: of the drive, or of a scan."""
    if seed < 0 or (index is not None and index < 0):
        raise ValueError(f"seed and index must be 0 or more, got {seed} and {index}")
    numbers = [seed, _STAGES[stage], *([] if index is None else [index])]
    return np.random.default_rng(np.random.SeedSequence(numbers))


def _powers(written: NDArray[np.uint8], rng: np.random.Generator) -> NDArray[np.float32]:
    """Return the powers behind codes; code 0 stands for any power below the least one, drawn evenly."""
    drawn = rng.random(written.shape, np.float32) * np.float32(LEAST_POWER)
    return np.where(written > 0, middle_power(written), drawn)


def _blocked(
    scan: PolarScan, written: NDArray[np.uint8], loss_db: float, *, index: int, seed: int, sensor: Sensor
) -> NDArray[np.uint8]:
    """Weaken the echoes of a sector; the noise of the receiver, which lies behind the radome, stays.

    A cell holds noise and echo, so that what the loss takes of its noise is added again as exponential noise.
    """
    rows = sector(scan, "blocked_sector", seed=seed)
    rng, left = _rng(seed, "blocked_sector", index), power_ratio(-loss_db)
    noise = rng.standard_exponential((int(rows.sum()), written.shape[1]), np.float32) * sensor.noise_units
    return _with_rows(written, rows, left * _powers(written[rows], rng) + (1 - left) * noise)


def _jammed(
    scan: PolarScan, written: NDArray[np.uint8], ratio: float, *, index: int, seed: int, sensor: Sensor
) -> NDArray[np.uint8]:
    """Add white noise to a sector: exponential power, alike at all ranges."""
    rows = sector(scan, "jammed_sector", seed=seed)
    rng = _rng(seed, "jammed_sector", index)
    noise = rng.standard_exponential((int(rows.sum()), written.shape[1]), np.float32)
    return _with_rows(written, rows, _powers(written[rows], rng) + ratio * sensor.noise_units * noise)


def _with_rows(
    written: NDArray[np.uint8], rows: NDArray[np.bool_], power: NDArray[np.floating]
) -> NDArray[np.uint8]:
    changed = written.copy()
    changed[rows] = codes(power)
    return changed


def _range_scaled(written: NDArray[np.uint8], error: float) -> NDArray[np.uint8]:
    """Move every cell from range r to r (1 + error); beyond the last bin the scan is mirrored."""
    bins = written.shape[1]
    source = np.rint((np.arange(bins) + 0.5) / (1 + error) - 0.5).astype(np.int64)
    return written[:, np.where(source < bins, source, 2 * bins - 1 - source)]
