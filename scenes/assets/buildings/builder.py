"""A building in the making: the plot, the frames of its walls, the quads gathered so far by material."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.assets.buildings import roof as roofs
from echoscape.scenes.assets.buildings.facade import Frame, Quads
from echoscape.scenes.core.scene import Mesh
from echoscape.scenes.geometry.primitives import quads


@dataclass(kw_only=True)
class Site:
    """A building in the making: its plot, and the quads of each material gathered so far."""

    outline: NDArray[np.float64]
    open_edges: list[bool]
    height_m: float
    rng: np.random.Generator
    made: dict[str, list[Quads]] = field(default_factory=dict)

    @cached_property
    def frames(self) -> list[Frame]:
        """Return the frame of every edge."""
        step = np.roll(self.outline, -1, axis=0) - self.outline
        length = np.hypot(step[:, 0], step[:, 1])
        return [
            Frame(origin=origin, along=vector / size, length_m=float(size))
            for origin, vector, size in zip(self.outline, step, length, strict=True)
        ]

    def add(self, material: str, world: Quads) -> None:
        """Add quads (N, 4, 3) in world axes."""
        self.made.setdefault(material, []).append(world)

    def meshes(self) -> dict[str, Mesh]:
        """Return what was gathered, one mesh a material."""
        return {name: quads(np.concatenate(parts)) for name, parts in sorted(self.made.items())}

    @property
    def front(self) -> int:
        """The longest edge with windows (or the longest of all)."""
        lengths = [frame.length_m for frame in self.frames]
        score = [size + 1000.0 * is_open for size, is_open in zip(lengths, self.open_edges, strict=True)]
        return int(np.argmax(score))


def columns(
    length_m: float, *, pitch_m: float, width_m: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return left and right ends (C,) of evenly spread openings; none on a wall too short for one."""
    count = int((length_m - 0.5) / pitch_m)
    if count == 0 and length_m > width_m + 0.8:
        count = 1
    middle = (np.arange(count) + 0.5) * length_m / max(count, 1)
    return middle - 0.5 * width_m, middle + 0.5 * width_m


def flat_top(site: Site, wall: str, *, parapet_m: float) -> None:
    """Add a flat roof, and the walls' upper ends as parapet."""
    deck, coping = roofs.flat_roof(site.outline, height_m=site.height_m, parapet_m=parapet_m)
    low, high = (
        roofs.raised(site.outline, site.height_m),
        roofs.raised(site.outline, site.height_m + parapet_m),
    )
    site.add("concrete", deck)
    site.add(wall, roofs.skirt(low, high))
    site.add("metal", coping)
