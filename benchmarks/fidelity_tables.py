"""Puts measured tables into docs/fidelity.md: `python -m benchmarks.fidelity_tables DOC REPORT... ARTEFACTS`.

REPORT is a folder that `echoscape fidelity` wrote, the first of which is told in full; ARTEFACTS one that
`echoscape artefacts` wrote. `make fidelity` runs all three.
"""

import json
import re
import sys
from collections.abc import Sequence
from pathlib import Path


def filled(page: str, name: str, table: str) -> str:
    """Return a page with `table` between the comments that begin and end the place `name`.

    Raises:
        ValueError: the page has no such place, or several.
    """
    place = re.compile(rf"(<!-- {name} -->\n).*?(<!-- end of {name} -->)", re.DOTALL)
    if len(place.findall(page)) != 1:
        raise ValueError(f"the page must have one place {name}, got {len(place.findall(page))}")
    return place.sub(lambda found: f"{found[1]}{table.strip()}\n{found[2]}", page)


def figures(report: Path) -> str:
    """Return the table of a report, without what stands above it."""
    lines = (report / "fidelity.md").read_text().splitlines()
    return "\n".join(line for line in lines if line.startswith("|"))


def seeds(reports: Sequence[Path]) -> str:
    """Return a table with a row a report: how many figures are right, and which are not."""
    lines = ["| scans of | right | what is off |", "|---|---:|---|"]
    for report in reports:
        told = json.loads((report / "fidelity.json").read_text())
        off = [row for row in told["rows"] if row["verdict"] not in (None, "right")]
        words = "; ".join(f"{row['name'].replace('_', ' ')} {row['verdict']}" for row in off)
        lines.append(f"| {told['data']['name']} | {told['right']} of {told['judged']} | {words} |")
    return "\n".join(lines)


def main(arguments: Sequence[str]) -> None:
    """Rewrite the page named first."""
    page, *reports, artefacts = map(Path, arguments)
    text = filled(page.read_text(), "figures", figures(reports[0]))
    text = filled(text, "seeds", seeds(reports))
    page.write_text(filled(text, "changes", (artefacts / "artefacts.md").read_text()))


if __name__ == "__main__":
    main(sys.argv[1:])
