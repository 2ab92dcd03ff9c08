"""A table of what `echoscape odometry` wrote for several folders, with their means.

    python -m benchmarks.odometry_table RES [RES ...]

Means are over folders, each counting alike; drift is KITTI's with first frames every 10.
"""

import argparse
import json
import statistics
from pathlib import Path
from typing import Any

COLUMNS = (
    ("pairs", "pairs", 0),
    ("failed", "failed", 0),
    ("pair_translation_m", "error [m]", 3),
    ("pair_translation_m_median", "median [m]", 3),
    ("pair_rotation_deg", "error [deg]", 3),
    ("pair_rotation_deg_median", "median [deg]", 3),
    ("translation_percent", "drift [%]", 2),
    ("rotation_deg_per_m", "drift [deg/m]", 4),
    ("within", "any heading within", 3),
    ("plain_within", "plain within", 3),
    ("hz", "pairs/s", 1),
)


def main() -> None:
    """Read and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("results", type=Path, nargs="+", help="folders that `echoscape odometry` wrote")
    found = [(path.name, _figures(path)) for path in parser.parse_args().results]
    print("| | " + " | ".join(label for _, label, _ in COLUMNS) + " |")
    print("|---" * (len(COLUMNS) + 1) + "|")
    for name, figures in [*found, ("mean", _means([each for _, each in found]))]:
        cells = [_cell(figures.get(key), digits) for key, _, digits in COLUMNS]
        print(f"| {name} | " + " | ".join(cells) + " |")


def _figures(folder: Path) -> dict[str, Any]:
    figures = json.loads((folder / "metrics.json").read_text())
    return {**figures, **{key: figures.get("any_heading", {}).get(key) for key in ("within", "plain_within")}}


def _means(found: list[dict[str, Any]]) -> dict[str, float]:
    values = {key: [each[key] for each in found if each.get(key) is not None] for key, _, _ in COLUMNS}
    return {key: statistics.fmean(each) for key, each in values.items() if each}


def _cell(value: float | None, digits: int) -> str:
    return "" if value is None else f"{value:.{digits}f}"


if __name__ == "__main__":
    main()
