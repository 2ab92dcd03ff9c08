"""How each artefact is shown on one scan: at which strengths, and on which part of the scan."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

NOMINAL = -1.0
"""Stands for the strength in the configuration, or the default where the configuration has it off."""


def times(strength: float) -> str:
    """Return a factor over the nominal value as text, such as "×1".

    Args:
        strength: The factor.

    Returns:
        The text.
    """
    return f"×{strength:.3g}"


def percent(strength: float) -> str:
    """Return a share as text, such as "100 %".

    Args:
        strength: The share, 0 to 1.

    Returns:
        The text.
    """
    return f"{100 * strength:.3g} %"


def bits(step: float) -> str:
    """Return the step of a converter as its number of bits, such as "12 bit".

    Args:
        step: Step over the amplitude at which the converter clips [V/V].

    Returns:
        The text.
    """
    return f"{1 - math.log2(step):.3g} bit"


def quantity(unit: str) -> Callable[[float], str]:
    """Return what writes a strength with its unit, such as "10 mm/h".

    Args:
        unit: The unit.

    Returns:
        A function from strength to text.
    """
    return lambda strength: f"{strength:.0f} {unit}" if strength >= 999 else f"{strength:.3g} {unit}"


@dataclass(frozen=True, kw_only=True)
class ArtefactCase:
    """How one artefact is shown.

    Attributes:
        name: Field of `sim.settings.artefacts.Artefacts`.
        text: Caption: what the artefact does to the scan.
        strength_text: Writes a strength other than 0 in the unit that an engineer uses.
        strengths: Strengths that are shown beside 0.
        view: Seen from above, as the sensor writes it (polar), or two scans from above laid over each other.
        span_m: Width of the part shown [m].
        region: Cells whose change decides which part is shown: of a component, of moving objects, or all.
        boxes: Whether the boxes of moving objects are drawn.
    """

    name: str
    text: str
    strength_text: Callable[[float], str] = times
    strengths: tuple[float, ...] = (NOMINAL,)
    view: Literal["above", "polar", "overlay"] = "above"
    span_m: float
    region: Literal["", "direct", "ghost", "sidelobe", "mover"] = ""
    boxes: bool = False


CASES = (
    ArtefactCase(
        name="speckle",
        strength_text=percent,
        span_m=40.0,
        region="direct",
        text="interference of the scatterers within a cell; off: their powers add",
    ),
    ArtefactCase(
        name="ghosts",
        span_m=140.0,
        region="ghost",
        text="paths of two or three bounces, at half their length, with their spokes and sidelobe rings",
    ),
    ArtefactCase(
        name="sidelobes",
        span_m=140.0,
        region="sidelobe",
        text="echoes received outside the main lobe of the antenna",
    ),
    ArtefactCase(
        name="saturation",
        view="polar",
        span_m=163.0,
        text="strong echoes end at a ceiling, and so do their spokes; several add weak products",
    ),
    ArtefactCase(
        name="phase_noise",
        strength_text=quantity("rad"),
        view="polar",
        span_m=163.0,
        text="skirts of strong echoes along their azimuth, stronger for far echoes",
    ),
    ArtefactCase(
        name="thermal_noise",
        strength_text=quantity("K"),
        view="polar",
        span_m=60.0,
        text="receiver noise in every cell",
    ),
    ArtefactCase(
        name="leakage",
        view="polar",
        span_m=8.0,
        text="transmitter-to-receiver coupling and the radome, the same at every azimuth before compression",
    ),
    ArtefactCase(
        name="quantisation",
        strength_text=bits,
        view="polar",
        span_m=163.0,
        strengths=(NOMINAL, 2.0**-5),
        text="analogue-to-digital conversion: the sensor's own, and with 6 bits",
    ),
    ArtefactCase(
        name="motion_distortion",
        strength_text=percent,
        view="overlay",
        span_m=200.0,
        boxes=True,
        text="each azimuth from the car's pose at its own time; off: all from mid-scan",
    ),
    ArtefactCase(
        name="attitude",
        span_m=160.0,
        region="direct",
        text="pitch and roll of the car tilt the beam by up to a degree: what is in it differs by direction",
    ),
    ArtefactCase(
        name="doppler",
        strength_text=quantity("m per m/s"),
        view="overlay",
        span_m=30.0,
        region="mover",
        boxes=True,
        text="range offset by radial speed (rising sweep): objects that approach appear nearer",
    ),
    ArtefactCase(
        name="movers",
        strength_text=percent,
        span_m=40.0,
        region="mover",
        boxes=True,
        text="moving objects, mirror images and shadows; echoes lie off their boxes by the Doppler shift",
    ),
    ArtefactCase(
        name="rain",
        strength_text=quantity("mm/h"),
        strengths=(10.0, 25.0),
        span_m=200.0,
        text="echoes of drops within 100 m cover the ground's and fill shadows; attenuation: at most 2-4 dB",
    ),
    ArtefactCase(
        name="interference",
        strength_text=quantity("W EIRP"),
        strengths=(10.0,),
        view="polar",
        span_m=163.0,
        text="other cars' radars: a higher noise floor in the azimuths that point at them",
    ),
)
"""One case for each field of `Artefacts`, in their order."""


def chosen_cases(names: Sequence[str]) -> tuple[ArtefactCase, ...]:
    """Return the cases of some artefacts.

    Args:
        names: Names of artefacts; none of them for all.

    Returns:
        Their cases, in the order of `CASES`.

    Raises:
        ValueError: There is no artefact of a name.
    """
    known = [case.name for case in CASES]
    for name in names:
        if name not in known:
            raise ValueError(f"only must name some of {', '.join(known)}, got {name!r}")
    return tuple(case for case in CASES if not names or case.name in names)
