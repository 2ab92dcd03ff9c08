"""The files of an odometry: motion in Oxford's columns, trajectories for KITTI's and TUM's tools, figures.

As in KISS-ICP (Vizzo et al., RA-L 2023) a run leaves one folder. All of it is made before the first file is
written; metrics.json comes last, so that a folder which has it is whole.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from echoscape.eval.odometry.interface import OdometryMethod, PairFailed, State
from echoscape.eval.odometry.metrics import metrics, pair_errors
from echoscape.eval.odometry.plots import matches_picture, pairs_picture, trajectory_picture
from echoscape.eval.odometry.run import OdometryResult
from echoscape.eval.odometry.trajectory_io import kitti_text, matrices, tum_text
from echoscape.sim.datasets.files.atomic_write import write_whole
from echoscape.sim.datasets.layouts.oxford import OdometryRow, write_odometry
from echoscape.sim.datasets.scan_folder import ScanFolder
from echoscape.sim.datasets.se2 import relative

METRICS = "metrics.json"
_OPTIONAL = ("truth.txt", "truth.tum", "matches.png")
_SHOWN = 0.9
"""Which of the pairs is drawn: the one whose motion exceeds this share of the others'."""


def write_odometry_report(
    out: Path,
    odometry: OdometryResult,
    folder: ScanFolder,
    estimator: OdometryMethod[State],
    more: Mapping[str, Any] | None = None,
) -> tuple[Path, ...]:
    """Write everything to the folder `out`, which is made where it is not; return the files.

    more: figures that go into metrics.json beside those of the odometry.

    Raises:
        DatasetError: the scans of the pair to draw can no longer be read.
        OSError: the folder cannot be written to.
    """
    files = report_files(odometry)
    if (picture := _matches(odometry, folder, estimator)) is not None:
        files["matches.png"] = picture
    figures = (json.dumps({**metrics(odometry), **(more or {})}, indent=1, allow_nan=False) + "\n").encode()
    out.mkdir(parents=True, exist_ok=True)
    for name in (METRICS, *_OPTIONAL):  # of a run before, which may have had what this one has not
        (out / name).unlink(missing_ok=True)
    write_odometry(out / "odometry.csv", _rows(odometry))
    for name, content in {**files, METRICS: figures}.items():
        write_whole(out / name, content)
    return tuple(out / name for name in ("odometry.csv", *files, METRICS))


def report_files(odometry: OdometryResult) -> dict[str, bytes]:
    """Return the contents of the files that need nothing but the odometry, by name."""
    poses, times_us = matrices(odometry.poses), odometry.middle_us
    files = {
        "pairs.csv": pairs_text(odometry).encode(),
        "trajectory.txt": kitti_text(poses).encode(),
        "trajectory.tum": tum_text(times_us, poses).encode(),
    }
    if odometry.truth is not None and np.isfinite(odometry.truth).all():
        true = matrices(relative(odometry.truth[0], odometry.truth))
        files["truth.txt"] = kitti_text(true).encode()
        files["truth.tum"] = tum_text(times_us, true).encode()
    files["trajectory.png"] = trajectory_picture(odometry)
    files["pairs.png"] = pairs_picture(odometry)
    return files


def pairs_text(odometry: OdometryResult) -> str:
    """Return a line a pair with its state, errors, matches and time; empty where there is none."""
    lines = ["earlier,later,failed,error_m,error_deg,matches,seconds,reason"]
    for i, (pair, (error_m, error_rad)) in enumerate(
        zip(odometry.pairs, pair_errors(odometry).tolist(), strict=True)
    ):
        errors = ("", "") if np.isnan(error_m) else (f"{error_m:.6f}", f"{np.degrees(error_rad):.6f}")
        reason = (pair.failure or "").replace('"', "'").replace("\n", " ")
        words = (
            str(odometry.names[i]),
            str(odometry.names[i + 1]),
            str(int(pair.motion is None)),
            *errors,
            "" if pair.matches is None else str(pair.matches),
            f"{pair.seconds:.4f}",
            f'"{reason}"' if reason else "",
        )
        lines.append(",".join(words))
    return "\n".join(lines) + "\n"


def _rows(odometry: OdometryResult) -> list[OdometryRow]:
    """Return the motion of every pair; of failed ones none."""
    return [
        OdometryRow(
            source_us=int(odometry.middle_us[i + 1]),
            destination_us=int(odometry.middle_us[i]),
            x=x,
            y=y,
            z=0.0,
            roll=0.0,
            pitch=0.0,
            yaw=yaw,
            source_radar_us=odometry.names[i + 1],
            destination_radar_us=odometry.names[i],
        )
        for i, (x, y, yaw) in enumerate(odometry.motions.tolist())
    ]


def _matches(odometry: OdometryResult, folder: ScanFolder, estimator: OdometryMethod[State]) -> bytes | None:
    """Return the picture of a pair that moved much, by its two scans alone; None if there is none."""
    found = np.flatnonzero(~odometry.failed)
    if not len(found):
        return None
    moved = np.hypot(odometry.motions[found, 0], odometry.motions[found, 1])
    index = int(found[np.argsort(moved, kind="stable")[int(_SHOWN * (len(found) - 1))]])
    earlier, later = folder.read(index), folder.read(index + 1)
    try:
        motion, _ = estimator.follow(estimator.start(earlier), later)
    except PairFailed:
        return None
    title = f"Pair {index + 1} of {len(odometry.pairs)}, {odometry.method}"
    return matches_picture(earlier, later, motion, title=title)
