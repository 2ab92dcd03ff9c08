"""`echoscape ablate --out RES`: what artefacts and sensor faults cost odometry, each scan traced once."""

import logging
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro
from rich.console import Console
from rich.table import Table

from echoscape.cli.arguments import ArgumentsError, in_option_names, option_value, parse, with_config_file
from echoscape.cli.options.backend_option import load_ray_tracer
from echoscape.cli.options.scene_options import Preset, SimulationOptions
from echoscape.cli.progress import ProgressBars
from echoscape.cli.torch_setup import require_torch
from echoscape.scenes.io.scene_file import AnyScene
from echoscape.scenes.io.strict_toml import SceneError
from echoscape.scenes.io.target_toml import read_targets
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.layouts.registry import LayoutName
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.raytracing.backend import Backend, selected_backend
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.sensor.registry import sensor_from

if TYPE_CHECKING:
    from echoscape.eval.ablation.study.settings import AblationStudy
    from echoscape.eval.ablation.study.tables import AblationRow

_FILE_COLUMNS = 200
"""Columns of a table that goes into a file or a pipe."""


@dataclass(frozen=True, kw_only=True)
class DriveOptions(SimulationOptions):
    """A simulation's configuration for the drives of an ablation, which name their worlds and seeds."""

    preset: tyro.conf.Suppress[tyro.conf.Fixed[Preset]] = ""
    """Given by --worlds."""
    seed: tyro.conf.Suppress[tyro.conf.Fixed[int]] = 0
    """Given by --worlds."""
    scans: int = 40
    """Scans of each drive, four a second of driving."""
    keep_beat: tyro.conf.Suppress[tyro.conf.Fixed[bool]] = False
    """For folders only."""
    layout: tyro.conf.Suppress[tyro.conf.Fixed[LayoutName | None]] = None
    """Always Oxford's."""
    scene: tyro.conf.Suppress[tyro.conf.Fixed[AnyScene | None]] = None
    """Given by --worlds."""


@dataclass(frozen=True, kw_only=True)
class Options:
    """Measure what artefacts and sensor faults cost odometry.

    Every world is built once, every scan is traced once for all strengths that allow it, and every method
    runs on every drive. Differences from the default condition are paired, with bootstrap intervals over
    drives. The same command continues a stopped run.
    """

    out: Path
    """Folder to write: table.csv, drives.csv, table.md, summary.png, curves.png, report.html, the settings,
    and a result for each drive, condition and method."""
    worlds: tuple[str, ...]
    """Drives, each as PRESET:SEED, such as town:7 suburb:8, SCENE.toml:SEED or MAP.osm:SEED
    (docs/scenes.md). Intervals need six or more."""
    artefact: tyro.conf.UseAppendAction[tuple[str, ...]] = ()
    """An artefact or fault with its strengths, such as ghosts=0,0.5,2; off is 0, default the strength of the
    default condition. Give it once for each artefact. docs/ablation.md lists the faults."""
    suite: Literal["none", "stress"] = "none"
    """A suite of conditions that are added to those of --artefact. stress: lost scans, lost azimuths, a
    jammed sector, clock jitter, a step of the gain, a wrong range scale, rain of 50 mm/h, dense interference,
    a blocked sector."""
    grid: bool = False
    """Combine all strengths of all artefacts; by default one is changed at a time."""
    methods: tuple[str, ...] = ("learned,fourier",)
    """Methods, separated by commas or spaces: learned (the coarsest bundled weights), learned-fine, fourier,
    cen2018, cen2019; with -robust or -paper another solver of a learned one, such as learned-fine-robust;
    learned:FILE takes weights from a file."""
    simulation: Annotated[DriveOptions, tyro.conf.arg(name="")] = field(default_factory=DriveOptions)
    """The default condition: what `echoscape simulate` makes with the same options."""
    radar: str = CTS350X.name
    """The radar: cts350x (Oxford), cir204 (MulRan), cir304 (Boreas), cir304_rt (Boreas-RT), cts_small
    (for tests), or a TOML file with the keys of docs/sensors.md. --sensor.* change single numbers of it."""
    targets: Path | None = None
    """TOML file of test targets to put into each world; its keys: docs/scenes.md."""
    keep_scans: bool = False
    """Keep the scans of every condition, with their truth, as data sets; by default those of one drive at a
    time are on disk, some 0.5 MB for each scan and condition."""
    device: Literal["auto", "cpu", "cuda"] = "auto"
    """Where learned methods run; auto takes a GPU where PyTorch finds one."""
    workers: int = 1
    """Processes that work side by side; the result does not depend on it."""
    config: Path | None = None
    """TOML file of options: keys are their names, dotted options are keys in tables, booleans are written as
    grid = true. Options on the command line override it."""
    backend: Backend = field(default_factory=selected_backend)
    """Compiler of the ray tracer: llvm for the CPU, cuda for an NVIDIA GPU. By default ECHOSCAPE_BACKEND."""


