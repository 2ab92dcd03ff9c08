"""Test targets of a data set on its plan: a cross with the kind of each.

Targets are listed in the config of echoscape.json. Some are given relative to the start of the drive
(`scenes.io.target_toml`), which is the pose of the car at the first azimuth of the first scan.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from numpy.typing import NDArray

from echoscape.eval.figures.style import INK, PAGE, TARGET_COLOUR, font_family
from echoscape.scenes.io.target_toml import AnyTarget, placed_targets
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.files.typed_json import from_json

_MAX_LABELLED = 20
"""Targets up to which each is labelled; more labels would hide the plan."""


@dataclass(frozen=True, kw_only=True)
class TargetMark:
    """A test target on a plan.

    Attributes:
        kind: Kind of the target, as in its file.
        x_m: Position in the world [m].
        y_m: Position in the world [m].
    """

    kind: str
    x_m: float
    y_m: float


def target_marks(content: dict[str, Any], *, start: NDArray[np.float64]) -> tuple[TargetMark, ...]:
    """Return the test targets of a data set, those of its scene first.

    Args:
        content: Content of echoscape.json.
        start: Pose (4,) of the car at the start of its drive: x, y, z [m], yaw [rad].

    Returns:
        A mark for each target.

    Raises:
        DatasetError: An entry describes no target.
    """
    config = content["config"]
    entries = [*((config.get("scene") or {}).get("targets", ())), *config.get("targets", ())]
    try:
        targets = from_json(tuple[AnyTarget, ...], entries, "config.targets")
    except DatasetError as error:
        raise DatasetError(f"echoscape.json: {error}") from error
    placed = placed_targets(targets, start=start)
    return tuple(
        TargetMark(kind=each.kind, x_m=each.position_m[0], y_m=each.position_m[1]) for each in placed
    )


def draw_target_marks(axes: Axes, marks: tuple[TargetMark, ...]) -> None:
    """Draw a cross for each target and its kind beside it.

    Args:
        axes: Axes of a plan in metres of the world.
        marks: The targets.
    """
    edge = [patheffects.withStroke(linewidth=2.6, foreground=PAGE)]
    for mark in marks:
        axes.plot(mark.x_m, mark.y_m, "x", ms=7, mew=2, color=TARGET_COLOUR, path_effects=edge, zorder=6)
        if len(marks) <= _MAX_LABELLED:
            axes.annotate(
                mark.kind, (mark.x_m, mark.y_m), xytext=(7, 0), textcoords="offset points", va="center",
                size=7.5, color=INK, family=font_family(), path_effects=edge, zorder=6, annotation_clip=True,
            )  # fmt: skip
