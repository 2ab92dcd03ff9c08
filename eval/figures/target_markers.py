"""Test targets of a dataset in its plan: where they stand, a small cross each with its kind.

They are those of the recipe in echoscape.json; some are placed as seen from the drive's start
(`scenes.io.target_toml`), which is the car's pose at the first row of the first scan.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from numpy.typing import NDArray

from echoscape.scenes.core.targets import Target
from echoscape.scenes.io.target_toml import FromStart, placed_targets
from echoscape.sim.datasets.files.atomic_write import DatasetError

TARGET_COLOUR = "#ff5fa2"
_MOST_TOLD = 20
"""Targets up to which each is told by its kind; more would hide the plan."""


@dataclass(frozen=True, kw_only=True)
class TargetMark:
    """A target seen from above: its kind and its place x_m, y_m in the world."""

    kind: str
    x_m: float
    y_m: float


def target_marks(content: dict[str, Any], *, start: NDArray[np.float64]) -> tuple[TargetMark, ...]:
    """Return the marks of a manifest's targets, those of its scene first.

    content: of echoscape.json; start (4,): x, y, z [m] and yaw [rad] of the car as its drive begins.

    Raises:
        DatasetError: an entry describes no target.
    """
    recipe = content["recipe"]
    told = [*((recipe.get("scene") or {}).get("targets", ())), *recipe.get("targets", ())]
    try:
        targets = [
            FromStart(target=_target(each["target"])) if "target" in each else _target(each) for each in told
        ]
    except (TypeError, ValueError) as error:
        raise DatasetError(f"echoscape.json: an entry of targets describes none ({error})") from error
    placed = placed_targets(targets, start=start)
    return tuple(
        TargetMark(kind=each.kind, x_m=each.position_m[0], y_m=each.position_m[1]) for each in placed
    )


def _target(told: dict[str, Any]) -> Target:
    """Return a target as JSON tells it: lists for tuples."""
    settings: dict[str, Any] = {
        name: tuple(value) if isinstance(value, list) else value for name, value in told.items()
    }
    return Target(**settings)


def draw_target_marks(
    axes: Axes, marks: tuple[TargetMark, ...], *, ink: str, glow: str, family: list[str]
) -> None:
    """Draw a small cross for each target and beside it its kind, in `ink` with an edge of `glow`."""
    edge = [patheffects.withStroke(linewidth=2.6, foreground=glow)]
    for mark in marks:
        axes.plot(mark.x_m, mark.y_m, "x", ms=7, mew=2, color=TARGET_COLOUR, path_effects=edge, zorder=6)
        if len(marks) <= _MOST_TOLD:
            axes.annotate(
                mark.kind, (mark.x_m, mark.y_m), xytext=(7, 0), textcoords="offset points", va="center",
                size=7.5, color=ink, family=family, path_effects=edge, zorder=6, annotation_clip=True,
            )  # fmt: skip
