"""One scan without and with each artefact, and the share of its cells that this changes.

The scan is traced once for all settings but those that change where rays go
(`sim.simulator.Simulator.scans`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from echoscape.eval.ablation.cases import NOMINAL, ArtefactCase, chosen_cases
from echoscape.scenes.core.progress import Progress
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.single_scan import build_simulator
from echoscape.sim.settings.artefacts import Artefacts

CHANGED_DB = 3.0
"""Difference of level from which a cell counts as changed [dB]: twice the power."""

TABLE_COLUMNS = (
    "artefact",
    "strength",
    "mean code",
    f"cells {CHANGED_DB:g} dB weaker [%]",
    "stronger [%]",
    "clipped azimuths",
)
"""Columns of the table of changes."""


@dataclass(frozen=True, kw_only=True)
class CaseScans:
    """One scan under the strengths of one artefact.

    Attributes:
        case: How the artefact is shown.
        strengths: Strengths, the first of them 0.
        scans: The scan at each of them.
        motion_distortion: Motion distortion of each scan, as in `sim.settings.artefacts.Artefacts`.
    """

    case: ArtefactCase
    strengths: tuple[float, ...]
    scans: tuple[PolarScan, ...]
    motion_distortion: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class ArtefactChange:
    """The effect of one strength of an artefact, compared with the scan without it.

    Attributes:
        artefact: Name of the artefact.
        strength: The strength.
        strength_text: The strength with its unit, "off" for 0.
        mean_code: Mean code of the scan [half dB].
        weaker_percent: Cells that are weaker by `CHANGED_DB` or more [%].
        stronger_percent: Cells that are stronger by `CHANGED_DB` or more [%].
        clipped: Azimuths in which the converter clips.
    """

    artefact: str
    strength: float
    strength_text: str
    mean_code: float
    weaker_percent: float
    stronger_percent: float
    clipped: int


def simulate_cases(
    config: SimulationConfig, index: int, *, names: Sequence[str] = (), progress: Progress | None = None
) -> tuple[CaseScans, ...]:
    """Simulate one scan without and with each of some artefacts.

    Args:
        config: The data set that the scan is from.
        index: Number of the scan, from 0.
        names: Names of the artefacts, none for all.
        progress: Called as the work proceeds; stages: town, scans, figures.

    Returns:
        The scans of each artefact.

    Raises:
        ValueError: There is no such scan or artefact.
        SceneError: A file of the scene is not valid, as in `sim.generation.setup.build_scene`.
    """
    cases = chosen_cases(names)
    check_index(config, index)
    report = progress or (lambda stage, done, total: None)
    report("town", 0, 1)
    simulator = build_simulator(config)
    report("town", 1, 1)
    strengths = [_strengths(case, config) for case in cases]
    settings = [
        replace(config.artefacts, **{case.name: strength})
        for case, levels in zip(cases, strengths, strict=True)
        for strength in levels
    ]
    report("scans", 0, 1)
    scans = iter(zip(simulator.scans(index, settings), settings, strict=True))
    report("scans", 1, 1)
    found = []
    for case, levels in zip(cases, strengths, strict=True):
        made, used = zip(*(next(scans) for _ in levels), strict=True)
        distortion = tuple(each.motion_distortion for each in used)
        found.append(CaseScans(case=case, strengths=levels, scans=made, motion_distortion=distortion))
    return tuple(found)


def check_index(config: SimulationConfig, index: int) -> None:
    """Refuse a scan that a data set does not have.

    Args:
        config: The data set.
        index: Number of the scan, from 0.

    Raises:
        ValueError: There is no such scan.
    """
    if not 0 <= index < config.scans:
        raise ValueError(f"scan must be between 0 and {config.scans - 1}, got {index}")


def changes(found: CaseScans) -> list[ArtefactChange]:
    """Measure how each strength of an artefact changes a scan.

    Args:
        found: The scan at each strength.

    Returns:
        One entry for each strength, the first without the artefact.

    Raises:
        ValueError: A scan has no truth.
    """
    base = levels_db(found.scans[0])
    rows = []
    for strength, scan in zip(found.strengths, found.scans, strict=True):
        difference_db = levels_db(scan) - base
        if scan.truth is None:
            raise ValueError("scans of an ablation must have their truth")
        rows.append(
            ArtefactChange(
                artefact=found.case.name,
                strength=strength,
                strength_text=strength_text(found.case, strength),
                mean_code=float(scan.codes.mean()),
                weaker_percent=100 * float(np.mean(difference_db <= -CHANGED_DB)),
                stronger_percent=100 * float(np.mean(difference_db >= CHANGED_DB)),
                clipped=int(scan.truth.saturated.sum()),
            )
        )
    return rows


def levels_db(scan: PolarScan) -> NDArray[np.float32]:
    """Return the levels of a scan.

    Args:
        scan: The scan.

    Returns:
        Levels (azimuths, bins) float32 [dB].
    """
    return scan.codes.astype(np.float32) / np.float32(2)


def strength_text(case: ArtefactCase, strength: float) -> str:
    """Write a strength in the unit that an engineer uses.

    Args:
        case: The artefact.
        strength: Its strength.

    Returns:
        The text, "off" for 0.
    """
    return case.strength_text(strength) if strength else "off"


def markdown_table(rows: Sequence[ArtefactChange]) -> str:
    """Write changes as a table in Markdown.

    Args:
        rows: The changes.

    Returns:
        The table with its head.
    """
    lines = [
        f"| {' | '.join(TABLE_COLUMNS)} |",
        "|---|---|---:|---:|---:|---:|",
    ]
    lines += [f"| {' | '.join(table_row(row))} |" for row in rows]
    return "\n".join(lines) + "\n"


def table_row(row: ArtefactChange) -> list[str]:
    """Write one change as the texts of a row of the table.

    Args:
        row: The change.

    Returns:
        A text for each of `TABLE_COLUMNS`.
    """
    return [
        row.artefact.replace("_", " "),
        row.strength_text,
        f"{row.mean_code:.2f}",
        f"{row.weaker_percent:.1f}" if row.strength else "",
        f"{row.stronger_percent:.1f}" if row.strength else "",
        str(row.clipped),
    ]


def _strengths(case: ArtefactCase, config: SimulationConfig) -> tuple[float, ...]:
    """Return 0 and the strengths at which an artefact is shown."""
    nominal = getattr(config.artefacts.strengths(config.sensor), case.name)
    nominal = nominal or getattr(Artefacts().strengths(config.sensor), case.name)
    return (0.0, *(nominal if strength == NOMINAL else strength for strength in case.strengths))
