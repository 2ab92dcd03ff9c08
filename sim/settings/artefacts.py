"""Artefacts of a real radar, each with a strength in a physical unit; 0 is off.

Switching one off changes only its own effect: the town, the echoes and the random draws of the others stay.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from echoscape.scenes.core.checks import check_kind
from echoscape.sim.sensor.sensor import Sensor

MOST_MM_H = 150.0
"""Rain rate up to which both sources of the rain model have measurements [mm/h]."""


@dataclass(frozen=True, kw_only=True)
class Artefacts:
    """Strength of each artefact; None is the sensor's own, a bool switches between the default and 0.

    Echoes are traced down to a floor below the noise before they are scaled: strengths above 1 raise the
    echoes that were found, and find no weaker ones.
    """

    speckle: float = 1.0
    """Share of the echoes' power that interferes; the rest is summed without phase [W/W, 0 to 1]."""
    ghosts: float = 1.0
    """Power of echoes that met more than one surface, relative to the physical one [W/W]."""
    sidelobes: float = 1.0
    """Power received outside the beam's main lobe, relative to the physical one [W/W]."""
    saturation: float = 1.0
    """Amplitude in the receiver relative to the one for which it is set [V/V]. Below 1 the input is weakened:
    compression sets in that much later. Above 1 the gain behind the compressing stage is raised: the
    converter clips that much earlier, and its steps are that much finer. The CTS350-X clips from 1.3 on."""
    phase_noise: float | None = None
    """Phase of the synthesiser, standard deviation [rad]; by default the sensor's own, 0.058 rad for the
    CTS350-X."""
    thermal_noise: float | None = None
    """Noise temperature of receiver and antenna together, T0 F [K]; by default the sensor's own, 9171 K for
    the CTS350-X."""
    leakage: float = 1.0
    """Power of transmit-receive leakage and radome echoes relative to the sensor's [W/W]."""
    quantisation: float | None = None
    """Step of the analogue-to-digital converter relative to the amplitude at which it clips [V/V, up to 0.5];
    by default the sensor's own, 1/2048 V/V for the CTS350-X."""
    motion_distortion: float = 1.0
    """Share of a revolution over which its azimuths spread; 0: all from the pose at mid-scan [s/s, 0 to 1].
    Time stamps and true poses stay those of the drive."""
    attitude: float = 1.0
    """Pitch and roll of the car body relative to those of its drive [rad/rad, 0 to 5]; 0: it stays level."""
    doppler: float | None = None
    """Shift in range by radial speed [m per m/s]; by default the sensor's own, 0.049 m per m/s for the
    CTS350-X."""
    movers: float = 1.0
    """Share of the moving objects that are present [0 to 1]."""
    rain: float = 0.0
    """Rain rate: attenuation (ITU-R P.838) and echoes of drops [mm/h, up to 150]."""
    interference: float = 0.0
    """Radiated power (EIRP) of a forward-looking 76-77 GHz radar on every other vehicle [W]."""

    def __post_init__(self) -> None:
        """Convert bools to strengths; refuse values that are no strength, naming the artefact."""
        for field in fields(self):
            value: Any = getattr(self, field.name)
            if isinstance(value, (bool, np.bool_)):
                value = _switched(field.name, field.default, on=bool(value))
                object.__setattr__(self, field.name, value)
            if value is None and field.default is None:
                continue
            if not isinstance(value, (int, float, np.integer, np.floating)):
                raise ValueError(f"{field.name} must be a number or a bool, got {value!r}")
            most = _MOST.get(field.name, math.inf)
            if not (math.isfinite(value) and 0 <= value <= most):
                limit = "finite and 0 or more" if most == math.inf else f"between 0 and {most:g}"
                raise ValueError(f"{field.name} must be {limit}, got {value}")
            object.__setattr__(self, field.name, float(value))

    def strengths(self, sensor: Sensor) -> "Strengths":
        """Convert all strengths to numbers.

        Args:
            sensor: The radar, whose own strength holds where None is given.

        Returns:
            The strengths.
        """
        own = {
            "phase_noise": sensor.phase_noise_rad,
            "thermal_noise": sensor.noise_temperature_k,
            "quantisation": 2.0 ** (1 - sensor.adc_bits),
            "doppler": sensor.doppler_beta_s,
        }
        given = {field.name: getattr(self, field.name) for field in fields(self)}
        return Strengths(**{name: own[name] if value is None else value for name, value in given.items()})

    def without(self, *names: str) -> "Artefacts":
        """Switch artefacts off.

        Args:
            names: Names of the artefacts.

        Returns:
            The artefacts with these strengths at 0.

        Raises:
            ValueError: There is no artefact of a name.
        """
        known = [field.name for field in fields(self)]
        for name in names:
            if name not in known:
                raise ValueError(f"an artefact must be one of {', '.join(known)}, got {name!r}")
        return replace(self, **dict.fromkeys(names, 0.0))


def _switched(name: str, default: Any, *, on: bool) -> float | None:
    """Return the strength that a switch stands for; raise ValueError where on has no strength."""
    if on and default == 0:
        raise ValueError(f"{name} must be a number, as it is off by default, got True")
    return default if on else 0.0


_MOST = {
    "speckle": 1.0,
    "quantisation": 0.5,
    "motion_distortion": 1.0,
    "attitude": 5.0,
    "movers": 1.0,
    "rain": MOST_MM_H,
}


@dataclass(frozen=True, kw_only=True)
class Strengths:
    """The strengths of `Artefacts` for a sensor, in the same units."""

    speckle: float
    ghosts: float
    sidelobes: float
    saturation: float
    phase_noise: float
    thermal_noise: float
    leakage: float
    quantisation: float
    motion_distortion: float
    attitude: float
    doppler: float
    movers: float
    rain: float
    interference: float

    @property
    def linear(self) -> bool:
        """Whether the receiver is linear and no other radar transmits, so that no cell is part of a spoke."""
        return not (self.saturation or self.phase_noise or self.quantisation or self.interference)


def artefacts_from(given: Artefacts | Mapping[str, float | bool | None] | None) -> Artefacts:
    """Convert artefacts that are given in one of several forms.

    Args:
        given: The artefacts, strengths by name (the others are the defaults), or None for the defaults.

    Returns:
        The artefacts.

    Raises:
        ValueError: There is no artefact of a name, or it cannot have such a strength.
        TypeError: They are neither `Artefacts` nor strengths by name.
    """
    check_kind(Artefacts | Mapping | None, artefacts=given)
    if given is None or isinstance(given, Artefacts):
        return given or Artefacts()
    known = [each.name for each in fields(Artefacts)]
    for name in given:
        if name not in known:
            raise ValueError(f"an artefact must be one of {', '.join(known)}, got {name!r}")
    strengths: dict[str, Any] = dict(given)
    return Artefacts(**strengths)
