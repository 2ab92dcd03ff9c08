"""`echoscape artefacts OUT`: which effect does what to one scan: a picture and a row of a table for each."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro
from rich.console import Console
from rich.table import Table

from echoscape.cli.arguments import parse
from echoscape.cli.progress import ProgressBars
from echoscape.cli.scene_options import ScanOptions, simulation_config
from echoscape.scenes.io.strict_toml import SceneError
from echoscape.sim.datasets.files.atomic_write import DatasetError

if TYPE_CHECKING:
    from echoscape.eval.ablation.run import ArtefactChange


@dataclass(frozen=True, kw_only=True)
class Options:
    """Draw one scan without and with each effect, and tell how many cells each changes."""

    out: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="OUT")]
    """Folder to write: a picture an effect, and artefacts.md. Files of these names are replaced."""
    simulation: Annotated[ScanOptions, tyro.conf.arg(name="")] = field(default_factory=ScanOptions)
    """The dataset that the scan is from: what `echoscape simulate` makes with the same words."""
    scan: int | None = None
    """Number of the scan, from 0; by default the middle one."""
    only: tuple[str, ...] = ()
    """Effects to show, by their names under --artefacts; by default all."""
    scene: Path | None = None
    """TOML file of a scene of one's own, in the place of a preset; its keys: docs/scenes.md."""
    targets: Path | None = None
    """TOML file of test targets to put into the world; its keys: docs/scenes.md."""


def main(arguments: Sequence[str]) -> int:
    """Run the subcommand and return its exit code."""
    try:
        options = parse(Options, prog="echoscape artefacts", words=arguments)
        rows, paths = _written(options)
    except (DatasetError, SceneError, ValueError) as error:
        return _refused(str(error))
    except OSError as error:
        return _refused(f"OUT: {error.strerror or error}")
    console = Console()
    console.print(_table(rows))
    for path in paths:
        console.print(str(path), soft_wrap=True, highlight=False)
    return 0


def _written(options: Options) -> tuple[list["ArtefactChange"], tuple[Path, ...]]:
    """Refuse what cannot be drawn before the ray tracer is loaded, then draw."""
    config = simulation_config(options.simulation, scene=options.scene, targets=options.targets)
    index = config.scans // 2 if options.scan is None else options.scan
    from echoscape.eval.ablation.cases import chosen_cases
    from echoscape.eval.ablation.figures import write_artefacts
    from echoscape.eval.ablation.run import check_index

    check_index(config, index)
    chosen_cases(options.only)
    with ProgressBars(Console(stderr=True)) as bars:
        return write_artefacts(options.out, config, index, names=options.only, progress=bars.report)


def _table(rows: Sequence["ArtefactChange"]) -> Table:
    from echoscape.eval.ablation.run import TABLE_COLUMNS, table_row

    table = Table(*TABLE_COLUMNS, box=None, padding=(0, 2, 0, 0))
    for column in table.columns[2:]:
        column.justify = "right"
    for row in rows:
        table.add_row(*table_row(row))
    return table


def _refused(message: str) -> int:
    print(f"echoscape artefacts: {message}", file=sys.stderr)
    return 2
