"""`echoscape fidelity DATA`: compare the statistics of a folder of scans with those of real ones."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro
from rich.console import Console
from rich.table import Table

from echoscape.cli.arguments import in_option_names, parse
from echoscape.cli.progress import ProgressBars

if TYPE_CHECKING:
    from echoscape.eval.fidelity.score import FidelityReport

_STYLES = {"pass": "green", "low": "red", "high": "red", "unknown": "yellow"}
_LEAST_WIDTH = 108
"""Characters that the table needs."""


@dataclass(frozen=True, kw_only=True)
class Options:
    """Compare the statistics of a folder of scans, simulated or real, with published ones of real scans.

    Levels, noise, point spread, strongest returns, peaks, spokes and leakage, each beside the figure that
    real scans of the same sensor have. Writes fidelity.json, fidelity.md and fidelity.png.
    """

    data: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DATA")]
    """Folder of scans: one of echoscape's, Oxford's, MulRan's or Boreas', or of single PNG files of one."""
    reference: Path | None = None
    """Another folder of scans to compare with."""
    out: Path | None = None
    """Folder to write to; by default DATA/fidelity."""


def main(arguments: Sequence[str]) -> int:
    """Run the subcommand.

    Args:
        arguments: The words after `echoscape fidelity`.

    Returns:
        The exit code: 0 measured, whatever the verdicts, 2 bad input.
    """
    try:
        options = parse(Options, prog="echoscape fidelity", words=arguments)
        result, paths = _measured(options)
    except ValueError as error:  # DatasetError is one
        return _refuse(in_option_names(Options, str(error)))
    except OSError as error:
        return _refuse(f"{error.filename or 'OUT'}: {error.strerror or error}")
    console = Console(width=max(Console().width, _LEAST_WIDTH))
    console.print(_table(result))
    if result.judged:
        console.print(f"{result.passed} of {result.judged} statistics pass")
    for path in paths:
        console.print(str(path), soft_wrap=True, highlight=False)
    return 0


def _measured(options: Options) -> tuple["FidelityReport", tuple[Path, ...]]:
    """Measure and write the report."""
    from echoscape.eval.fidelity.report import write_fidelity_report
    from echoscape.eval.fidelity.score import fidelity_report
    from echoscape.sim.datasets.files.output_folder import check_output_folder
    from echoscape.sim.datasets.scan_folder import open_folder

    if options.out:
        check_output_folder(options.out)
    data, reference = open_folder(options.data), options.reference and open_folder(options.reference)
    out = options.out or options.data / "fidelity"
    check_output_folder(out)
    with ProgressBars(Console(stderr=True)) as bars:
        result = fidelity_report(data, reference=reference, progress=bars.report)
    return result, write_fidelity_report(out, result)


def _table(result: "FidelityReport") -> Table:
    from echoscape.eval.fidelity.report import TABLE_COLUMNS, table_row

    table = Table(box=None, padding=(0, 2, 0, 0))
    shown = len(TABLE_COLUMNS) if result.reference else len(TABLE_COLUMNS) - 2
    for name in TABLE_COLUMNS[:shown]:
        table.add_column(
            name, justify="right" if name in ("value", "target", "reference") else "left", no_wrap=True
        )
    for score in result.scores:
        words = table_row(score)[:shown]
        table.add_row(*(f"[{_STYLES[word]}]{word}[/]" if word in _STYLES else word for word in words))
    return table


def _refuse(message: str) -> int:
    print(f"echoscape fidelity: {message}", file=sys.stderr)
    return 2
