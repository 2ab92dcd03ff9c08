"""`echoscape simulate OUT`: a data set from options, with progress bars, a preview and a summary."""

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.table import Table

from echoscape.cli.arguments import ArgumentsError, in_option_names, option_value, parse, with_config_file
from echoscape.cli.options.backend_option import load_ray_tracer
from echoscape.cli.options.scene_options import SimulationOptions, simulation_config
from echoscape.cli.progress import ProgressBars
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.domain_randomization import randomized
from echoscape.sim.raytracing.backend import Backend, selected_backend
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.sensor.registry import sensor_from


@dataclass(frozen=True, kw_only=True)
class Options:
    """Make a data set: a town, a drive through it, its radar scans and their truth."""

    out: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="OUT")]
    """Folder to write; it must be empty or new."""
    simulation: Annotated[SimulationOptions, tyro.conf.arg(name="")] = field(
        default_factory=SimulationOptions
    )
    """What to simulate."""
    radar: str = CTS350X.name
    """The radar: cts350x (Oxford), cir204 (MulRan), cir304 (Boreas), cir304_rt (Boreas-RT), cts_small
    (for tests), or a TOML file with the keys of docs/sensors.md. --sensor.* change single numbers of it."""
    scene: Path | None = None
    """TOML file of a custom scene in place of a preset; its keys: docs/scenes.md."""
    osm: Path | None = None
    """OpenStreetMap extract (.osm, .osm.gz, or JSON of Overpass) in place of a preset (docs/scenes.md)."""
    targets: Path | None = None
    """TOML file of test targets to put into the world; its keys: docs/scenes.md."""
    randomize: bool = False
    """Draw sensor, artefacts and surfaces around the given values, by the seed: for training that has to
    transfer to real radar (docs/fidelity.md)."""
    manifest: Annotated[Path | None, tyro.conf.arg(name="from")] = None
    """Another data set, as its folder or its echoscape.json: its configuration gives the same bytes again.
    Options on the command line override it."""
    config: Path | None = None
    """TOML file of options: keys are their names, dotted options are keys in tables (--artefacts.ghosts is
    ghosts in [artefacts]), booleans are written as preview = false. Options on the command line
    override it."""
    backend: Backend = field(default_factory=selected_backend)
    """Compiler of the ray tracer: llvm for the CPU, cuda for an NVIDIA GPU. By default ECHOSCAPE_BACKEND."""
    workers: int = 1
    """Processes that make scans side by side; the result does not depend on it."""
    threads: int | None = None
    """Threads of each process; by default the cores are divided among the workers."""
    resume: bool = False
    """Continue a run that was stopped: make only the scans that OUT lacks."""
    preview: bool = True
    """Draw OUT/preview.png at the end."""


def main(arguments: Sequence[str]) -> int:
    """Run the subcommand.

    Args:
        arguments: The words after `echoscape simulate`.

    Returns:
        The exit code: 0 done, 1 failed on the way, 2 bad input, 130 interrupted.
    """
    from echoscape.sim.datasets.files.atomic_write import DatasetError

    try:
        words = with_config_file(Options, arguments)
        options = parse(Options, prog="echoscape simulate", words=words, default=_defaults(words))
        config = _config(options, words)
        _check(options)
        load_ray_tracer(options.backend, words)  # raises before anything is written
    except (DatasetError, ValueError) as error:
        return _refuse(in_option_names(Options, str(error)), 2)
    except OSError as error:
        return _refuse(f"OUT: {error.strerror}", 2)
    return _simulate(options, config)


def _defaults(words: Sequence[str]) -> Options:
    """Return the options before any but --from and --radar, which decide the defaults of many others."""
    manifest, radar = option_value("--from", words), option_value("--radar", words)
    simulation = SimulationOptions()
    if manifest:
        from echoscape.scenes.io.scene_file import read_scene_file
        from echoscape.sim.datasets.files.metadata import read_manifest
        from echoscape.sim.generation.config_json import read_config
        from echoscape.sim.generation.manifest import version_difference

        scene = option_value("--scene", words) or option_value("--osm", words)
        config = read_config(Path(manifest), scene=read_scene_file(scene) if scene else None)
        differing = version_difference(read_manifest(Path(manifest)))
        if differing:
            print(f"echoscape simulate: {manifest}: bytes may differ, as {differing}", file=sys.stderr)
        simulation = SimulationOptions(
            **{each.name: getattr(config, each.name) for each in fields(SimulationConfig)}
        )
    if radar:
        try:
            simulation = replace(simulation, sensor=sensor_from(radar))
        except ValueError as error:
            raise ArgumentsError(f"--radar: {error}") from error
    return Options(out=tyro.MISSING, simulation=simulation)


