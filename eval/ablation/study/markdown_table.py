"""The tables of an ablation in Markdown: one for each method, differences with their intervals."""

from collections.abc import Sequence

from echoscape.eval.ablation.study.notes import cautions, how_to_read
from echoscape.eval.ablation.study.settings import AblationStudy
from echoscape.eval.ablation.study.tables import (
    AblationRow,
    condition_label,
    difference_text,
    failed_text,
    shown_metrics,
)


def table_markdown(study: AblationStudy, rows: Sequence[AblationRow]) -> str:
    """Write a table for each method in Markdown.

    Args:
        study: The ablation.
        rows: Its rows.

    Returns:
        The tables below notes on how to read them. Differences whose interval leaves out 0 are bold.
    """
    parts = [how_to_read(study, mark="Bold")]
    parts += [f"\n**Caution:** {each}." for each in cautions(study, rows)]
    for method in study.methods:
        parts += ["", f"## {method.name}", "", *_method_table(study, rows, method.name)]
    return "\n".join([*parts, ""])


def _method_table(study: AblationStudy, rows: Sequence[AblationRow], method: str) -> list[str]:
    """Return the lines of a method's table."""
    metrics = shown_metrics(rows)
    titles = ["condition", *(f"{each.title} [{each.unit}]" for each in metrics), "failed pairs"]
    lines = [f"| {' | '.join(titles)} |", f"|---|{'---|' * (len(titles) - 1)}"]
    by_place = {(row.condition.name, row.metric.name): row for row in rows if row.method == method}
    for condition in study.conditions:
        found = [by_place.get((condition.name, each.name)) for each in metrics]
        cells = [_cell(row) for row in found]
        some = next(row for row in found if row is not None)
        lines.append(f"| {condition_label(condition)} | {' | '.join(cells)} | {failed_text(some)} |")
    return lines


def _cell(row: AblationRow | None) -> str:
    if row is None:
        return ""
    if not row.condition.levels:
        return f"{row.compared.value:.{row.metric.digits}f}"
    text = difference_text(row)
    return f"**{text}**" if row.compared.is_clear else text