def main(arguments: Sequence[str]) -> int:
    """Run the subcommand.

    Args:
        arguments: The words after `echoscape ablate`.

    Returns:
        The exit code: 0 done, 1 failed on the way, 2 bad input, 130 interrupted.
    """
    from echoscape.sim.generation.workers import WorkerError

    try:
        words = _one_by_one(arguments, with_config_file(Options, arguments))
        options = parse(Options, prog="echoscape ablate", words=words, default=_defaults(words))
        study = _study(options)
        rows, paths = _run(options, study, words)
    except KeyboardInterrupt:
        return _refuse("interrupted; the same command continues", 130)
    except WorkerError as error:
        return _refuse(str(error), 1)
    except (DatasetError, SceneError, ValueError) as error:
        return _refuse(in_option_names(Options, str(error)), 2)
    except OSError as error:
        return _refuse(f"OUT: {error.strerror or error}", 2)
    _show(study, rows, paths)
    return 0


def _one_by_one(given: Sequence[str], words: Sequence[str]) -> list[str]:
    """Return the words with --artefact before each of its values, those of the file only if none is given.

    `words` are those of the configuration file, then the `given` ones.
    """
    from_file, by_hand = words[: len(words) - len(given)], list(given)
    if any(word.partition("=")[0] == "--artefact" for word in given) and "--artefact" in from_file:
        start = from_file.index("--artefact")
        length = next((k for k, word in enumerate(from_file[start + 1 :], 1) if word.startswith("--")), None)
        from_file = [*from_file[:start], *(from_file[start + length :] if length else [])]
    found: list[str] = []
    inside = False
    for word in (*from_file, *by_hand):
        if inside and not word.startswith("--") and found[-1] != "--artefact":
            found.append("--artefact")
        inside = word == "--artefact" or (inside and not word.startswith("--"))
        found.append(word)
    return found


def _defaults(words: Sequence[str]) -> Options | None:
    """Return the options before any but --radar, which decides the defaults of many others."""
    radar = option_value("--radar", words)
    try:
        sensor = CTS350X if radar is None else sensor_from(radar)
    except ValueError as error:
        raise ArgumentsError(f"--radar: {error}") from error
    return Options(out=tyro.MISSING, worlds=tyro.MISSING, simulation=DriveOptions(sensor=sensor))


