"""`echoscape drift --estimate E.txt --truth T.txt`: the KITTI drift of one trajectory against another."""

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

from echoscape.cli.arguments import in_option_names, parse

if TYPE_CHECKING:
    from echoscape.eval.odometry.kitti_drift import Drift


@dataclass(frozen=True, kw_only=True)
class Options:
    """Evaluate a trajectory against another as the KITTI odometry devkit does: over segments of 100 to 800 m.

    Files have one pose per line, twelve numbers: the upper 3 x 4 part of its matrix, row by row. Both must
    have the same frames; where no segment of 100 m exists the figures are null.
    """

    estimate: Path
    """The trajectory to evaluate."""
    truth: Path
    """The true trajectory."""
    step: int = 10
    """Frames from one segment's start to the next: 10 in the devkit, 4 for a radar of 4 Hz."""
    json: bool = False
    """Print JSON."""


def main(arguments: Sequence[str]) -> int:
    """Run the subcommand.

    Args:
        arguments: The words after `echoscape drift`.

    Returns:
        The exit code: 0 done, 2 bad input.
    """
    try:
        options = parse(Options, prog="echoscape drift", words=arguments)
        found = _drift(options)
    except ValueError as error:  # errors of a file among them
        print(f"echoscape drift: {in_option_names(Options, str(error))}", file=sys.stderr)
        return 2
    if options.json:
        print(json.dumps(found.as_dict()))
    else:
        Console().print(_table(found))
    return 0


def _drift(options: Options) -> "Drift":
    from echoscape.eval.odometry.kitti_drift import kitti_drift
    from echoscape.eval.odometry.trajectory_io import read_kitti

    return kitti_drift(read_kitti(options.estimate), read_kitti(options.truth), step=options.step)


def _table(found: "Drift") -> Table:
    table = Table(box=None, padding=(0, 2, 0, 0))
    for name in ("length m", "translation %", "rotation deg/m", "segments"):
        table.add_column(name, justify="right")
    for length_m, percent, degrees, count in found.by_length:
        table.add_row(f"{length_m:.0f}", f"{percent:.4f}", f"{degrees:.6f}", str(count))
    percent, degrees = found.translation_percent, found.rotation_deg_per_m
    figures = ("-", "-") if percent is None or degrees is None else (f"{percent:.4f}", f"{degrees:.6f}")
    table.add_row("all", *figures, str(found.segments))
    return table
