"""`echoscape artefacts OUT`: what each artefact does to one scan: a figure and a row of a table."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro
from rich.console import Console
from rich.table import Table

from echoscape.cli.arguments import ArgumentsError, in_option_names, option_value, parse
from echoscape.cli.options.backend_option import load_ray_tracer
from echoscape.cli.options.scene_options import ScanOptions, simulation_config
from echoscape.cli.progress import ProgressBars
from echoscape.scenes.io.strict_toml import SceneError
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.raytracing.backend import Backend, selected_backend
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.sensor.registry import sensor_from

if TYPE_CHECKING:
    from echoscape.eval.ablation.run import ArtefactChange


@dataclass(frozen=True, kw_only=True)
class Options:
    """Draw one scan without and with each artefact, and count the cells that each changes."""

    out: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="OUT")]
    """Folder to write: a figure per artefact, and artefacts.md. Files of these names are replaced."""
    simulation: Annotated[ScanOptions, tyro.conf.arg(name="")] = field(default_factory=ScanOptions)
    """The data set that the scan is from: what `echoscape simulate` makes with the same options."""
    radar: str = CTS350X.name
    """The radar: cts350x (Oxford), cir204 (MulRan), cir304 (Boreas), cir304_rt (Boreas-RT), cts_small
    (for tests), or a TOML file with the keys of docs/sensors.md. --sensor.* change single numbers of it."""
    scan: int | None = None
    """Number of the scan, from 0; by default the middle one."""
    only: tuple[str, ...] = ()
    """Artefacts to show, by their names under --artefacts; by default all."""
    scene: Path | None = None
    """TOML file of a custom scene in place of a preset; its keys: docs/scenes.md."""
    osm: Path | None = None
    """OpenStreetMap extract (.osm, .osm.gz, or JSON of Overpass) in place of a preset (docs/scenes.md)."""
    targets: Path | None = None
    """TOML file of test targets to put into the world; its keys: docs/scenes.md."""
    backend: Backend = field(default_factory=selected_backend)
    """Compiler of the ray tracer: llvm for the CPU, cuda for an NVIDIA GPU. By default ECHOSCAPE_BACKEND."""


def main(arguments: Sequence[str]) -> int:
    """Run the subcommand.

    Args:
        arguments: The words after `echoscape artefacts`.

    Returns:
        The exit code: 0 done, 2 bad input.
    """
    try:
        defaults = _defaults(arguments)
        options = parse(Options, prog="echoscape artefacts", words=arguments, default=defaults)
        rows, paths = _written(options, arguments)
    except (DatasetError, SceneError, ValueError) as error:
        return _refuse(in_option_names(Options, str(error)))
    except OSError as error:
        return _refuse(f"OUT: {error.strerror or error}")
    console = Console()
    console.print(_table(rows))
    for path in paths:
        console.print(str(path), soft_wrap=True, highlight=False)
    return 0


def _defaults(words: Sequence[str]) -> Options:
    """Return the options before any but --radar, which decides the defaults of many others."""
    radar = option_value("--radar", words)
    try:
        sensor = CTS350X if not radar else sensor_from(radar)
    except ValueError as error:
        raise ArgumentsError(f"--radar: {error}") from error
    return Options(out=tyro.MISSING, simulation=replace(ScanOptions(), sensor=sensor))


def _written(options: Options, words: Sequence[str]) -> tuple[list["ArtefactChange"], tuple[Path, ...]]:
    """Refuse what cannot be drawn, then draw."""
    config = simulation_config(
        options.simulation, scene=options.scene, targets=options.targets, osm=options.osm
    )
    index = config.scans // 2 if options.scan is None else options.scan
    load_ray_tracer(options.backend, words)
    from echoscape.eval.ablation.cases import chosen_cases
    from echoscape.eval.ablation.figures import write_artefacts
    from echoscape.eval.ablation.run import check_index

    check_index(config, index)
    names = tuple(name.replace("-", "_") for name in options.only)
    chosen_cases(names)
    with ProgressBars(Console(stderr=True)) as bars:
        return write_artefacts(options.out, config, index, names=names, progress=bars.report)


def _table(rows: Sequence["ArtefactChange"]) -> Table:
    from echoscape.eval.ablation.run import TABLE_COLUMNS, table_row

    table = Table(*TABLE_COLUMNS, box=None, padding=(0, 2, 0, 0))
    for column in table.columns[2:]:
        column.justify = "right"
    for row in rows:
        table.add_row(*table_row(row))
    return table


def _refuse(message: str) -> int:
    print(f"echoscape artefacts: {message}", file=sys.stderr)
    return 2
