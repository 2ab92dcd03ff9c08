"""Test targets from a TOML file, in the world or relative to the car at the start of its drive.

The keys are documented in docs/scenes.md. In the frame "start" positions are forward, right, up and headings
clockwise from straight ahead, as always in the frame of the car (docs/conventions.md).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.materials import MATERIAL_NAMES
from echoscape.scenes.core.targets import KINDS, Target
from echoscape.scenes.io.strict_toml import Table, read_toml

FRAMES = ("world", "start")
_MOST_DBSM = 100.0
_POSITION = {"world": ("x", "y", "z"), "start": ("forward", "right", "up")}


@dataclass(frozen=True, kw_only=True)
class FromStart:
    """A target given relative to the car at the start of its drive.

    Attributes:
        target: The target; its position_m is forward, right, up [m] from the ground below the car's centre,
            its heading_rad clockwise from straight ahead.
    """

    target: Target

    def placed(self, start: NDArray[np.float64]) -> Target:
        """Convert the target to world coordinates.

        Args:
            start: x, y, z [m] and yaw [rad] of the car at the start (4,).

        Returns:
            The target in the world.
        """
        x, y, z, yaw = (float(value) for value in start)
        forward, right, up = self.target.position_m
        cos, sin = math.cos(yaw), math.sin(yaw)
        position = (x + cos * forward + sin * right, y + sin * forward - cos * right, z + up)
        return replace(self.target, position_m=position, heading_rad=yaw - self.target.heading_rad)


AnyTarget = Target | FromStart
"""A target in the world or relative to the start of the drive."""


def placed_targets(targets: Sequence[AnyTarget], *, start: NDArray[np.float64]) -> tuple[Target, ...]:
    """Convert targets to world coordinates.

    Args:
        targets: Targets in either frame.
        start: x, y, z [m] and yaw [rad] of the car at 0 s (4,).

    Returns:
        The targets in the world.
    """
    return tuple(target.placed(start) if isinstance(target, FromStart) else target for target in targets)


def read_targets(path: str | Path) -> tuple[AnyTarget, ...]:
    """Read the targets of a TOML file.

    Args:
        path: The file.

    Returns:
        Its targets.

    Raises:
        SceneError: The file cannot be read, has no target or an invalid one; the message names the file, the
            number of the target and the key.
    """
    table = read_toml(Path(path))
    targets = targets_of(table)
    table.reject_unknown_keys()
    if not targets:
        raise table.error("contains no [[target]]")
    return targets


def targets_of(table: Table) -> tuple[AnyTarget, ...]:
    """Read the `[[target]]` entries of a table.

    Args:
        table: The table.

    Returns:
        Its targets; may be none.

    Raises:
        SceneError: A target is invalid.
    """
    return tuple(_target(entry) for entry in table.tables("target"))


def _target(entry: Table) -> AnyTarget:
    """Read one `[[target]]` entry."""
    kind = entry.string("kind", allowed=tuple(KINDS))
    frame = entry.string("frame", "world", allowed=FRAMES)
    position = entry.numbers("position_m", _POSITION[frame])
    heading = math.radians(entry.number("heading_deg", 0.0))
    elevation = math.radians(entry.number("elevation_deg", 0.0)) if KINDS[kind].flat else 0.0
    sizes = KINDS[kind].sizes
    size = entry.numbers("size_m", sizes) if sizes else ()
    material = entry.string("material", "metal", allowed=MATERIAL_NAMES) if kind != "point" else "metal"
    rcs_dbsm = entry.number("rcs_dbsm", 0.0) if kind == "point" else 0.0
    if abs(rcs_dbsm) > _MOST_DBSM:
        raise entry.error(f"rcs_dbsm must be within -{_MOST_DBSM:g} and {_MOST_DBSM:g}, got {rcs_dbsm:g}")
    entry.reject_unknown_keys()
    try:
        target = Target(
            kind=kind,
            position_m=(position[0], position[1], position[2]),
            heading_rad=heading,
            elevation_rad=elevation,
            size_m=size,
            material=material,
            rcs_m2=10 ** (rcs_dbsm / 10),
        )
    except ValueError as error:
        raise entry.error(str(error)) from error
    return FromStart(target=target) if frame == "start" else target
