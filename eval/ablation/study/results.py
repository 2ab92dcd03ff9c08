"""The result of one method on one drive under one condition, as a file and as the metrics that are compared.

Metrics are those of eval/odometry/metrics.py: means and medians of the errors of pairs, with failed pairs
counted as no motion; drift where the drive has segments of 100 m.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from echoscape.eval.ablation.study.conditions import Condition
from echoscape.eval.ablation.study.settings import AblationDrive
from echoscape.eval.odometry.methods import MethodChoice
from echoscape.eval.odometry.metrics import odometry_metrics, pair_errors
from echoscape.eval.odometry.run import OdometryResult
from echoscape.sim.datasets.files.atomic_write import DatasetError


@dataclass(frozen=True, kw_only=True)
class Metric:
    """A metric of a drive.

    Attributes:
        name: Name in tables.
        unit: Unit.
        title: What it is.
        digits: Digits after the point in tables that people read.
        of: Computes it from the content of a result; None where the drive is too short for it.
    """

    name: str
    unit: str
    title: str
    digits: int
    of: Callable[[dict[str, Any]], float | None]


METRICS = (
    Metric(
        name="translation_error_mean",
        unit="m",
        title="translation error of a pair, mean",
        digits=4,
        of=lambda content: content["metrics"]["translation_error_m_mean"],
    ),
    Metric(
        name="translation_error_median",
        unit="m",
        title="translation error of a pair, median",
        digits=4,
        of=lambda content: content["metrics"]["translation_error_m_median"],
    ),
    Metric(
        name="rotation_error_mean",
        unit="deg",
        title="rotation error of a pair, mean",
        digits=4,
        of=lambda content: content["metrics"]["rotation_error_deg_mean"],
    ),
    Metric(
        name="rotation_error_median",
        unit="deg",
        title="rotation error of a pair, median",
        digits=4,
        of=lambda content: content["metrics"]["rotation_error_deg_median"],
    ),
    Metric(
        name="translation_drift",
        unit="%",
        title="drift of position (KITTI)",
        digits=2,
        of=lambda content: content["metrics"]["kitti_drift"]["translation_percent"],
    ),
    Metric(
        name="rotation_drift",
        unit="deg/m",
        title="drift of heading (KITTI)",
        digits=4,
        of=lambda content: content["metrics"]["kitti_drift"]["rotation_deg_per_m"],
    ),
    Metric(
        name="failed_pairs",
        unit="%",
        title="pairs that failed",
        digits=1,
        of=lambda content: 100 * content["metrics"]["failed_pairs"] / content["metrics"]["pairs"],
    ),
)
"""The metrics that are compared, in the order of the tables."""


def metric(name: str) -> Metric:
    """Look up a metric.

    Args:
        name: Its name.

    Returns:
        The metric.
    """
    return next(each for each in METRICS if each.name == name)


def result_path(out: Path, drive: AblationDrive, condition: Condition, method: MethodChoice) -> Path:
    """Name the file of a result.

    Args:
        out: Folder of the ablation.
        drive: The drive.
        condition: The condition.
        method: The method.

    Returns:
        The path.
    """
    return out / "results" / drive.name / condition.name / f"{method.name.replace(':', '_')}.json"


def result_text(result: OdometryResult) -> str:
    """Write a result: its metrics and every pair, without times, so that a repeated run gives the same bytes.

    Args:
        result: The odometry of a drive.

    Returns:
        JSON text.
    """
    metrics = odometry_metrics(result)
    del metrics["pairs_per_s"], metrics["failures"]
    errors = pair_errors(result).tolist()
    pairs = [
        {
            "earlier": result.names[i],
            "later": result.names[i + 1],
            "motion": result.motions[i].tolist(),
            "translation_error_m": errors[i][0],
            "rotation_error_rad": errors[i][1],
            "failure": pair.failure,
        }
        for i, pair in enumerate(result.pairs)
    ]
    return json.dumps({"metrics": metrics, "pairs": pairs}, indent=1, allow_nan=False) + "\n"


def read_result(path: Path) -> dict[str, Any]:
    """Read a result.

    Args:
        path: The file.

    Returns:
        Its content.

    Raises:
        DatasetError: It is absent or no result; the message names it.
    """
    try:
        content = json.loads(path.read_text())
        for each in METRICS:
            value = each.of(content)
            if value is not None:
                float(value)
    except (OSError, ValueError, KeyError, TypeError, ZeroDivisionError) as error:
        raise DatasetError(f"{path}: no result of an ablation ({type(error).__name__}: {error})") from error
    return content


def has_result(path: Path) -> bool:
    """Check whether a result is there and can be read.

    Args:
        path: The file, which may not exist.

    Returns:
        Whether it need not be made again.
    """
    try:
        read_result(path)
    except DatasetError:
        return False
    return True
