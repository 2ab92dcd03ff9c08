"""`echoscape detections DATA --out RES`: detectors judged by the truth of every cell."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro
from rich.console import Console
from rich.table import Table

from echoscape.cli.arguments import in_option_names, parse, with_config_file
from echoscape.cli.progress import ProgressBars
from echoscape.cli.torch_setup import check_threads, require_torch, use_threads
from echoscape.eval.detections.cfar import CfarSettings, OrderedCfarSettings
from echoscape.eval.detections.k_strongest import KStrongestSettings
from echoscape.eval.detections.registry import (
    METHODS,
    NEED_TORCH,
    KeypointSettings,
    MethodSettings,
    build_detectors,
    check_methods,
)
from echoscape.eval.detections.targets import JudgeSettings
from echoscape.eval.methods.cen2018 import Cen2018Settings
from echoscape.eval.methods.cen2019 import Cen2019Settings

if TYPE_CHECKING:
    from echoscape.eval.detections.run import DetectionResult

_LEAST_WIDTH = 100
"""Characters that the table needs."""


@dataclass(frozen=True, kw_only=True)
class Options:
    """Judge detectors by the truth of the cells of a simulated folder.

    Average precision, recall by range and class, and false alarms by what they fell on: ghosts, side lobes,
    spokes, noise, movers, rain, interference. Writes detections.csv, recall.csv, detections.md,
    detections.json and detections.png.
    """

    data: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DATA")]
    """Folder of simulated scans, with their truth."""
    out: Path
    """Folder to write to, other than a data set; files of an earlier run are replaced."""
    methods: str = "cfar,kstrongest"
    """Names separated by commas or spaces: cfar (cell averaging), oscfar (order statistics), kstrongest,
    cen2018 and cen2019 (hand-made keypoints), learned (keypoints; needs PyTorch)."""
    every: int = 1
    """Judge every Nth scan, from the first."""
    judge: JudgeSettings = field(default_factory=JudgeSettings)
    cfar: CfarSettings = field(default_factory=CfarSettings)
    oscfar: OrderedCfarSettings = field(default_factory=OrderedCfarSettings)
    kstrongest: KStrongestSettings = field(default_factory=KStrongestSettings)
    cen2018: Cen2018Settings = field(default_factory=Cen2018Settings)
    cen2019: Cen2019Settings = field(default_factory=Cen2019Settings)
    learned: KeypointSettings = field(default_factory=KeypointSettings)
    threads: int = 1
    """Threads of the learned method on the CPU; the result does not depend on it."""
    config: Path | None = None
    """TOML file of options: keys are their names, those of a group in its table. Options on the command line
    override it."""


def main(arguments: Sequence[str]) -> int:
    """Run the subcommand.

    Args:
        arguments: The words after `echoscape detections`.

    Returns:
        The exit code: 0 done, 2 bad input.
    """
    try:
        words = _joined_methods(with_config_file(Options, arguments))
        options = parse(Options, prog="echoscape detections", words=words)
        result, paths = _run(options)
    except ValueError as error:  # errors of a data set among them
        return _refuse(in_option_names(Options, str(error)))
    except OSError as error:
        return _refuse(f"{error.filename}: {error.strerror}" if error.filename else str(error))
    console = Console(width=max(Console().width, _LEAST_WIDTH))
    console.print(_table(result))
    console.print(_intervals(result), soft_wrap=True, highlight=False)
    for path in paths:
        console.print(str(path), soft_wrap=True, highlight=False)
    return 0


def _joined_methods(words: Sequence[str]) -> list[str]:
    """Join the names of methods that follow --methods by commas; DATA may come after them."""
    found: list[str] = []
    for word in words:
        follows = found[-2:-1] == ["--methods"] or "".join(found[-1:]).startswith("--methods=")
        if follows and set(_names(word)) <= set(METHODS):
            found[-1] += f",{word}"
        else:
            found.append(word)
    return found


def _names(text: str) -> list[str]:
    """Return the names in a text that separates them by commas or spaces."""
    return text.replace(",", " ").split()


def _run(options: Options) -> "tuple[DetectionResult, tuple[Path, ...]]":
    """Judge the methods and write the files; nothing is written before all results are there."""
    from echoscape.eval.detections.report import write_detection_report
    from echoscape.eval.detections.run import judge_detectors
    from echoscape.sim.datasets.files.output_folder import check_no_dataset, check_output_folder
    from echoscape.sim.datasets.scan_folder import open_folder
    from echoscape.sim.numerics.malloc import keep_freed_memory

    names = _checked_methods(options)
    folder = open_folder(options.data)
    check_output_folder(options.out)
    check_no_dataset(options.out, options.data)
    keep_freed_memory()
    if set(names) & set(NEED_TORCH):
        use_threads(options.threads)
    settings = MethodSettings(
        cfar=options.cfar,
        oscfar=options.oscfar,
        kstrongest=options.kstrongest,
        cen2018=options.cen2018,
        cen2019=options.cen2019,
        learned=options.learned,
    )
    detectors = build_detectors(names, settings, folder.sensor)
    with ProgressBars(Console(stderr=True)) as bars:
        result = judge_detectors(folder, detectors, options.judge, every=options.every, progress=bars.report)
        bars.report("report", 0, 1)
        paths = write_detection_report(options.out, result)
        bars.report("report", 1, 1)
    return result, paths


def _checked_methods(options: Options) -> list[str]:
    """Return the names of the methods; refuse those that are unknown or cannot run."""
    names = _names(options.methods)
    check_methods(names)
    check_threads(options.threads)
    for name in NEED_TORCH:
        if name in names:
            require_torch(f"--methods {name}")
    return names


def _table(result: "DetectionResult") -> Table:
    from echoscape.eval.detections.report import TABLE_COLUMNS, all_figures, table_rows

    table = Table(box=None, padding=(0, 2, 0, 0))
    for number, heading in enumerate(TABLE_COLUMNS.values()):
        table.add_column(heading, justify="right" if number else "left", no_wrap=True)
    for row in table_rows(result, all_figures(result)):
        table.add_row(*row)
    return table


def _intervals(result: "DetectionResult") -> str:
    from echoscape.eval.detections.report import intervals_text

    return intervals_text(result)


def _refuse(message: str) -> int:
    print(f"echoscape detections: {message}", file=sys.stderr)
    return 2
