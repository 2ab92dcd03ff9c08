"""What each artefact does to one scan: the scan without it and with it, and how many cells that changes.

The scan is traced once for all but those effects that change where rays go (`sim.simulator.Simulator.scans`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from echoscape.eval.ablation.cases import OWN, Effect, chosen
from echoscape.scenes.driving.ego_drive import EgoDrive
from echoscape.scenes.traffic.plan import plan_traffic
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.setup import build_scene
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.sim.simulator import Simulator

Progress = Callable[[str, int, int], None]
"""Called with a stage (town, scans, pictures), how much of it is done, and how much there is to do."""

CHANGED_DB = 3.0
"""Cells whose level differs by so much count as changed: twice the power."""


HEADS = (
    "effect",
    "strength",
    "mean code",
    f"cells {CHANGED_DB:g} dB weaker [%]",
    "stronger [%]",
    "clipped rows",
)
"""Columns of the table of changes."""


@dataclass(frozen=True, kw_only=True)
class Shown:
    """One effect on one scan: `scans` without it and at each of `strengths`, which begin with 0."""

    effect: Effect
    strengths: tuple[float, ...]
    scans: tuple[PolarScan, ...]


@dataclass(frozen=True, kw_only=True)
class Change:
    """What a strength changes against none.

    mean_code: of the scan with it; weaker, stronger: shares of cells that differ by CHANGED_DB or more
    [percent]; clipped: rows that the converter clips.
    """

    effect: str
    strength: float
    unit: str
    mean_code: float
    weaker: float
    stronger: float
    clipped: int


def shown_effects(
    config: SimulationConfig, index: int, *, names: Sequence[str] = (), progress: Progress | None = None
) -> tuple[Shown, ...]:
    """Make scan `index` of `config` without and with each of the effects `names` (none: all).

    Raises:
        ValueError: there is no such scan or effect.
        SceneError: see `sim.generation.setup.staged`.
    """
    effects = chosen(names)
    check_index(config, index)
    report = progress or (lambda stage, done, total: None)
    simulator = _simulator(config, report)
    strengths = [_strengths(effect, config) for effect in effects]
    settings = [
        replace(config.artefacts, **{effect.name: strength})
        for effect, levels in zip(effects, strengths, strict=True)
        for strength in levels
    ]
    report("scans", 0, 1)
    scans = iter(simulator.scans(index, settings))
    report("scans", 1, 1)
    return tuple(
        Shown(effect=effect, strengths=levels, scans=tuple(next(scans) for _ in levels))
        for effect, levels in zip(effects, strengths, strict=True)
    )


def check_index(config: SimulationConfig, index: int) -> None:
    """Refuse a scan that the config does not have."""
    if not 0 <= index < config.scans:
        raise ValueError(f"scan must be between 0 and {config.scans - 1}, got {index}")


def changes(shown: Shown) -> list[Change]:
    """Return what each strength of an effect changes, the first being none."""
    base = levels_db(shown.scans[0])
    found = []
    for strength, scan in zip(shown.strengths, shown.scans, strict=True):
        more = levels_db(scan) - base
        assert scan.truth is not None
        found.append(
            Change(
                effect=shown.effect.name,
                strength=strength,
                unit=shown.effect.unit,
                mean_code=float(scan.codes.mean()),
                weaker=100 * float(np.mean(more <= -CHANGED_DB)),
                stronger=100 * float(np.mean(more >= CHANGED_DB)),
                clipped=int(scan.truth.saturated.sum()),
            )
        )
    return found


def levels_db(scan: PolarScan) -> np.ndarray:
    """Return the levels (azimuths, bins) float32 of a scan [dB]."""
    return scan.codes.astype(np.float32) / 2


def strength_text(strength: float, unit: str) -> str:
    """Return a strength in words, with its unit."""
    if not strength:
        return "off"
    return f"{strength:.3g} {unit}" if strength < 999 else f"{strength:.0f} {unit}"


def table(rows: Sequence[Change]) -> str:
    """Return the changes as a table in Markdown."""
    lines = [
        f"| {' | '.join(HEADS)} |",
        "|---|---|---:|---:|---:|---:|",
    ]
    lines += [f"| {' | '.join(words(row))} |" for row in rows]
    return "\n".join(lines) + "\n"


def words(row: Change) -> list[str]:
    """Return a row of the table."""
    return [
        row.effect.replace("_", " "),
        strength_text(row.strength, row.unit),
        f"{row.mean_code:.2f}",
        f"{row.weaker:.1f}" if row.strength else "",
        f"{row.stronger:.1f}" if row.strength else "",
        str(row.clipped),
    ]


def _strengths(effect: Effect, config: SimulationConfig) -> tuple[float, ...]:
    """Return 0 and the strengths at which an effect is shown, as numbers."""
    own = getattr(config.artefacts.strengths(config.sensor), effect.name)
    own = own or getattr(Artefacts().strengths(config.sensor), effect.name)
    return (0.0, *(own if strength == OWN else strength for strength in effect.strengths))


def _simulator(config: SimulationConfig, report: Progress) -> Simulator:
    report("town", 0, 1)
    stage = build_scene(config)
    movers = ()
    if isinstance(stage.drive, EgoDrive):
        movers = plan_traffic(stage.town, stage.drive, seed=config.seed, settings=config.traffic)
    report("town", 1, 1)
    return Simulator(
        stage.town,
        stage.drive,
        movers,
        seed=config.seed,
        sensor=config.sensor,
        settings=config.trace,
        artefacts=config.artefacts,
        surfaces=config.surfaces,
    )
