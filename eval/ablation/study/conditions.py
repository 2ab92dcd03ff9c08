"""The conditions of an ablation: strengths of artefacts and sensor faults, one at a time or in a grid.

The others are compared with the default condition: the artefacts of the configuration, and no fault.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace

from echoscape.eval.ablation.cases import CASES
from echoscape.sim.effects.sensor_faults import SensorFaults
from echoscape.sim.sensor.sensor import Sensor
from echoscape.sim.settings.artefacts import Artefacts, Strengths

ARTEFACTS = tuple(each.name for each in fields(Artefacts))
FAULTS = tuple(each.name for each in fields(SensorFaults))
"""Names of the strengths that a condition may change."""
DEFAULT_NAME = "default"
"""Name of the condition that the others are compared with."""
SUITES = {
    "stress": (
        "dropped_scans=0.2",
        "blank_azimuths=0.1",
        "jammed_sector=1000",
        "clock_jitter=0.02",
        "gain_step=-10",
        "range_scale=0.01",
        "rain=50",
        "interference=100",
        "blocked_sector=20",
    )
}
"""Suites by name, in the words of `parse_levels`. Stress: a fifth of the scans lost; a tenth of the azimuths
lost; 60 deg jammed, 30 dB above noise; 20 ms of clock jitter; 10 dB less gain from mid-drive on; ranges 1 %
too long; rain of 50 mm/h; a radar of 50 dBm EIRP on every other vehicle; 60 deg blocked by 20 dB."""


@dataclass(frozen=True, kw_only=True)
class Levels:
    """The strengths at which an artefact or fault is studied.

    Attributes:
        name: Name of the artefact or fault.
        strengths: Its strengths; None is the one of the default condition.
    """

    name: str
    strengths: tuple[float | None, ...]


@dataclass(frozen=True, kw_only=True)
class Condition:
    """One setting under which all drives are simulated.

    Attributes:
        levels: Name and strength of what was set; empty for the default condition.
        artefacts: Strengths of the artefacts.
        faults: Strengths of the faults.
    """

    levels: tuple[tuple[str, float], ...] = ()
    artefacts: Artefacts = field(default_factory=Artefacts)
    faults: SensorFaults = field(default_factory=SensorFaults)

    @property
    def name(self) -> str:
        """Name, such as "ghosts=0.5", in a grid "ghosts=0.5,speckle=0"."""
        return ",".join(f"{name}={strength:.6g}" for name, strength in self.levels) or DEFAULT_NAME

    def strengths(self, sensor: Sensor) -> tuple[Strengths, SensorFaults]:
        """Return what decides the scans of the condition: equal for conditions of the same scans.

        Args:
            sensor: The radar.

        Returns:
            Strengths of artefacts as numbers, and faults.
        """
        return self.artefacts.strengths(sensor), self.faults


def parse_levels(word: str) -> Levels:
    """Parse an artefact or fault with its strengths.

    Args:
        word: Such as `ghosts=0,0.5,default,2`; `off` stands for 0, `default` for the default condition's.

    Returns:
        The levels, in the order given.

    Raises:
        ValueError: The word has another form, an unknown name, or a strength that is no number or too large.
    """
    name, equals, text = word.partition("=")
    name = name.strip().replace("-", "_")
    if not equals or not text.strip():
        raise ValueError(f"must be NAME=STRENGTH,STRENGTH,..., got {word!r}")
    if name not in (*ARTEFACTS, *FAULTS):
        known = f"an artefact ({', '.join(ARTEFACTS)}) or a fault ({', '.join(FAULTS)})"
        raise ValueError(f"must name {known}, got {name!r}")
    strengths = tuple(_strength(name, each.strip()) for each in text.split(","))
    for strength in strengths:
        if strength is not None:
            _checked(name, strength)
    return Levels(name=name, strengths=strengths)


def conditions(
    levels: Sequence[Levels], base: Artefacts, sensor: Sensor, *, grid: bool = False
) -> tuple[Condition, ...]:
    """List the conditions of an ablation.

    Args:
        levels: Artefacts and faults with their strengths.
        base: Artefacts of the default condition.
        sensor: The radar, whose own strengths `default` may stand for.
        grid: Whether all strengths of all are combined; else one is changed at a time.

    Returns:
        The default condition, then the others in order.

    Raises:
        ValueError: There are no levels, or a name or a strength is given twice.
    """
    names = [each.name for each in levels]
    if not names:
        raise ValueError("an artefact or a suite must be given")
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"{name} must be given once, got it {names.count(name)} times")
    default = Condition(artefacts=base)
    pairs = [
        [(each.name, _resolved(each.name, one, base, sensor)) for one in each.strengths] for each in levels
    ]
    chosen = itertools.product(*pairs) if grid else [(one,) for each in pairs for one in each]
    found = (default, *(_condition(default, tuple(each)) for each in chosen))
    every = [each.name for each in found]
    for name in every:
        if every.count(name) > 1:
            raise ValueError(f"strengths must differ in their first six digits, got {name} twice")
    return found


def chosen_levels(words: Sequence[str], suite: str | None) -> tuple[Levels, ...]:
    """Parse the levels of an ablation.

    Args:
        words: Artefacts and faults with their strengths, as for `parse_levels`.
        suite: Name of a suite whose levels are added, None for none.

    Returns:
        All levels, those of the suite last; strengths of an artefact that is in a word as well are added to
        those of the word.

    Raises:
        ValueError: A word is not valid, or there is no such suite.
    """
    if suite is not None and suite not in SUITES:
        raise ValueError(f"suite must be one of {', '.join(SUITES)}, got {suite!r}")
    given = [parse_levels(word) for word in words]
    added = [parse_levels(word) for word in SUITES[suite]] if suite else []
    names = {each.name for each in given}
    return (
        *(_with_added(each, added) for each in given),
        *(each for each in added if each.name not in names),
    )


def runs(every: Sequence[Condition], sensor: Sensor) -> dict[str, Condition]:
    """Find the conditions that have to be simulated: one for all that give the same scans.

    Args:
        every: The conditions, the default one first.
        sensor: The radar.

    Returns:
        By the name of each condition the first one of the same scans.
    """
    first: dict[tuple[Strengths, SensorFaults], Condition] = {}
    return {each.name: first.setdefault(each.strengths(sensor), each) for each in every}


def strength_text(name: str, strength: float) -> str:
    """Write a strength in the unit that an engineer uses.

    Args:
        name: Name of the artefact or fault.
        strength: Its strength.

    Returns:
        The text, "off" for 0.
    """
    if not strength:
        return "off"
    for case in CASES:
        if case.name == name:
            return case.strength_text(strength)
    return _FAULT_TEXT[name](strength)


_FAULT_TEXT = {
    "dropped_scans": lambda share: f"{100 * share:.3g} %",
    "blank_azimuths": lambda share: f"{100 * share:.3g} %",
    "jammed_sector": lambda ratio: f"×{ratio:.4g}",
    "clock_jitter": lambda seconds: f"{1e3 * seconds:.3g} ms",
    "gain_step": lambda db: f"{db:+.3g} dB",
    "range_scale": lambda error: f"{100 * error:+.3g} %",
    "blocked_sector": lambda db: f"{db:.3g} dB",
}


def _with_added(levels: Levels, added: Sequence[Levels]) -> Levels:
    """Return levels with those strengths of the same name in `added` that they lack."""
    more = [one for each in added if each.name == levels.name for one in each.strengths]
    lacking = tuple(one for one in more if one not in levels.strengths)
    return replace(levels, strengths=(*levels.strengths, *lacking))


def _strength(name: str, text: str) -> float | None:
    if text in ("default", "off"):
        return None if text == "default" else 0.0
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"{name} must have numbers, off or default as strengths, got {text!r}") from None


def _checked(name: str, strength: float) -> None:
    """Refuse a strength that the artefact or fault cannot have."""
    kind = Artefacts if name in ARTEFACTS else SensorFaults
    kind(**{name: strength})


def _resolved(name: str, strength: float | None, base: Artefacts, sensor: Sensor) -> float:
    """Return a strength as a number."""
    if strength is not None:
        return strength
    return getattr(base.strengths(sensor), name) if name in ARTEFACTS else 0.0


def _condition(default: Condition, levels: tuple[tuple[str, float], ...]) -> Condition:
    set_artefacts = {name: strength for name, strength in levels if name in ARTEFACTS}
    set_faults = {name: strength for name, strength in levels if name in FAULTS}
    return Condition(
        levels=levels,
        artefacts=replace(default.artefacts, **set_artefacts),
        faults=replace(default.faults, **set_faults),
    )
