"""`echoscape odometry DATA --out RES`: odometry over a folder of scans, with truth an evaluation."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro
from rich.console import Console
from rich.table import Table

from echoscape.cli.arguments import in_option_names, parse, with_config_file
from echoscape.cli.progress import ProgressBars
from echoscape.cli.torch_setup import check_threads, require_torch, use_threads

if TYPE_CHECKING:
    from echoscape.eval.odometry.interface import OdometryMethod
    from echoscape.eval.odometry.loop_closure import Places
    from echoscape.eval.odometry.run import OdometryResult
    from echoscape.sim.datasets.scan_folder import ScanFolder


@dataclass(frozen=True, kw_only=True)
class Options:
    """Estimate the motion between successive scans of a folder, and evaluate it where the folder has truth.

    Writes odometry.csv (Oxford's columns), trajectory.txt (KITTI) and trajectory.tum, pairs.csv, figures,
    and metrics.json. A pair that fails is recorded and counts as no motion.
    """

    data: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DATA")]
    """Folder of scans: one of echoscape's, or real ones (Oxford, MulRan, Boreas), with truth or without."""
    out: Path
    """Folder to write to, other than a data set; files of an earlier run are replaced."""
    method: Literal["learned", "fourier", "cen2018", "cen2019"] = "learned"
    """learned: keypoints; fourier: phase correlation; cen2018, cen2019: hand-made keypoints. Only the first
    needs weights and PyTorch."""
    weights: Path | None = None
    """Weights of the learned method; by default the bundled ones."""
    resolution: float | None = None
    """Which of the bundled weights: width of a pixel [m]; by default the coarsest, which are the fastest."""
    solver: Literal["keyframe", "robust", "paper"] = "keyframe"
    """How the learned method solves poses. keyframe: robust, with the scan before and a keyframe together.
    robust: each pair by itself, outliers weighted down. paper: the published solver (least squares of each
    pair, every pixel, float32); the bundled weights were trained otherwise."""
    compensate: bool = True
    """Move keypoints to mid-scan and undo their Doppler shifts, at the velocity estimated from the pair
    itself, before its pose is solved. Learned method only; --solver paper never does."""
    loop_pairs: int = 0
    """Pairs of scans of one place at random headings on which loop closure is evaluated as well; the figures
    go into metrics.json. Learned method only."""
    device: Literal["auto", "cpu", "cuda"] = "auto"
    """Where the learned method runs; auto takes a GPU where PyTorch finds one."""
    threads: int = 1
    """Threads of the learned method on the CPU; the result does not depend on it. Use more than one only
    on idle cores: threads that wait for each other are many times slower than one."""
    config: Path | None = None
    """TOML file of options: keys are their names, booleans are written as compensate = false. Options on
    the command line override it."""


def main(arguments: Sequence[str]) -> int:
    """Run the subcommand.

    Args:
        arguments: The words after `echoscape odometry`.

    Returns:
        The exit code: 0 done, 1 every pair failed, 2 bad input.
    """
    try:
        words = with_config_file(Options, arguments)
        options = parse(Options, prog="echoscape odometry", words=words)
        _check(options, words)
        result, figures, paths = _run(options)
    except ValueError as error:  # errors of a data set among them
        return _refuse(in_option_names(Options, str(error)), 2)
    except OSError as error:
        return _refuse(f"{error.filename}: {error.strerror}" if error.filename else str(error), 2)
    console = Console()
    console.print(_table(figures))
    for path in paths:
        console.print(str(path), soft_wrap=True, highlight=False)
    if not result.failed.all():
        return 0
    return _refuse(f"every pair failed, the first one because: {result.pairs[0].failure}", 1)


def _run(options: Options) -> "tuple[OdometryResult, dict[str, Any], tuple[Path, ...]]":
    """Run the method and write its files; nothing is written before all results are there."""
    from echoscape.eval.odometry.metrics import odometry_metrics
    from echoscape.eval.odometry.report import write_odometry_report
    from echoscape.eval.odometry.run import run_odometry
    from echoscape.sim.datasets.files.output_folder import check_no_dataset, check_output_folder
    from echoscape.sim.datasets.scan_folder import open_folder
    from echoscape.sim.numerics.malloc import keep_freed_memory

    folder = open_folder(options.data)
    check_output_folder(options.out)
    check_no_dataset(options.out, options.data)
    keep_freed_memory()
    method = _method(options, folder)
    places = _places(options, folder)
    with ProgressBars(Console(stderr=True)) as bars:
        result = run_odometry(folder, method, progress=bars.report)
        loop_closure = _loop_closure(places, folder, method, bars)
        bars.report("report", 0, 1)
        paths = write_odometry_report(options.out, result, folder, loop_closure)
        bars.report("report", 1, 1)
    return result, {**odometry_metrics(result), **loop_closure}, paths


def _check(options: Options, words: Sequence[str]) -> None:
    """Refuse options that do not go together or cannot be carried out."""
    asked_to_compensate = options.compensate and "--compensate" in words
    if options.resolution is not None and options.weights is not None:
        raise ValueError("--resolution chooses among the bundled weights: not with --weights")
    for flag, given in {
        "--weights": options.weights is not None,
        "--resolution": options.resolution is not None,
        "--solver": options.solver != "keyframe",
        "--compensate": asked_to_compensate,
        "--no-compensate": not options.compensate,
        "--loop-pairs": options.loop_pairs != 0,
        "--device": options.device != "auto",
        "--threads": options.threads != 1,
    }.items():
        if given and options.method != "learned":
            raise ValueError(f"{flag} goes with --method learned only, got --method {options.method}")
    if options.loop_pairs and options.solver == "paper":
        raise ValueError("--loop-pairs goes with --solver keyframe or robust, got --solver paper")
    if asked_to_compensate and options.solver == "paper":
        raise ValueError("--compensate goes with --solver keyframe or robust, got --solver paper")
    if options.loop_pairs < 0:
        raise ValueError(f"--loop-pairs must be 0 or more, got {options.loop_pairs}")
    check_threads(options.threads)
    if options.method == "learned":
        require_torch("--method learned")


def _method(options: Options, folder: "ScanFolder") -> "OdometryMethod[Any]":
    """Return the odometry method for a folder's radar."""
    if options.method != "learned":
        from echoscape.eval.odometry.methods import build_method, method_choice

        choice = method_choice(options.method)
        return build_method(choice, folder.sensor, range_offset_m=folder.range_offset_m)
    from echoscape.eval.odometry.learned import learned_odometry
    from echoscape.learn.model.weights import chosen_weights

    use_threads(options.threads)
    # Mean over azimuths: alternating chirps shift every other azimuth the other way, on average by 0.
    shift_s = -float(folder.sensor.doppler_shift_s.mean()) if options.compensate else None
    return learned_odometry(
        options.weights or chosen_weights(options.resolution),
        solver=options.solver,
        device=options.device,
        range_offset_m=folder.range_offset_m,
        doppler_beta_s=shift_s,
    )


def _places(options: Options, folder: "ScanFolder") -> "Places | None":
    """Return the pairs for loop closure, or None where none are asked for."""
    if not options.loop_pairs:
        return None
    from echoscape.eval.odometry.loop_closure import places_of

    return places_of(folder, options.loop_pairs)


def _loop_closure(
    places: "Places | None", folder: "ScanFolder", method: "OdometryMethod[Any]", bars: ProgressBars
) -> "dict[str, Any]":
    """Return the figures of loop closure under `loop_closure`, or nothing without `places`."""
    if places is None:
        return {}
    from echoscape.eval.odometry.learned import LearnedOdometry
    from echoscape.eval.odometry.loop_closure import loop_closure_recall

    assert isinstance(method, LearnedOdometry)
    recall = loop_closure_recall(folder, method.matcher, places, progress=bars.report)
    return {"loop_closure": recall}


def _table(figures: "dict[str, Any]") -> Table:
    """Return the main figures as a small table."""
    table = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    failed, drift = figures["failed_pairs"], figures["kitti_drift"]
    failed = f", [red]{failed} failed[/red]" if failed else ", none failed"
    table.add_row("pairs", f"{figures['pairs']}{failed}")
    if figures["pairs_with_truth"]:
        for name, label, unit in (
            ("translation_error_m", "translation", "m"),
            ("rotation_error_deg", "rotation", "deg"),
        ):
            mean, median, largest = (figures[name + ending] for ending in ("_mean", "_median", "_max"))
            table.add_row(
                label, f"error {mean:.4f} {unit} a pair, median {median:.4f}, largest {largest:.4f}"
            )
    else:
        table.add_row("truth", "none in this folder")
    if drift["segments"]:
        degrees = 100 * drift["rotation_deg_per_m"]
        table.add_row("drift", f"{drift['translation_percent']:.2f} %, {degrees:.3f} deg per 100 m")
    elif figures["pairs_with_truth"]:
        table.add_row("drift", f"unknown: {figures['path_m']:.0f} m hold no segment of 100 m")
    if "loop_closure" in figures:
        loop = figures["loop_closure"]
        shares = f"{100 * loop['within']:.0f} %, {100 * loop['plain_within']:.0f} % without hypotheses"
        table.add_row("any heading", f"{shares}, of {loop['pairs']} within 0.5 m and 1 deg")
    if figures["pairs_per_s"] is not None:
        table.add_row("speed", f"{figures['pairs_per_s']:.2f} pairs per second")
    return table


def _refuse(message: str, code: int) -> int:
    print(f"echoscape odometry: {message}", file=sys.stderr)
    return code
