"""What a reader of an ablation has to know: how its tables are read, and what its numbers are not worth."""

from collections import defaultdict
from collections.abc import Sequence

from echoscape.eval.ablation.study.settings import AblationStudy
from echoscape.eval.ablation.study.tables import AblationRow, failed_text, shown_metrics
from echoscape.eval.statistics.intervals import CONFIDENCE, FEWEST, caution


def how_to_read(study: AblationStudy, *, mark: str) -> str:
    """Say what the numbers of a table are.

    Args:
        study: The ablation.
        mark: How the table marks clear differences, such as "Bold".

    Returns:
        Sentences. The mark is explained only with as many drives as a clear difference needs.
    """
    drives = len(study.drives)
    marked = "" if caution(drives) else f"{mark}: the interval, of {FEWEST} drives or more, leaves out 0. "
    return (
        f"{drives} {'drive' if drives == 1 else 'drives'} of {study.scans} scans. The first row of a method "
        "holds its values under the default condition, means over drives; the others hold differences from "
        f"it on the same drives and scans, with {100 * CONFIDENCE:g} % intervals from a bootstrap over "
        f"drives. {marked}Failed pairs count as no motion."
    )


def cautions(study: AblationStudy, rows: Sequence[AblationRow]) -> list[str]:
    """Say what makes differences or intervals worth less than they look.

    Args:
        study: The ablation.
        rows: Its rows.

    Returns:
        Sentences without their full stops: on few drives, drives of one seed, and methods that fail already
        under the default condition.
    """
    few = caution(len(study.drives))
    return [*([few] if few else []), *_same_seeds(study), *_failing(study, rows)]


def chance_note(rows: Sequence[AblationRow]) -> str | None:
    """Say how many intervals would leave out 0 by chance alone.

    Args:
        rows: The rows of an ablation.

    Returns:
        A sentence, None where all intervals are of too few drives to be called clear.
    """
    shown = [row for row in rows if row.condition.levels and row.metric in shown_metrics(rows)]
    compared = [row.compared for row in shown if row.compared.drives >= FEWEST]
    if not compared:
        return None
    clear = sum(each.is_clear for each in compared)
    return (
        f"{clear} of {len(compared)} intervals in these tables leave out 0; if no condition had any effect, "
        f"some {(1 - CONFIDENCE) * len(compared):.0f} of them would by chance."
    )


def _same_seeds(study: AblationStudy) -> list[str]:
    """Name the drives whose faults are the same draws, if faults are studied."""
    if not any(each.faults.any for each in study.conditions):
        return []
    by_seed: dict[int, list[str]] = defaultdict(list)
    for drive in study.drives:
        by_seed[drive.config.seed].append(drive.name)
    return [
        f"{' and '.join(names)} have the same seed, {seed}, which alone decides the draws of sensor faults: "
        "they lose the same scans and azimuths, so that they do not count as independent drives; give each "
        "world a seed of its own"
        for seed, names in by_seed.items()
        if len(names) > 1
    ]


def _failing(study: AblationStudy, rows: Sequence[AblationRow]) -> list[str]:
    """Name the methods of which pairs fail under the default condition."""
    default = {row.method: row for row in rows if not row.condition.levels}
    return [
        f"of the pairs of {each.name}, {failed_text(default[each.name])} fail under the default condition "
        "already and count as no motion: no difference shows what another condition costs them"
        for each in study.methods
        if default[each.name].failed
    ]