def _config(options: Options, words: Sequence[str]) -> SimulationConfig:
    """Return the configuration of the run; a world that is given replaces the one of --from."""
    simulation = options.simulation
    given = options.scene is not None or options.osm is not None
    if options.manifest is not None and given and option_value("--preset", words) is None:
        simulation = replace(simulation, preset="")
    if options.manifest is not None and option_value("--preset", words) is not None:
        simulation = replace(simulation, scene=None)
    config = simulation_config(simulation, scene=options.scene, targets=options.targets, osm=options.osm)
    if not options.randomize:
        return config
    if config.randomized:
        raise ArgumentsError(f"--randomize: {options.manifest} is of a data set that was randomized already")
    return randomized(config)


def _check(options: Options) -> None:
    """Refuse what cannot be carried out before the ray tracer is loaded."""
    from echoscape.sim.generation.dataset import check_arguments

    check_arguments(options.out, workers=options.workers, threads=options.threads, resume=options.resume)


def _simulate(options: Options, config: SimulationConfig) -> int:
    """Make the data set of `config` and return the exit code."""
    from echoscape.scenes.io.strict_toml import SceneError
    from echoscape.sim.datasets.files.atomic_write import DatasetError
    from echoscape.sim.generation.workers import WorkerError

    start = time.monotonic()
    try:
        _write(options, config)
        summary = _summary(options, config, seconds=time.monotonic() - start)
    except KeyboardInterrupt:
        begun = (options.out / "echoscape.json").exists()
        return _refuse(f"interrupted; {'add --resume to continue' if begun else 'nothing was written'}", 130)
    except (DatasetError, SceneError) as error:
        return _refuse(in_option_names(Options, str(error)), 2)
    except WorkerError as error:
        return _refuse(f"{error}\nThe scans made so far are complete; add --resume to continue.", 1)
    except OSError as error:
        begun = options.out.exists()
        hint = " The scans made so far are complete; add --resume to continue." if begun else ""
        return _refuse(f"OUT {options.out}: {error}.{hint}", 1 if begun else 2)
    Console().print(summary)
    return 0


def _write(options: Options, config: SimulationConfig) -> None:
    """Write the data set and its preview, with progress bars."""
    from echoscape.sim.generation.dataset import write_dataset

    with ProgressBars(Console(stderr=True)) as bars:
        write_dataset(
            options.out,
            config,
            workers=options.workers,
            threads=options.threads,
            resume=options.resume,
            progress=bars.report,
        )
        if options.preview:
            from echoscape.eval.figures.preview import preview

            bars.report("preview", 0, 1)
            preview(options.out)
            bars.report("preview", 1, 1)


def _refuse(message: str, code: int) -> int:
    print(f"echoscape simulate: {message}", file=sys.stderr)
    return code


def _summary(options: Options, config: SimulationConfig, *, seconds: float) -> Table:
    """Return what was made as a small table."""
    from echoscape.sim.datasets.scan_folder import open_folder

    out = options.out
    motion = open_folder(out).motion()
    driven_m = 0.0 if motion is None else sum((x**2 + y**2) ** 0.5 for x, y, *_ in motion.tolist())
    size = sum(path.stat().st_size for path in out.rglob("*") if path.is_file())
    table = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    table.add_column()
    table.add_column(overflow="fold")
    for name, value in (
        ("folder", str(out)),
        ("world", f"{config.preset if config.scene is None else config.scene.file}, seed {config.seed}"),
        (
            "scans",
            f"{config.scans} of {config.sensor.azimuths} azimuths x {config.sensor.bins} bins, with truth",
        ),
        ("radar", f"{config.sensor.name}, in the layout of {config.folder_layout.name}"),
        ("driven", f"{driven_m:.1f} m"),
        ("size", f"{size / 1e6:.0f} MB"),
        ("took", f"{seconds:.1f} s"),
        *([("look at", str(out / "preview.png"))] if options.preview else []),
    ):
        table.add_row(name, value)
    return table