def _study(options: Options) -> "AblationStudy":
    """Return the ablation that the options describe; errors name the option."""
    from echoscape.eval.ablation.study.conditions import chosen_levels, conditions
    from echoscape.eval.ablation.study.settings import AblationStudy, ablation_drive
    from echoscape.eval.odometry.methods import method_choice

    suite = None if options.suite == "none" else options.suite
    if options.grid and suite:
        raise ArgumentsError("--grid combines the strengths of --artefact: not with --suite")
    values: dict[str, Any] = {
        each.name: getattr(options.simulation, each.name) for each in fields(SimulationConfig)
    }
    values["targets"] = () if options.targets is None else read_targets(options.targets)
    settings = SimulationConfig(**values)
    drives = tuple(_named("--worlds", ablation_drive, each, settings) for each in options.worlds)
    levels = _named("--artefact", chosen_levels, options.artefact, suite)
    combined = partial(conditions, grid=options.grid)
    every = _named("--artefact", combined, levels, settings.artefacts, settings.sensor)
    if len({each.strengths(settings.sensor) for each in every}) == 1:
        raise ArgumentsError("--artefact must have a strength other than that of the default condition")
    names = [name for word in options.methods for name in map(str.strip, word.split(",")) if name]
    methods = tuple(_named("--methods", method_choice, name) for name in names)
    if any(each.learned for each in methods):
        require_torch(f"--methods {','.join(names)}")
    return AblationStudy(drives=drives, conditions=every, methods=methods, keep_scans=options.keep_scans)


def _named(option: str, make: Any, *arguments: Any) -> Any:
    """Return what `make` makes; its errors are said to be of an option."""
    try:
        return make(*arguments)
    except (SceneError, DatasetError):
        raise
    except ValueError as error:
        raise ArgumentsError(f"{option}: {error}") from error


def _run(
    options: Options, study: "AblationStudy", words: Sequence[str]
) -> "tuple[list[AblationRow], tuple[Path, ...]]":
    """Refuse what cannot be carried out, then run and write the report."""
    from echoscape.eval.ablation.study.report import write_ablation_report
    from echoscape.eval.ablation.study.run import check_ablation, run_ablation
    from echoscape.sim.numerics.malloc import keep_freed_memory

    check_ablation(options.out, study, workers=options.workers)
    load_ray_tracer(options.backend, words)
    keep_freed_memory()
    logging.getLogger("echoscape").setLevel(logging.ERROR)  # failed pairs are counted in the results
    with ProgressBars(Console(stderr=True)) as bars:
        run_ablation(options.out, study, workers=options.workers, device=options.device, progress=bars.report)
        bars.report("report", 0, 1)
        written = write_ablation_report(options.out, study)
        bars.report("report", 1, 1)
    return written


def _show(study: "AblationStudy", rows: "Sequence[AblationRow]", paths: Sequence[Path]) -> None:
    """Print the differences of the mean translation error with the pairs that failed, and the cautions."""
    from echoscape.eval.ablation.study.notes import cautions
    from echoscape.eval.ablation.study.tables import condition_label

    console = Console() if sys.stdout.isatty() else Console(width=_FILE_COLUMNS, height=_FILE_COLUMNS)
    table = Table(
        "condition", *(rf"{each.name} \[m]" for each in study.methods), box=None, padding=(0, 2, 0, 0)
    )
    shown = {
        (row.condition.name, row.method): row for row in rows if row.metric.name == "translation_error_mean"
    }
    for condition in study.conditions:
        found = [shown[condition.name, each.name] for each in study.methods]
        table.add_row(condition_label(condition), *map(_cell, found))
    console.print("Mean translation error of a pair; below the first row the difference from it:")
    console.print(table)
    for path in paths:
        console.print(str(path), soft_wrap=True, highlight=False)
    for each in cautions(study, rows):
        print(f"echoscape ablate: {each}", file=sys.stderr)


def _cell(row: "AblationRow") -> str:
    """Return the value of the default condition or a difference from it, and the failed pairs, if any."""
    from echoscape.eval.ablation.study.tables import difference_text, failed_text

    text = difference_text(row) if row.condition.levels else f"{row.compared.value:.4f}"
    return f"{text}; {failed_text(row)} failed" if row.failed else text


def _refuse(message: str, code: int) -> int:
    print(f"echoscape ablate: {message}", file=sys.stderr)
    return code
