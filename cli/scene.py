"""`echoscape scene OUT`: build a world without any radar: a 3-D model, a plan and statistics."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro
from rich.console import Console
from rich.table import Table

from echoscape.cli.arguments import in_option_names, parse
from echoscape.cli.options.scene_options import Preset, SimulationOptions, simulation_config
from echoscape.cli.progress import ProgressBars
from echoscape.scenes.io.strict_toml import SceneError
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.generation.config import SimulationConfig

if TYPE_CHECKING:
    from echoscape.eval.scene_report.statistics import Inventory


@dataclass(frozen=True, kw_only=True)
class Options:
    """Build a world and write scene.glb, plan.png and scene.json with its statistics."""

    out: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="OUT")]
    """Folder to write; it must be empty or new."""
    preset: Preset = ""
    """Kind of world: town, suburb, industrial, motorway, open, yard or empty (a road on a plane, with
    traffic)."""
    seed: int = 0
    """Seed of the town and of the drive through it."""
    scans: int = 40
    """Scans whose drive is shown; a custom drive is shown whole."""
    scene: Path | None = None
    """TOML file of a custom scene in place of a preset; its keys: docs/scenes.md."""
    osm: Path | None = None
    """OpenStreetMap extract (.osm, .osm.gz, or JSON of Overpass) in place of a preset (docs/scenes.md)."""
    targets: Path | None = None
    """TOML file of test targets to put into the world; its keys: docs/scenes.md."""


def main(arguments: Sequence[str]) -> int:
    """Run the subcommand.

    Args:
        arguments: The words after `echoscape scene`.

    Returns:
        The exit code: 0 done, 2 bad input.
    """
    from echoscape.eval.scene_report.report import write_scene
    from echoscape.sim.datasets.files.output_folder import check_output_folder

    try:
        options = parse(Options, prog="echoscape scene", words=arguments)
        config = _config(options)
        check_output_folder(options.out, empty=True)
    except ValueError as error:
        return _refuse(in_option_names(Options, str(error)))
    try:
        with ProgressBars(Console(stderr=True)) as bars:
            numbers = write_scene(options.out, config, progress=bars.report)
    except (DatasetError, SceneError) as error:
        return _refuse(in_option_names(Options, str(error)))
    except OSError as error:
        return _refuse(f"OUT: {error.strerror or error}")
    console = Console()
    for table in (_summary(options, numbers), _classes(numbers), _materials(numbers)):
        console.print(table)
    return 0


def _config(options: Options) -> SimulationConfig:
    flags = SimulationOptions(preset=options.preset, seed=options.seed, scans=options.scans)
    return simulation_config(flags, scene=options.scene, targets=options.targets, osm=options.osm)


def _refuse(message: str) -> int:
    print(f"echoscape scene: {message}", file=sys.stderr)
    return 2


def _summary(options: Options, numbers: "Inventory") -> Table:
    """Return size and triangles as a small table."""
    size = [high - low for low, high in zip(numbers.low_m, numbers.high_m, strict=True)]
    table = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    table.add_column()
    table.add_column(overflow="fold")
    table.add_row("folder", str(options.out))
    table.add_row("size", f"{size[0]:,.1f} x {size[1]:,.1f} x {size[2]:,.1f} m")
    for name, corner in (("from x, y, z", numbers.low_m), ("to", numbers.high_m)):
        table.add_row(name, ", ".join(f"{value:.1f}" for value in corner) + " m")
    table.add_row("triangles", f"{numbers.triangles_stored:,} stored, {numbers.triangles_placed:,} placed")
    return table


def _classes(numbers: "Inventory") -> Table:
    table = _figures("class", "objects", "triangles")
    for name, count in numbers.classes.items():
        table.add_row(name, f"{count.objects:,}", f"{count.triangles:,}")
    return table


def _materials(numbers: "Inventory") -> Table:
    table = _figures("material", "area in m2", "triangles")
    for name, count in numbers.materials.items():
        table.add_row(name, f"{count.area_m2:,.1f}", f"{count.triangles:,}")
    return table


def _figures(name: str, *figures: str) -> Table:
    """Return an empty table with a column of names and columns of figures."""
    table = Table(name, box=None, padding=(0, 2, 0, 0))
    for figure in figures:
        table.add_column(figure, justify="right")
    return table
