"""Writes the files of an odometry: motions (Oxford's columns), trajectories (KITTI, TUM), metrics and plots.

As in KISS-ICP (Vizzo et al., RA-L 2023) a run leaves one folder. Everything is made before the first file is
written; metrics.json comes last, so that a folder that has it is complete.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from echoscape.eval.odometry.metrics import odometry_metrics, pair_errors
from echoscape.eval.odometry.plots import matches_figure, pairs_figure, trajectory_figure
from echoscape.eval.odometry.run import OdometryResult
from echoscape.eval.odometry.trajectory_io import kitti_text, matrices, tum_text
from echoscape.sim.datasets.files.atomic_write import write_atomic
from echoscape.sim.datasets.layouts.oxford import OdometryRow, write_odometry
from echoscape.sim.datasets.scan_folder import ScanFolder
from echoscape.sim.datasets.se2 import relative

METRICS = "metrics.json"
"""Name of the file with the metrics."""
_OPTIONAL = ("truth.txt", "truth.tum", "matches.png")
_PAIR_COLUMNS = (
    "earlier_scan",
    "later_scan",
    "failed",
    "translation_error_m",
    "rotation_error_deg",
    "matches",
    "time_s",
    "reason",
)


def write_odometry_report(
    out: Path, result: OdometryResult, folder: ScanFolder, extra: Mapping[str, Any] | None = None
) -> tuple[Path, ...]:
    """Write all files of an odometry.

    Args:
        out: Folder to write to, made if it does not exist.
        result: The odometry.
        folder: The scans, of which the worst pair is drawn.
        extra: Values that go into metrics.json beside those of the odometry.

    Returns:
        Paths of the files.

    Raises:
        DatasetError: The scans of the worst pair can no longer be read.
        OSError: The folder cannot be written to.
    """
    files = report_files(result)
    if (figure := _worst_pair_figure(result, folder)) is not None:
        files["matches.png"] = figure
    metrics = {**odometry_metrics(result), **(extra or {})}
    content = (json.dumps(metrics, indent=1, allow_nan=False) + "\n").encode()
    out.mkdir(parents=True, exist_ok=True)
    for name in (METRICS, *_OPTIONAL):  # an earlier run may have left files that this one does not write
        (out / name).unlink(missing_ok=True)
    write_odometry(out / "odometry.csv", _rows(result))
    for name, data in {**files, METRICS: content}.items():
        write_atomic(out / name, data)
    return tuple(out / name for name in ("odometry.csv", *files, METRICS))


def report_files(result: OdometryResult) -> dict[str, bytes]:
    """Make the files that need nothing but the result.

    Args:
        result: The odometry.

    Returns:
        Content by name of the file.
    """
    poses, times_us = matrices(result.poses), result.middle_us
    files = {
        "pairs.csv": pairs_text(result).encode(),
        "trajectory.txt": kitti_text(poses).encode(),
        "trajectory.tum": tum_text(times_us, poses).encode(),
    }
    if result.truth is not None and np.isfinite(result.truth).all():
        true = matrices(relative(result.truth[0], result.truth))
        files["truth.txt"] = kitti_text(true).encode()
        files["truth.tum"] = tum_text(times_us, true).encode()
    files["trajectory.png"] = trajectory_figure(result)
    files["pairs.png"] = pairs_figure(result)
    return files


def pairs_text(result: OdometryResult) -> str:
    """Write the results of all pairs as CSV.

    Args:
        result: The odometry.

    Returns:
        A line for each pair: its scans, whether it failed, its errors, number of matches, time, and why it
        failed; what is unknown is empty.
    """
    lines = [",".join(_PAIR_COLUMNS)]
    for i, (pair, (error_m, error_rad)) in enumerate(
        zip(result.pairs, pair_errors(result).tolist(), strict=True)
    ):
        errors = ("", "") if np.isnan(error_m) else (f"{error_m:.6f}", f"{np.degrees(error_rad):.6f}")
        reason = (pair.failure or "").replace('"', "'").replace("\n", " ")
        values = (
            str(result.names[i]),
            str(result.names[i + 1]),
            str(int(pair.motion is None)),
            *errors,
            "" if pair.matches is None else str(pair.matches),
            f"{pair.seconds:.4f}",
            f'"{reason}"' if reason else "",
        )
        lines.append(",".join(values))
    return "\n".join(lines) + "\n"


def _rows(result: OdometryResult) -> list[OdometryRow]:
    """Return the motion of every pair, 0 for failed ones."""
    return [
        OdometryRow(
            source_us=int(result.middle_us[i + 1]),
            destination_us=int(result.middle_us[i]),
            x=x,
            y=y,
            z=0.0,
            roll=0.0,
            pitch=0.0,
            yaw=yaw,
            source_radar_us=result.names[i + 1],
            destination_radar_us=result.names[i],
        )
        for i, (x, y, yaw) in enumerate(result.motions.tolist())
    ]


def _worst_pair_figure(result: OdometryResult, folder: ScanFolder) -> bytes | None:
    """Return the figure of the worst pair, None if every pair failed."""
    if result.worst is None:
        return None
    index = result.worst.index
    title = f"Pair {index + 1} of {len(result.pairs)}, {result.method}: {result.worst.criterion}"
    error_m, error_rad = pair_errors(result)[index].tolist()
    if not np.isnan(error_m):
        title += f", {error_m:.3f} m and {np.degrees(error_rad):.2f} deg"
    true = None if np.isnan(error_m) or result.true_motions is None else result.true_motions[index]
    scans = folder.read(index), folder.read(index + 1)
    return matches_figure(*scans, result.worst.motion, title=title, true_motion=true)
