"""The artefacts as they are shown on one scan: at which strengths, and on which part of it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

OWN = -1.0
"""Stands for the strength that the config gives an effect, or the default one where it gives none."""


@dataclass(frozen=True, kw_only=True)
class Effect:
    """An artefact as it is shown: at which strengths, and where on the scan.

    name: field of `sim.settings.artefacts.Artefacts`; strengths: those shown beside 0; view: seen from above, as the
    sensor writes it (polar), or those two laid over each other in two colours; span_m: width of the part
    shown [m]; of: the cells whose change decides which part that is, by component, or those of movers;
    movers: whether their boxes are drawn.
    """

    name: str
    unit: str
    text: str
    strengths: tuple[float, ...] = (OWN,)
    view: Literal["above", "polar", "overlay"] = "above"
    span_m: float
    of: Literal["", "direct", "ghost", "sidelobe", "mover"] = ""
    movers: bool = False


EFFECTS = (
    Effect(
        name="speckle",
        unit="W/W",
        span_m=40.0,
        of="direct",
        text="interference of the scatterers of a cell; 0: they add by power",
    ),
    Effect(
        name="ghosts",
        unit="W/W",
        span_m=140.0,
        of="ghost",
        text="paths that met two or three surfaces, at half their length",
    ),
    Effect(
        name="sidelobes",
        unit="W/W",
        span_m=140.0,
        of="sidelobe",
        text="what the beam hears outside its main lobe, and sends there",
    ),
    Effect(
        name="saturation",
        unit="V/V",
        view="polar",
        span_m=163.0,
        text="a converter that clips: harmonics and a raised floor in all of the row",
    ),
    Effect(
        name="phase_noise",
        unit="rad",
        view="polar",
        span_m=163.0,
        text="skirts of strong echoes along their rows, wider the farther they are",
    ),
    Effect(
        name="thermal_noise", unit="K", view="polar", span_m=60.0, text="noise of the receiver, in every cell"
    ),
    Effect(
        name="leakage",
        unit="W/W",
        view="polar",
        span_m=8.0,
        text="transmitter to receiver, and the radome: alike in all rows",
    ),
    Effect(
        name="quantisation",
        unit="V/V",
        view="polar",
        span_m=163.0,
        strengths=(OWN, 2.0**-5),
        text="steps of the converter: the sensor's own, and those of 6 bits",
    ),
    Effect(
        name="motion_distortion",
        unit="s/s",
        view="overlay",
        span_m=200.0,
        movers=True,
        text="each row from where the car is at its time, or all from mid-scan",
    ),
    Effect(
        name="doppler",
        unit="m per m/s",
        view="overlay",
        span_m=30.0,
        of="mover",
        movers=True,
        text="what closes in at v seems nearer by beta v (rising sweeps)",
    ),
    Effect(
        name="movers",
        unit="of 1",
        span_m=80.0,
        of="mover",
        movers=True,
        text="who else is on the road, with shadows and ghosts; boxes: truth",
    ),
    Effect(
        name="rain",
        unit="mm/h",
        strengths=(10.0, 25.0),
        span_m=200.0,
        text="echoes of drops nearby, attenuation far away",
    ),
    Effect(
        name="interference",
        unit="W",
        strengths=(10.0,),
        view="polar",
        span_m=163.0,
        text="chirps of other cars' radars: raised floors of the rows that look at them",
    ),
)
"""The effects, one for each field of `Artefacts`."""


def chosen(names: Sequence[str]) -> tuple[Effect, ...]:
    """Return the effects of these names, in the order of `EFFECTS`; all of them where none is named."""
    known = [effect.name for effect in EFFECTS]
    for name in names:
        if name not in known:
            raise ValueError(f"only must name some of {', '.join(known)}, got {name!r}")
    return tuple(effect for effect in EFFECTS if not names or effect.name in names)
