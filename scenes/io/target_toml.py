"""Test targets from a small TOML file, in the world or as seen from the car at the beginning of its drive.

Keys are those of docs/scenes.md. In the frame "start" positions are forward, right, up and headings clockwise
from straight ahead, as everywhere in the car's frame (docs/conventions.md).
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
    """A target placed as seen from the car when its drive begins.

    The target's position_m is forward, right, up [m] from the ground below the car's middle, its heading_rad
    clockwise from straight ahead.
    """

    target: Target

    def placed(self, start: NDArray[np.float64]) -> Target:
        """Return the target in the world, `start` (4,) being x, y, z [m] and yaw [rad] of the car."""
        x, y, z, yaw = (float(value) for value in start)
        forward, right, up = self.target.position_m
        cos, sin = math.cos(yaw), math.sin(yaw)
        position = (x + cos * forward + sin * right, y + sin * forward - cos * right, z + up)
        return replace(self.target, position_m=position, heading_rad=yaw - self.target.heading_rad)


AnyTarget = Target | FromStart
"""A target in the world, or as seen from the drive's start."""


def placed_targets(targets: Sequence[AnyTarget], *, start: NDArray[np.float64]) -> tuple[Target, ...]:
    """Return `targets` in the world; `start` (4,) is the car's x, y, z [m] and yaw [rad] at 0 s."""
    return tuple(target.placed(start) if isinstance(target, FromStart) else target for target in targets)


def read_targets(path: str | Path) -> tuple[AnyTarget, ...]:
    """Read the targets of a TOML file.

    Raises:
        SceneError: it cannot be read, has no target, or one of them is none; the message names the file, the
            number of the target and the key.
    """
    table = read_toml(Path(path))
    targets = targets_of(table)
    table.finish()
    if not targets:
        raise table.fault("no target in it; each is a table [[target]]")
    return targets


def targets_of(table: Table) -> tuple[AnyTarget, ...]:
    """Return what the `[[target]]` entries of a table describe; for errors see `read_targets`."""
    return tuple(_target(entry) for entry in table.tables("target"))


def _target(entry: Table) -> AnyTarget:
    """Return the target that one `[[target]]` describes."""
    kind = entry.text("kind", allowed=tuple(KINDS))
    frame = entry.text("frame", "world", allowed=FRAMES)
    position = entry.numbers("position_m", _POSITION[frame])
    heading = math.radians(entry.number("heading_deg", 0.0))
    elevation = math.radians(entry.number("elevation_deg", 0.0)) if KINDS[kind].flat else 0.0
    sizes = KINDS[kind].sizes
    size = entry.numbers("size_m", sizes) if sizes else ()
    material = entry.text("material", "metal", allowed=MATERIAL_NAMES) if kind != "point" else "metal"
    rcs_dbsm = entry.number("rcs_dbsm", 0.0) if kind == "point" else 0.0
    if abs(rcs_dbsm) > _MOST_DBSM:
        raise entry.fault(f"rcs_dbsm must be within -{_MOST_DBSM:g} and {_MOST_DBSM:g}, got {rcs_dbsm:g}")
    entry.finish()
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
        raise entry.fault(str(error)) from error
    return FromStart(target=target) if frame == "start" else target
