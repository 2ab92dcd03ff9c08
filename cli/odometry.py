"""`echoscape odometry DATA --out RES`: run an odometry over a folder of scans and write what it found."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro
from rich.console import Console
from rich.table import Table

from echoscape.cli.arguments import parsed
from echoscape.cli.progress import Stages

if TYPE_CHECKING:
    from echoscape.eval.odometry.interface import OdometryMethod
    from echoscape.eval.odometry.loop_closure import Places
    from echoscape.eval.odometry.run import OdometryResult
    from echoscape.sim.datasets.scan_folder import ScanFolder


@dataclass(frozen=True, kw_only=True)
class Options:
    """Estimate the motion between successive scans of a folder, and judge it where the folder has truth.

    Writes odometry.csv (Oxford's columns), trajectory.txt (KITTI) and trajectory.tum, pairs.csv, pictures,
    and metrics.json. A pair that fails is recorded and counts as no motion.
    """

    data: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DATA")]
    """Folder of scans: one of echoscape's, or real ones (Oxford, MulRan, Boreas), with truth or without."""
    out: Path
    """Folder to write to."""
    method: Literal["learned", "fourier"] = "learned"
    """learned: keypoints; fourier: phase correlation, which needs no weights."""
    weights: Path | None = None
    """Weights of the learned method; by default those that came with the package."""
    resolution: float | None = None
    """Which of the weights that came along: width of a pixel [m]; by default the coarsest, which are
    the fastest."""
    compensate: bool = True
    """Move keypoints to mid-scan and undo their Doppler shifts, at the velocity that each pair tells, before
    its pose is solved. Of the learned method."""
    pairs_alone: bool = False
    """Every pair by itself, as in the paper, in place of following scans from keyframe to keyframe. Learned
    method only."""
    loop_pairs: int = 0
    """Pairs of scans of one place, turned to any heading, to find as loop closure must, besides; the figures
    go into metrics.json. Learned method only."""


def main(arguments: Sequence[str]) -> int:
    """Run the subcommand and return its exit code: 0 done, 1 every pair failed, 2 bad input."""
    try:
        found, figures, paths = _run(parsed(Options, prog="echoscape odometry", arguments=arguments))
    except ValueError as error:  # what a data set lacks is one of them
        return _refused(str(error), 2)
    except OSError as error:
        return _refused(f"{error.filename}: {error.strerror}" if error.filename else str(error), 2)
    console = Console()
    console.print(_table(figures))
    for path in paths:
        console.print(str(path), soft_wrap=True, highlight=False)
    if not found.failed.all():
        return 0
    return _refused(f"every pair failed, the first one because: {found.pairs[0].failure}", 1)


def _run(options: Options) -> "tuple[OdometryResult, dict[str, Any], tuple[Path, ...]]":
    """Run the odometry and write its files; nothing is written before all of it is there."""
    from echoscape.eval.odometry.loop_closure import places_of
    from echoscape.eval.odometry.metrics import metrics
    from echoscape.eval.odometry.report import write_odometry_report
    from echoscape.eval.odometry.run import run_odometry
    from echoscape.sim.datasets.files.atomic_write import check_out
    from echoscape.sim.datasets.scan_folder import open_folder
    from echoscape.sim.numerics.malloc import keep_freed_memory

    if options.weights is not None and options.method != "learned":
        raise ValueError(f"--weights go with --method learned only, got --method {options.method}")
    if options.resolution is not None and options.weights is not None:
        raise ValueError("--resolution chooses among the weights that come along: not with --weights")
    for flag, given in {
        "--resolution": options.resolution is not None,
        "--pairs-alone": options.pairs_alone,
        "--loop-pairs": options.loop_pairs,
    }.items():
        if given and options.method != "learned":
            raise ValueError(f"{flag} goes with --method learned only, got --method {options.method}")
    if options.loop_pairs < 0:
        raise ValueError(f"--loop-pairs must be 0 or more, got {options.loop_pairs}")
    folder = open_folder(options.data)
    check_out(options.out)
    keep_freed_memory()
    estimator = _estimator(options, folder)
    places = places_of(folder, options.loop_pairs) if options.loop_pairs else None
    with Stages(Console(stderr=True)) as stages:
        found = run_odometry(folder, estimator, progress=stages.report)
        more = _any_heading(places, folder, estimator, stages)
        stages.report("report", 0, 1)
        paths = write_odometry_report(options.out, found, folder, estimator, more)
        stages.report("report", 1, 1)
    return found, {**metrics(found), **more}, paths


def _any_heading(
    places: "Places | None", folder: "ScanFolder", estimator: "OdometryMethod[Any]", stages: Stages
) -> "dict[str, Any]":
    """Return the figures of turned pairs under `loop_closure_recall`, or nothing where they are not asked for."""
    from echoscape.eval.odometry.learned import LearnedOdometry
    from echoscape.eval.odometry.loop_closure import loop_closure_recall

    if places is None or not isinstance(estimator, LearnedOdometry):
        return {}
    return {"loop_closure": loop_closure_recall(folder, estimator.estimator, places, progress=stages.report)}


def _estimator(options: Options, folder: "ScanFolder") -> "OdometryMethod[Any]":
    """Return the estimator for a folder's radar."""
    if options.method == "fourier":
        from echoscape.eval.odometry.fourier_mellin import FourierOdometry

        return FourierOdometry(range_offset_m=folder.range_offset_m)
    from echoscape.eval.odometry.learned import chosen_weights, learned_odometry
    from echoscape.learn.odometry.keyframe_odometry import PAIRS_ALONE, OdometryConfig

    # Sweeps that alternate shift every other row the other way: on average not at all.
    shift_s = -float(folder.sensor.doppler_shift_s.mean()) if options.compensate else None
    weights = options.weights or chosen_weights(options.resolution)
    settings = PAIRS_ALONE if options.pairs_alone else OdometryConfig()
    return learned_odometry(
        weights, range_offset_m=folder.range_offset_m, doppler_beta_s=shift_s, settings=settings
    )


def _table(figures: "dict[str, Any]") -> Table:
    """Return the main figures as a small table."""
    table = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    failed = f", [red]{figures['failed']} failed[/red]" if figures["failed"] else ", none failed"
    table.add_row("pairs", f"{figures['pairs']}{failed}")
    if figures["judged"]:
        for name, label, unit in (
            ("pair_translation_m", "translation", "m"),
            ("pair_rotation_deg", "rotation", "deg"),
        ):
            mean, median, most = (figures[name + ending] for ending in ("", "_median", "_max"))
            table.add_row(label, f"{mean:.4f} {unit} a pair, median {median:.4f}, at most {most:.4f}")
    else:
        table.add_row("truth", "none in this folder")
    if figures["segments"]:
        degrees = 100 * figures["rotation_deg_per_m"]
        table.add_row("drift", f"{figures['translation_percent']:.2f} %, {degrees:.3f} deg a 100 m")
    elif figures["judged"]:
        table.add_row("drift", f"unknown: {figures['way_m']:.0f} m hold no segment of 100 m")
    if "loop_closure" in figures:
        turned = figures["loop_closure"]
        shares = f"{100 * turned['within']:.0f} %, {100 * turned['plain_within']:.0f} % without hypotheses"
        table.add_row("any heading", f"{shares}, of {turned['pairs']} within 0.5 m and 1 deg")
    if figures["hz"] is not None:
        table.add_row("speed", f"{figures['hz']:.2f} pairs a second")
    return table


def _refused(message: str, code: int) -> int:
    print(f"echoscape odometry: {message}", file=sys.stderr)
    return code
