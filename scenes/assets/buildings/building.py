"""Buildings over a footprint: walls with recessed windows, doors, bays, shopfronts, balconies and a roof.

What radar sees of a facade is its corners: reveals, sills, ribs, gutters and pipes make the echoes that a
flat wall does not. Each style has its module; facade pieces come from `scenes.assets.buildings.facade`, roofs from
`scenes.assets.buildings.roof`.
"""

from collections.abc import Callable, Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from echoscape.scenes.assets.buildings import roof as roofs
from echoscape.scenes.assets.buildings.apartments import block, tower
from echoscape.scenes.assets.buildings.builder import Site
from echoscape.scenes.assets.buildings.houses import house, terrace
from echoscape.scenes.assets.buildings.warehouses import hall
from echoscape.scenes.core.scene import Mesh

Style = Literal["terrace", "house", "block", "hall", "tower"]
STYLES: tuple[Style, ...] = ("terrace", "house", "block", "hall", "tower")
MAX_OVERHANG_M = 1.6
"""Nothing stands out farther from the footprint."""


def building(
    footprint: ArrayLike,
    *,
    height_m: float,
    style: Style,
    rng: np.random.Generator,
    facades: Sequence[bool] | None = None,
) -> dict[str, Mesh]:
    """Return a building, material by material, in world axes on z = 0.

    `footprint` (N, 2) [m] is counter-clockwise, convex or mildly concave. `height_m` is where walls end: the
    eaves of a pitched roof, the deck of a flat one; see `top_limit_m` for what rises above. `facades` (N,)
    says which edges (from corner i to corner i + 1) have windows; the others are plain party walls.
    """
    outline = np.asarray(footprint, dtype=np.float64)
    if outline.ndim != 2 or outline.shape[0] < 3 or outline.shape[1] != 2 or roofs.signed_area(outline) <= 0:
        raise ValueError(f"footprint must be (N >= 3, 2) and counter-clockwise, got shape {outline.shape}")
    if style not in STYLES:
        raise ValueError(f"style must be one of {STYLES}, got {style!r}")
    if not height_m >= 2.0:
        raise ValueError(f"height_m must be at least 2, got {height_m}")
    open_edges = [True] * len(outline) if facades is None else [bool(edge) for edge in facades]
    if len(open_edges) != len(outline):
        raise ValueError(f"facades must have {len(outline)} entries, got {len(open_edges)}")
    site = Site(outline=outline, open_edges=open_edges, height_m=height_m, rng=rng)
    _BUILDERS[style](site)
    return site.meshes()


def top_limit_m(footprint: ArrayLike, height_m: float) -> float:
    """Return a height [m] that no part of a building over `footprint` reaches beyond."""
    points = np.asarray(footprint, dtype=np.float64)
    return height_m + max(4.0, 0.6 * float(np.ptp(points, axis=0).max())) + 1.5


_BUILDERS: dict[Style, Callable[[Site], None]] = {
    "terrace": terrace,
    "house": house,
    "block": block,
    "hall": hall,
    "tower": tower,
}
