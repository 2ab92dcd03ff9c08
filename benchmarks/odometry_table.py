"""A table of the metrics that `echoscape odometry` wrote for several folders, with their means.

    python -m benchmarks.odometry_table RES [RES ...]

Means are over folders with equal weight; drift is KITTI's, with segments from every 10th scan.
"""

import argparse
import json
import statistics
from pathlib import Path
from typing import Any

COLUMNS = (
    ("pairs", "pairs", 0),
    ("failed_pairs", "failed", 0),
    ("translation_error_m_mean", "error [m]", 3),
    ("translation_error_m_median", "median [m]", 3),
    ("rotation_error_deg_mean", "error [deg]", 3),
    ("rotation_error_deg_median", "median [deg]", 3),
    ("kitti_drift.translation_percent", "drift [%]", 2),
    ("kitti_drift.rotation_deg_per_m", "drift [deg/m]", 4),
    ("loop_closure.within", "loop closure recall", 3),
    ("loop_closure.plain_within", "without hypotheses", 3),
    ("pairs_per_s", "pairs/s", 1),
)
"""Key in metrics.json, with a dot before a key of a nested object; title; decimals."""


def main() -> None:
    """Read the metrics and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("results", type=Path, nargs="+", help="folders that `echoscape odometry` wrote")
    found = [(path.name, read_metrics(path)) for path in parser.parse_args().results]
    print("| | " + " | ".join(title for _, title, _ in COLUMNS) + " |")
    print("|---" * (len(COLUMNS) + 1) + "|")
    for name, values in [*found, ("mean", means([each for _, each in found]))]:
        cells = [_cell(values.get(key), digits) for key, _, digits in COLUMNS]
        print(f"| {name} | " + " | ".join(cells) + " |")


def read_metrics(folder: Path) -> dict[str, float | None]:
    """Read the metrics of one folder.

    Args:
        folder: Folder that `echoscape odometry` wrote.

    Returns:
        The value of each of `COLUMNS`, None where it is missing.
    """
    content = json.loads((folder / "metrics.json").read_text())
    return {key: _nested(content, key) for key, _, _ in COLUMNS}


def means(found: list[dict[str, float | None]]) -> dict[str, float | None]:
    """Average the metrics of several folders.

    Args:
        found: The metrics of each.

    Returns:
        The mean of each column over the folders that have it.
    """
    values = {key: [value for each in found if (value := each[key]) is not None] for key, _, _ in COLUMNS}
    return {key: statistics.fmean(each) if each else None for key, each in values.items()}


def _nested(content: dict[str, Any], key: str) -> float | None:
    """Return the value of a key with dots, None where it is missing."""
    first, _, rest = key.partition(".")
    value = content.get(first)
    return _nested(value, rest) if rest and isinstance(value, dict) else value if not rest else None


def _cell(value: float | None, digits: int) -> str:
    return "" if value is None else f"{value:.{digits}f}"


if __name__ == "__main__":
    main()
