"""`echoscape simulate OUT`: parse a configuration, make its dataset with a progress bar, draw a preview, sum up."""

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.table import Table

from echoscape.cli.arguments import ArgumentsError, parsed, said
from echoscape.cli.progress import Stages
from echoscape.cli.scene_options import ConfigFlags, config_from_flags
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.domain_randomization import randomized
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.sensor.registry import sensor_from


@dataclass(frozen=True, kw_only=True)
class Options:
    """Make a dataset: a town, a drive through it, its radar scans and their truth."""

    out: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="OUT")]
    """Folder to write; it must be empty or new."""
    simulation: Annotated[ConfigFlags, tyro.conf.arg(name="")] = field(default_factory=ConfigFlags)
    """What to make."""
    radar: str = CTS350X.name
    """The radar: cts350x (Oxford), cir204 (MulRan), cir304 (Boreas), cir304_rt (Boreas-RT), or a TOML file;
    its keys: docs/sensors.md. --sensor.* change single numbers of it."""
    scene: Path | None = None
    """TOML file of a scene of one's own, in the place of a preset; its keys: docs/scenes.md."""
    targets: Path | None = None
    """TOML file of test targets to put into the world; its keys: docs/scenes.md."""
    randomize: bool = False
    """Draw sensor, artefacts and surfaces about those given, by the seed: for training that must carry over
    to real radar (docs/fidelity.md)."""
    workers: int = 1
    """Processes that make scans side by side; the result does not depend on it."""
    threads: int | None = None
    """Threads of each process; by default the processors are shared out."""
    resume: bool = False
    """Go on with a run that was stopped: make only the scans that OUT lacks."""
    preview: bool = True
    """Draw OUT/preview.png at the end."""


def main(arguments: Sequence[str]) -> int:
    """Run the subcommand and return its exit code."""
    from echoscape.sim.datasets.files.atomic_write import DatasetError

    try:
        default = _defaults(arguments)
        options = parsed(Options, prog="echoscape simulate", arguments=arguments, default=default)
        config = config_from_flags(options.simulation, scene=options.scene, targets=options.targets)
        config = randomized(config) if options.randomize else config
        _check(options)
    except (DatasetError, ValueError) as error:
        return _refused(str(error), 2)
    except OSError as error:
        return _refused(f"OUT: {error.strerror}", 2)
    return _simulate(options, config)


def _defaults(arguments: Sequence[str]) -> Options:
    """Return the options where nothing more is said than --radar, which decides the sensor's numbers.

    Raises:
        ArgumentsError: there is no such radar.
    """
    radar = said("--radar", arguments) or CTS350X.name
    try:
        sensor = sensor_from(radar)
    except ValueError as error:
        raise ArgumentsError(f"--radar: {error}") from error
    return Options(out=tyro.MISSING, simulation=ConfigFlags(sensor=sensor), radar=radar)


def _check(options: Options) -> None:
    """Refuse what cannot be carried out before the ray tracer is loaded."""
    from echoscape.sim.generation.dataset import check_arguments

    check_arguments(options.out, workers=options.workers, threads=options.threads, resume=options.resume)


def _simulate(options: Options, config: SimulationConfig) -> int:
    """Make the dataset of `config` as `options` say and return the exit code."""
    from echoscape.scenes.io.strict_toml import SceneError
    from echoscape.sim.datasets.files.atomic_write import DatasetError
    from echoscape.sim.generation.dataset import write_dataset
    from echoscape.sim.generation.workers import WorkerError

    import_module(
        "echoscape.sim.raytracing.mitsuba_backend"
    )  # a machine without what it needs is told before anything begins
    console, start = Console(stderr=True), time.monotonic()
    try:
        with Stages(console) as stages:
            write_dataset(
                options.out,
                config,
                workers=options.workers,
                threads=options.threads,
                resume=options.resume,
                progress=stages.report,
            )
            if options.preview:
                stages.report("preview", 0, 1)
                _draw(options.out)
                stages.report("preview", 1, 1)
        summary = _summary(options, config, seconds=time.monotonic() - start)
    except KeyboardInterrupt:
        hint = (
            "add --resume to go on"
            if (options.out / "echoscape.json").exists()
            else "nothing was left behind"
        )
        return _refused(f"interrupted; {hint}", 130)
    except (DatasetError, SceneError) as error:
        return _refused(str(error), 2)
    except WorkerError as error:
        return _refused(f"{error}\nThe scans made so far are whole; add --resume to go on.", 1)
    except OSError as error:
        whole = " The scans made so far are whole; add --resume to go on." if options.out.exists() else ""
        return _refused(f"OUT {options.out}: {error}.{whole}", 1 if whole else 2)
    Console().print(summary)
    return 0


def _draw(out: Path) -> None:
    from echoscape.eval.figures.preview import preview

    preview(out)


def _refused(message: str, code: int) -> int:
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
        ("scans", f"{config.scans} of {config.sensor.azimuths} x {config.sensor.bins} cells, with truth"),
        ("radar", f"{config.sensor.name}, in the layout of {config.folder_layout.name}"),
        ("driven", f"{driven_m:.1f} m"),
        ("size", f"{size / 1e6:.0f} MB"),
        ("took", f"{seconds:.1f} s"),
        *([("look at", str(out / "preview.png"))] if options.preview else []),
    ):
        table.add_row(name, value)
    return table
