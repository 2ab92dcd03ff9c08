"""Puts measured tables into docs/fidelity.md.

    python -m benchmarks.fidelity_tables DOC REPORT [REPORT ...] ARTEFACTS [ARTEFACTS ...]

REPORT is a folder that `echoscape fidelity` wrote, the first of which is listed in full; ARTEFACTS is one
that `echoscape artefacts` wrote, whose rows replace those of the same artefacts in the folders before it.
`make fidelity` runs all three.
"""

import json
import re
import sys
from collections.abc import Sequence
from pathlib import Path


def filled(page: str, name: str, table: str) -> str:
    """Replace a table of a page.

    Args:
        page: Text of the page.
        name: Name of the table in the comments around it, `<!-- name -->` and `<!-- end of name -->`.
        table: The new table.

    Returns:
        Text of the page with the new table.

    Raises:
        ValueError: The page has no such comments, or several.
    """
    place = re.compile(rf"(<!-- {name} -->\n).*?(<!-- end of {name} -->)", re.DOTALL)
    if len(place.findall(page)) != 1:
        raise ValueError(f"the page must have one table {name}, got {len(place.findall(page))}")
    return place.sub(lambda found: f"{found[1]}{table.strip()}\n{found[2]}", page)


def statistics_table(report: Path) -> str:
    """Read the table of a fidelity report.

    Args:
        report: Folder of the report.

    Returns:
        The table in Markdown.
    """
    lines = (report / "fidelity.md").read_text().splitlines()
    return "\n".join(line for line in lines if line.startswith("|"))


def seeds_table(reports: Sequence[Path]) -> str:
    """Make a table of several fidelity reports: how many statistics pass, and which do not.

    Args:
        reports: Folders of the reports.

    Returns:
        The table in Markdown.
    """
    lines = ["| scans of | pass | out of tolerance |", "|---|---:|---|"]
    for report in reports:
        content = json.loads((report / "fidelity.json").read_text())
        failed = [score for score in content["scores"] if score["verdict"] not in (None, "pass")]
        listed = "; ".join(f"{score['name'].replace('_', ' ')} {score['verdict']}" for score in failed)
        lines.append(f"| {content['data']['name']} | {content['passed']} of {content['judged']} | {listed} |")
    return "\n".join(lines)


def changes_table(tables: Sequence[str]) -> str:
    """Join tables of changes: the rows of an artefact are those of the last table that has it.

    Args:
        tables: Tables in Markdown, whose first column names the artefact; the first has all of them.

    Returns:
        The table in Markdown, its artefacts in the order of the first table.
    """
    head = tables[0].splitlines()[:2]
    rows: dict[str, list[str]] = {}
    for table in tables:
        found: dict[str, list[str]] = {}
        for line in table.splitlines()[2:]:
            found.setdefault(line.split("|")[1].strip(), []).append(line)
        rows |= found
    return "\n".join([*head, *(line for lines in rows.values() for line in lines)])


def main(arguments: Sequence[str]) -> None:
    """Rewrite the tables of a page.

    Args:
        arguments: Paths: the page, the reports, and the folders of the artefacts.
    """
    page, *folders = map(Path, arguments)
    artefacts = [folder for folder in folders if (folder / "artefacts.md").exists()]
    reports = [folder for folder in folders if folder not in artefacts]
    tables = [(folder / "artefacts.md").read_text() for folder in artefacts]
    text = filled(page.read_text(), "figures", statistics_table(reports[0]))
    text = filled(text, "seeds", seeds_table(reports))
    page.write_text(filled(text, "changes", changes_table(tables)))


if __name__ == "__main__":
    main(sys.argv[1:])
