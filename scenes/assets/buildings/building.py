"""Buildings over a footprint: walls with recessed windows, doors, bays, shopfronts, balconies and a roof.

The radar sees mainly the corners of a facade: reveals, sills, ribs, gutters and pipes return echoes that a
flat wall does not. Each style has its module; the parts come from `facade` and `roof` in this package.
"""

from collections.abc import Callable, Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from echoscape.scenes.assets.buildings import roof
from echoscape.scenes.assets.buildings.apartments import block, tower
from echoscape.scenes.assets.buildings.builder import BuildingBuilder
from echoscape.scenes.assets.buildings.houses import house, terrace
from echoscape.scenes.assets.buildings.warehouses import hall
from echoscape.scenes.core.scene import Mesh

Style = Literal["terrace", "house", "block", "hall", "tower"]
ROOF_SHAPES = ("flat", "gabled", "hipped", "mansard")
STYLES: tuple[Style, ...] = ("terrace", "house", "block", "hall", "tower")


def building(
    footprint: ArrayLike,
    *,
    height_m: float,
    style: Style,
    rng: np.random.Generator,
    facades: Sequence[bool] | None = None,
    roof_shape: str = "",
    roof_rise_m: float | None = None,
) -> dict[str, Mesh]:
    """Make a building on z = 0.

    Args:
        footprint: Counter-clockwise polygon (N, 2) [m], convex or mildly concave.
        height_m: Height of the walls [m]: the eaves of a pitched roof or the deck of a flat one.
        style: Style of the building.
        rng: Random generator.
        facades: Whether each edge, from corner i to corner i + 1, has windows (N,); the others are plain
            party walls. None for windows on all edges.
        roof_shape: Roof of a house or terrace, one of `ROOF_SHAPES`; "" draws it. Others have their own.
        roof_rise_m: Height of the ridge of a house or terrace above its walls [m]; None draws it.

    Returns:
        Meshes in the world by name of the material.

    Raises:
        ValueError: An argument is not allowed; the message names it.
    """
    outline = np.asarray(footprint, dtype=np.float64)
    if outline.ndim != 2 or outline.shape[0] < 3 or outline.shape[1] != 2 or roof.signed_area(outline) <= 0:
        raise ValueError(f"footprint must be (N >= 3, 2) and counter-clockwise, got shape {outline.shape}")
    if style not in STYLES:
        raise ValueError(f"style must be one of {STYLES}, got {style!r}")
    if roof_shape and roof_shape not in ROOF_SHAPES:
        raise ValueError(f"roof_shape must be one of {ROOF_SHAPES}, got {roof_shape!r}")
    if roof_rise_m is not None and not roof_rise_m > 0:
        raise ValueError(f"roof_rise_m must be above 0, got {roof_rise_m}")
    if not height_m >= 2.0:
        raise ValueError(f"height_m must be at least 2, got {height_m}")
    open_edges = [True] * len(outline) if facades is None else [bool(edge) for edge in facades]
    if len(open_edges) != len(outline):
        raise ValueError(f"facades must have {len(outline)} entries, got {len(open_edges)}")
    builder = BuildingBuilder(
        outline=outline,
        open_edges=open_edges,
        height_m=height_m,
        rng=rng,
        roof_shape=roof_shape,
        roof_rise_m=roof_rise_m,
    )
    _BUILDERS[style](builder)
    return builder.meshes()


_BUILDERS: dict[Style, Callable[[BuildingBuilder], None]] = {
    "terrace": terrace,
    "house": house,
    "block": block,
    "hall": hall,
    "tower": tower,
}
