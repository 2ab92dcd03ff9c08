"""Collects the parts of a building by material, and holds its footprint and the frames of its walls."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.assets.buildings import roof
from echoscape.scenes.assets.buildings.facade import Frame, Quads
from echoscape.scenes.core.scene import Mesh
from echoscape.scenes.geometry.meshes import quads


@dataclass(kw_only=True)
class BuildingBuilder:
    """A building under construction.

    Attributes:
        outline: Counter-clockwise footprint (N, 2) [m].
        open_edges: Whether each edge has windows; the others are party walls.
        height_m: Height of the walls [m].
        rng: Random generator.
        roof_shape: "flat", "gabled", "hipped" or "mansard" where the roof of a house is given; "" draws it.
        roof_rise_m: Height of a pitched roof above the walls [m]; None draws it.
        made: Quads of each material so far.
    """

    outline: NDArray[np.float64]
    open_edges: list[bool]
    height_m: float
    rng: np.random.Generator
    roof_shape: str = ""
    roof_rise_m: float | None = None
    made: dict[str, list[Quads]] = field(default_factory=dict)

    @cached_property
    def frames(self) -> list[Frame]:
        """Frame of the wall on each edge."""
        step = np.roll(self.outline, -1, axis=0) - self.outline
        length = np.hypot(step[:, 0], step[:, 1])
        return [
            Frame(origin=origin, along=vector / size, length_m=float(size))
            for origin, vector, size in zip(self.outline, step, length, strict=True)
        ]

    def add(self, material: str, world: Quads) -> None:
        """Add quads.

        Args:
            material: Name of their material.
            world: Quads in the world (N, 4, 3) [m].
        """
        self.made.setdefault(material, []).append(world)

    def meshes(self) -> dict[str, Mesh]:
        """Return the quads added so far as meshes.

        Returns:
            One mesh per material.
        """
        return {name: quads(np.concatenate(parts)) for name, parts in sorted(self.made.items())}

    @property
    def front(self) -> int:
        """Index of the longest edge with windows, or of the longest edge if none has windows."""
        lengths = [frame.length_m for frame in self.frames]
        score = [size + 1000.0 * is_open for size, is_open in zip(lengths, self.open_edges, strict=True)]
        return int(np.argmax(score))


def columns(
    length_m: float, *, pitch_m: float, width_m: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Space openings evenly along a wall.

    Args:
        length_m: Length of the wall [m].
        pitch_m: Least distance between centres [m].
        width_m: Width of an opening [m].

    Returns:
        Left and right edges, each (C,) [m]; none on a wall too short for one opening.
    """
    count = int((length_m - 0.5) / pitch_m)
    if count == 0 and length_m > width_m + 0.8:
        count = 1
    middle = (np.arange(count) + 0.5) * length_m / max(count, 1)
    return middle - 0.5 * width_m, middle + 0.5 * width_m


def flat_top(builder: BuildingBuilder, wall: str, *, parapet_m: float) -> None:
    """Add a flat roof whose parapet continues the walls.

    Args:
        builder: The building.
        wall: Name of the material of the walls.
        parapet_m: Height of the parapet above the deck [m].
    """
    deck, coping = roof.flat_roof(builder.outline, height_m=builder.height_m, parapet_m=parapet_m)
    low, high = (
        roof.raised(builder.outline, builder.height_m),
        roof.raised(builder.outline, builder.height_m + parapet_m),
    )
    builder.add("concrete", deck)
    builder.add(wall, roof.skirt(low, high))
    builder.add("metal", coping)
