"""Buildings over a footprint: walls with recessed windows, doors, bays, shopfronts, balconies and a roof.

What radar sees of a facade is its corners: reveals, sills, ribs, gutters and pipes make the echoes that a
flat wall does not. Facade pieces come from `scenes.facades`, roofs from `scenes.roofs`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from echoscape.scenes import facades as fc
from echoscape.scenes import roofs
from echoscape.scenes.facades import Frame, Grid, Quads, grid
from echoscape.scenes.solids import quads
from echoscape.scenes.world import Mesh

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


@dataclass(kw_only=True)
class Site:
    """A building in the making: its plot, and the quads of each material gathered so far."""

    outline: NDArray[np.float64]
    open_edges: list[bool]
    height_m: float
    rng: np.random.Generator
    made: dict[str, list[Quads]] = field(default_factory=dict)

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
        lengths = [frame.length_m for frame in self.frames()]
        score = [size + 1000.0 * is_open for size, is_open in zip(lengths, self.open_edges, strict=True)]
        return int(np.argmax(score))


def _columns(
    length_m: float, *, pitch_m: float, width_m: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return left and right ends (C,) of evenly spread openings; none on a wall too short for one."""
    count = int((length_m - 0.5) / pitch_m)
    if count == 0 and length_m > width_m + 0.8:
        count = 1
    middle = (np.arange(count) + 0.5) * length_m / max(count, 1)
    return middle - 0.5 * width_m, middle + 0.5 * width_m


# Houses


@dataclass(frozen=True, kw_only=True)
class _HouseLook:
    wall: str
    roof: str
    storey_m: float
    storeys: int
    width_m: float
    pitch_m: float
    depth_m: float
    shop: bool
    bay: bool


def _house_look(site: Site, *, shops: float, bays: float) -> _HouseLook:
    rng = site.rng
    storeys = max(1, round(site.height_m / 2.85))
    return _HouseLook(
        wall=str(rng.choice(["brick", "brick", "concrete"])),
        roof=str(rng.choice(["brick", "concrete"])),
        storey_m=site.height_m / storeys,
        storeys=storeys,
        width_m=rng.uniform(0.95, 1.4),
        pitch_m=rng.uniform(2.1, 2.9),
        depth_m=rng.uniform(0.1, 0.22),
        shop=bool(rng.random() < shops),
        bay=bool(rng.random() < bays),
    )


def _terrace(site: Site) -> None:
    _dwelling(site, _house_look(site, shops=0.2, bays=0.45), hip=False)


def _house(site: Site) -> None:
    _dwelling(site, _house_look(site, shops=0.0, bays=0.35), hip=bool(site.rng.random() < 0.4))


def _dwelling(site: Site, look: _HouseLook, *, hip: bool) -> None:
    front = site.front
    for edge, (frame, is_open) in enumerate(zip(site.frames(), site.open_edges, strict=True)):
        if is_open and frame.length_m > 2.0:
            _house_facade(site, frame, look, is_front=edge == front)
        else:
            site.add(look.wall, frame.to_world(fc.panels(0.0, frame.length_m, 0.0, site.height_m)))
    _house_roof(site, look, hip=hip)


def _house_facade(site: Site, frame: Frame, look: _HouseLook, *, is_front: bool) -> None:
    """Add a wall with its windows, and on the front a door and perhaps a bay or a shop window."""
    length, storey = frame.length_m, look.storey_m
    left, right = _columns(length, pitch_m=look.pitch_m, width_m=min(look.width_m, 0.6 * length))
    floor = storey * np.arange(look.storeys)
    low, high = floor + 0.32 * storey, floor + 0.8 * storey
    upper = grid(low=low[1:], high=high[1:], left=left, right=right, depth_m=look.depth_m)
    ground = grid(low=low[:1], high=high[:1], left=left, right=right, depth_m=look.depth_m)
    windows, grids = [upper, ground], [upper, ground]
    if is_front and look.shop:
        shop = _shopfront(site, frame, storey)
        windows, grids = [upper], [upper, shop]
    elif is_front and len(left):
        door, ground = _door_and_windows(ground, look)
        windows, grids = [upper], [upper, door]
        site.add("wood", frame.to_world(_door_leaf(door)))
        site.add("glass", frame.to_world(fc.panes(ground)))
        site.add("paving", frame.to_world(fc.boxes(door.left[0] - 0.2, door.right[0] + 0.2, 0.0, 0.14, 0.4)))
        if ground.left.size:
            site.add("paving", frame.to_world(fc.sills(ground)))
            if look.bay:
                _bay(site, frame, look, float(ground.left[-1]), float(ground.right[-1]))
    site.add(look.wall, frame.to_world(fc.pierced_wall(length, site.height_m, grids)))
    for openings in windows:
        if openings.bottom.size:
            site.add("glass", frame.to_world(fc.panes(openings)))
            site.add("paving", frame.to_world(fc.sills(openings)))
            site.add("wood", frame.to_world(fc.mullions(openings)))
    site.add("metal", frame.to_world(fc.downpipe(0.18, site.height_m)))


def _door_and_windows(ground: Grid, look: _HouseLook) -> tuple[Grid, Grid]:
    """Return the ground floor's row with its first column made a door, and the windows beside the door."""
    middle = 0.5 * (ground.left[0] + ground.right[0])
    left, right = ground.left.copy(), ground.right.copy()
    left[0], right[0] = middle - 0.47, middle + 0.47
    bottom = np.full((1, len(left)), ground.low[0])
    bottom[0, 0] = 0.14
    row = grid(low=[0.14], high=ground.high, left=left, right=right, depth_m=look.depth_m, bottom=bottom)
    rest = grid(low=ground.low, high=ground.high, left=left[1:], right=right[1:], depth_m=look.depth_m)
    return row, rest


def _door_leaf(row: Grid) -> Quads:
    """Return a panelled door in the first column of `row`."""
    s0, s1, z0, z1, back = row.left[0], row.right[0], row.bottom[0, 0], row.high[0], -row.depth_m
    fields = fc.boxes(
        [s0 + 0.12] * 2, [s1 - 0.12] * 2, [z0 + 0.15, z0 + 1.05], [z0 + 0.9, z1 - 0.15], back + 0.03, back
    )
    return np.concatenate([fc.panels(s0, s1, z0, z1, back), fields])


def _shopfront(site: Site, frame: Frame, storey_m: float) -> Grid:
    """Add panes over a stall riser, a door in their middle, a fascia and an awning; return their openings."""
    length = frame.length_m
    count = max(1, round(length / 2.6))
    edges = np.linspace(0.25, length - 0.25, count + 1)
    left, right = edges[:-1] + 0.06, edges[1:] - 0.06
    bottom = np.full((1, count), 0.5)
    bottom[0, count // 2] = 0.05
    row = grid(low=[0.05], high=[0.8 * storey_m], left=left, right=right, depth_m=0.15, bottom=bottom)
    site.add("glass", frame.to_world(fc.panes(row)))
    site.add("metal", frame.to_world(fc.mullions(row)))
    site.add("wood", frame.to_world(fc.boxes(0.15, length - 0.15, 0.82 * storey_m, 0.99 * storey_m, 0.14)))
    if site.rng.random() < 0.5:
        z = 0.82 * storey_m
        awning = np.array(
            [[[0.3, z - 0.5, 1.2], [length - 0.3, z - 0.5, 1.2], [length - 0.3, z, 0.05], [0.3, z, 0.05]]]
        )
        site.add("wood", frame.to_world(np.concatenate([awning, awning[:, ::-1] - [0, 0.02, 0]])))
    return row


def _bay(site: Site, frame: Frame, look: _HouseLook, left: float, right: float) -> None:
    """Add a canted bay before a ground-floor window: aprons, three panes, heads and a lead roof."""
    s0, s1 = max(0.05, left - 0.35), min(frame.length_m - 0.05, right + 0.35)
    plan = np.array([[s0, 0.0], [s0 + 0.4, 0.65], [s1 - 0.4, 0.65], [s1, 0.0]])
    sill, head, top = 0.75, 0.78 * look.storey_m, 0.9 * look.storey_m
    a, b = plan[:-1], plan[1:]

    def ring(shrink: float, low: float, high: float) -> Quads:
        inner_a, inner_b = a + shrink * (b - a), b - shrink * (b - a)
        z0, z1 = np.full(3, low), np.full(3, high)
        corners = [(inner_a, z0), (inner_b, z0), (inner_b, z1), (inner_a, z1)]
        return np.stack([np.stack([p[:, 0], z, p[:, 1]], axis=1) for p, z in corners], axis=1)

    lid = np.array([[s, top, d] for s, d in plan[[0, 1, 2, 3]]])
    crown = np.array(
        [[s0, top + 0.35, 0.0], [s0 + 0.4, top, 0.65], [s1 - 0.4, top, 0.65], [s1, top + 0.35, 0.0]]
    )
    sides = np.array([[lid[0], crown[1], crown[0], lid[0]], [crown[2], lid[3], crown[3], crown[2]]])
    site.add(look.wall, frame.to_world(np.concatenate([ring(0.0, 0.0, sill), ring(0.0, head, top)])))
    site.add("glass", frame.to_world(ring(0.06, sill, head)))
    site.add("metal", frame.to_world(np.concatenate([crown[[[1, 2, 3, 0]]], sides])))


def _house_roof(site: Site, look: _HouseLook, *, hip: bool) -> None:
    """Add a pitched roof over a quadrilateral, or a mansard over any other outline, with gutters and chimney."""
    if len(site.outline) != 4:
        _mansard(site, look)
        return
    lengths = [frame.length_m for frame in site.frames()]
    plain = [not is_open for is_open in site.open_edges]
    turned = lengths[0] + lengths[2] < lengths[1] + lengths[3]
    if plain[0] + plain[2] != plain[1] + plain[3]:
        turned = plain[0] + plain[2] > plain[1] + plain[3]
    order = np.roll(np.arange(4), -1 if turned else 0)
    is_open = np.array(site.open_edges)[order]
    overhang = np.where(is_open, [0.32, 0.2, 0.32, 0.2], 0.0) if not hip else np.full(4, 0.32) * is_open
    slope = site.rng.uniform(0.65, 0.95)
    surfaces, gables, ridge = roofs.pitched_roof(
        site.outline[order], overhang, height_m=site.height_m, slope=slope, hip=hip
    )
    site.add(look.roof, surfaces)
    if len(gables):
        site.add(look.wall, gables)
    for edge in order[[0, 2]]:
        if site.open_edges[edge]:
            _gutter(site, site.frames()[edge], z_m=site.height_m - 0.32 * slope - 0.05, out_m=0.32)
    if site.rng.random() < 0.75:
        _chimney(site, ridge)


def _gutter(site: Site, frame: Frame, *, z_m: float, out_m: float) -> None:
    site.add("metal", frame.to_world(fc.boxes(0.0, frame.length_m, z_m - 0.11, z_m, out_m + 0.11, out_m)))


def _chimney(site: Site, ridge: NDArray[np.float64]) -> None:
    """Add a stack near one end of the ridge, with a cap and two pots."""
    along = ridge[1, :2] - ridge[0, :2]
    size = float(np.linalg.norm(along))
    if size < 1.5:
        return
    middle = ridge[0, :2] + along * (0.55 / size)
    yaw, top = float(np.arctan2(along[1], along[0])), float(ridge[0, 2])
    across = np.array([-along[1], along[0]]) / size
    cap = roofs.upright_box(middle, (0.7, 1.15), bottom_m=top + 0.85, top_m=top + 0.95, yaw_rad=yaw)
    pots = [
        roofs.upright_box(
            middle + shift * across, (0.24, 0.24), bottom_m=top + 0.95, top_m=top + 1.3, yaw_rad=yaw
        )
        for shift in (-0.28, 0.28)
    ]
    stack = roofs.upright_box(middle, (0.6, 1.05), bottom_m=top - 1.0, top_m=top + 0.85, yaw_rad=yaw)
    site.add("brick", np.concatenate([stack, cap, *pots]))


def _mansard(site: Site, look: _HouseLook) -> None:
    inset = 1.4
    inner = roofs.grown(site.outline, -inset)
    if roofs.signed_area(inner) < 0.1 * roofs.signed_area(site.outline):
        _flat(site, look.wall, parapet_m=0.4)
        return
    site.add(look.roof, roofs.mansard_roof(site.outline, height_m=site.height_m, inset_m=inset, rise_m=1.2))


def _flat(site: Site, wall: str, *, parapet_m: float) -> None:
    """Add a flat roof, and the walls' upper ends as parapet."""
    deck, coping = roofs.flat_roof(site.outline, height_m=site.height_m, parapet_m=parapet_m)
    low, high = (
        roofs.raised(site.outline, site.height_m),
        roofs.raised(site.outline, site.height_m + parapet_m),
    )
    site.add("concrete", deck)
    site.add(wall, roofs.skirt(low, high))
    site.add("metal", coping)


# Blocks and towers


@dataclass(frozen=True, kw_only=True)
class _BlockLook:
    wall: str
    storey_m: float
    storeys: int
    width_m: float
    pitch_m: float
    depth_m: float
    parapet_m: float
    balcony: bool
    solid: bool
    shops: bool


def _block_look(site: Site, *, width_m: tuple[float, float], gap_m: float, balconies: float) -> _BlockLook:
    rng = site.rng
    storeys = max(2, round(site.height_m / 3.0))
    perimeter = sum(frame.length_m for frame in site.frames())
    width = rng.uniform(*width_m)
    return _BlockLook(
        wall=str(rng.choice(["brick", "concrete", "concrete"])),
        storey_m=site.height_m / storeys,
        storeys=storeys,
        width_m=width,
        pitch_m=max(width + gap_m, perimeter * storeys / 95.0),
        depth_m=rng.uniform(0.12, 0.25),
        parapet_m=rng.uniform(0.4, 1.0),
        balcony=bool(rng.random() < balconies),
        solid=bool(rng.random() < 0.4),
        shops=bool(rng.random() < 0.35),
    )


def _block(site: Site) -> None:
    _storeyed(site, _block_look(site, width_m=(1.4, 2.1), gap_m=1.2, balconies=0.7))


def _tower(site: Site) -> None:
    _storeyed(site, _block_look(site, width_m=(2.2, 3.2), gap_m=0.8, balconies=0.3))


def _storeyed(site: Site, look: _BlockLook) -> None:
    front = site.front
    for edge, (frame, is_open) in enumerate(zip(site.frames(), site.open_edges, strict=True)):
        if is_open and frame.length_m > 2.5:
            _block_facade(site, frame, look, is_front=edge == front)
        else:
            site.add(look.wall, frame.to_world(fc.panels(0.0, frame.length_m, 0.0, site.height_m)))
    _flat(site, look.wall, parapet_m=look.parapet_m)
    _plant(site)


def _block_facade(site: Site, frame: Frame, look: _BlockLook, *, is_front: bool) -> None:
    """Add a wall of equal storeys: windows in columns, string courses, balconies, a ground floor of its own."""
    length, storey = frame.length_m, look.storey_m
    width = min(look.width_m, 0.7 * length)
    left, right = _columns(length, pitch_m=max(look.pitch_m, width + 0.4), width_m=width)
    floor = storey * np.arange(1, look.storeys)
    bottom = np.repeat(floor[:, None] + 0.3 * storey, len(left), axis=1)
    with_balcony = np.arange(len(left)) % 3 == 1
    if look.balcony and is_front and with_balcony.any():
        bottom[:, with_balcony] = floor[:, None] + 0.06
        _add_balconies(site, frame, look, left[with_balcony], right[with_balcony], floor)
    upper = grid(
        low=floor + 0.06,
        high=floor + 0.82 * storey,
        left=left,
        right=right,
        depth_m=look.depth_m,
        bottom=bottom,
    )
    windows = grid(
        low=floor + 0.3 * storey, high=floor + 0.82 * storey, left=left, right=right, depth_m=look.depth_m
    )
    if not (look.balcony and is_front):
        upper = windows
    grids = [upper]
    if is_front:
        grids.append(_entrance(site, frame, look, left, right))
    else:
        plain = grid(low=0.35 * storey, high=0.82 * storey, left=left, right=right, depth_m=look.depth_m)
        grids.append(plain)
        site.add("glass", frame.to_world(fc.panes(plain)))
    site.add(look.wall, frame.to_world(fc.pierced_wall(length, site.height_m, grids)))
    site.add("glass", frame.to_world(fc.panes(upper)))
    site.add("metal", frame.to_world(fc.mullions(upper)))
    courses = np.r_[floor, site.height_m - 0.12] if is_front else np.array([site.height_m - 0.12])
    site.add("concrete", frame.to_world(fc.boxes(0.0, length, courses - 0.1, courses + 0.08, 0.08)))
    if is_front:
        site.add("concrete", frame.to_world(fc.sills(windows)[_is_sill(windows, with_balcony, look)]))
    site.add("metal", frame.to_world(fc.downpipe([0.25, length - 0.25], site.height_m, radius_m=0.06)))


def _is_sill(windows: Grid, with_balcony: NDArray[np.bool_], look: _BlockLook) -> NDArray[np.bool_]:
    """Return which of the five quads of every sill to keep: none under balcony doors."""
    keep = np.broadcast_to(~(with_balcony & look.balcony), windows.bottom.shape).ravel()
    return np.repeat(keep, 5)


def _add_balconies(
    site: Site,
    frame: Frame,
    look: _BlockLook,
    left: NDArray[np.float64],
    right: NDArray[np.float64],
    floor: NDArray[np.float64],
) -> None:
    s0, z = np.meshgrid(np.maximum(left - 0.35, 0.05), floor)
    s1, _ = np.meshgrid(np.minimum(right + 0.35, frame.length_m - 0.05), floor)
    slab, rails = fc.balconies(s0.ravel(), s1.ravel(), z.ravel(), out_m=1.3, solid=look.solid)
    site.add("concrete", frame.to_world(slab))
    if len(rails):
        site.add("metal", frame.to_world(rails))


def _entrance(
    site: Site, frame: Frame, look: _BlockLook, left: NDArray[np.float64], right: NDArray[np.float64]
) -> Grid:
    """Add the ground floor's panes with a door in the middle and a canopy over it; return its openings."""
    storey, count = look.storey_m, len(left)
    if look.shops and count:
        gap = 0.3
        edges = np.linspace(0.2, frame.length_m - 0.2, count + 1)
        left, right = edges[:-1] + gap / 2, edges[1:] - gap / 2
    bottom = np.full((1, count), 0.45 if look.shops else 0.35 * storey)
    if count:
        bottom[0, count // 2] = 0.05
        s0, s1 = float(left[count // 2]) - 0.3, float(right[count // 2]) + 0.3
        site.add("metal", frame.to_world(fc.boxes(s0, s1, 0.86 * storey, 0.92 * storey, 1.2)))
        site.add("paving", frame.to_world(fc.boxes(s0, s1, 0.0, 0.05, 1.0)))
    row = grid(low=[0.05], high=[0.82 * storey], left=left, right=right, depth_m=look.depth_m, bottom=bottom)
    site.add("glass", frame.to_world(fc.panes(row)))
    site.add("metal", frame.to_world(fc.mullions(row)))
    return row


def _plant(site: Site) -> None:
    """Add a stair head and two ventilation units on a flat roof."""
    middle = site.outline.mean(axis=0)
    step = site.outline[1] - site.outline[0]
    yaw, base = float(np.arctan2(step[1], step[0])), site.height_m
    reach = 0.18 * float(np.linalg.norm(step))
    along = step / np.linalg.norm(step)
    site.add("concrete", roofs.upright_box(middle, (3.0, 2.4), bottom_m=base, top_m=base + 2.6, yaw_rad=yaw))
    units = [
        roofs.upright_box(
            middle + shift * reach * along, (1.6, 1.1), bottom_m=base + 0.2, top_m=base + 1.5, yaw_rad=yaw
        )
        for shift in (-1.0, 1.0)
    ]
    site.add("metal", np.concatenate(units))


# Halls


def _hall(site: Site) -> None:
    """Add an industrial hall: profiled sheet on a concrete plinth, roller doors on the front, a shallow roof."""
    pitch, depth = site.rng.uniform(0.7, 1.0), site.rng.uniform(0.04, 0.1)
    front = site.front
    for edge, (frame, is_open) in enumerate(zip(site.frames(), site.open_edges, strict=True)):
        doors = _hall_doors(site, frame) if edge == front and is_open else np.zeros((0, 2))
        _clad(site, frame, doors, pitch_m=pitch if is_open else 1.0, depth_m=depth)
        site.add(
            "metal", frame.to_world(fc.boxes(0.0, frame.length_m, site.height_m - 0.15, site.height_m, 0.16))
        )
        count = max(2, round(frame.length_m / 12.0) + 1)
        places = np.linspace(0.3, frame.length_m - 0.3, count)
        clear = [not any(a - 0.2 < s < b + 0.2 for a, b in doors) for s in places]
        if any(clear):
            site.add(
                "metal",
                frame.to_world(fc.downpipe(places[clear], site.height_m, radius_m=0.08) + [0, 0, depth]),
            )
    if len(site.outline) == 4:
        order = np.roll(np.arange(4), -int(site.frames()[0].length_m < site.frames()[1].length_m))
        surfaces, gables, _ = roofs.pitched_roof(
            site.outline[order], np.full(4, 0.1), height_m=site.height_m, slope=0.12, hip=False
        )
        site.add("metal", np.concatenate([surfaces, gables]))
    else:
        _flat(site, "metal", parapet_m=0.4)


def _hall_doors(site: Site, frame: Frame) -> NDArray[np.float64]:
    """Return (D, 2) left and right ends of roller doors, and add the doors, a dock and a canopy."""
    width, top = 4.0, min(4.4, 0.75 * site.height_m)
    count = int(min(4, frame.length_m // 8.0))
    middle = (np.arange(count) + 0.5) * frame.length_m / max(count, 1)
    doors = np.stack([middle - 0.5 * width, middle + 0.5 * width], axis=1)
    for number, (left, right) in enumerate(doors.tolist()):
        is_dock = number >= count - 2 and count > 2
        low = 1.1 if is_dock else 0.0
        opening = grid(low=[low], high=[top], left=[left], right=[right], depth_m=0.25)
        reveal = fc.pierced_wall(frame.length_m, top, [opening])[4:]  # only the reveals: the sheet goes round
        site.add("metal", frame.to_world(np.concatenate([reveal, fc.slats(left, right, low, top, -0.25)])))
        if is_dock:
            site.add("concrete", frame.to_world(fc.boxes(left - 0.6, right + 0.6, 0.0, 1.1, 1.5)))
            site.add(
                "rubber",
                frame.to_world(fc.boxes([left, right - 0.3], [left + 0.3, right], 0.7, 1.05, 1.6, 1.5)),
            )
        site.add("metal", frame.to_world(fc.boxes(left - 0.4, right + 0.4, top + 0.25, top + 0.4, 1.4)))
    return doors


def _clad(site: Site, frame: Frame, doors: NDArray[np.float64], *, pitch_m: float, depth_m: float) -> None:
    """Add plinth and ribbed sheet, split at the doors, which the sheet runs over."""
    plinth, top = 0.5, min(4.4, 0.75 * site.height_m)
    edges = np.r_[0.0, doors.ravel(), frame.length_m]
    sheet = []
    for left, right in edges.reshape(-1, 2):
        sheet.append(fc.ribs(left, right, plinth, site.height_m, pitch_m=pitch_m, depth_m=depth_m))
        site.add("concrete", frame.to_world(fc.boxes(left, right, 0.0, plinth, depth_m + 0.03)))
    for left, right in doors:
        sheet.append(fc.ribs(left, right, top, site.height_m, pitch_m=pitch_m, depth_m=depth_m))
    site.add("metal", frame.to_world(np.concatenate(sheet)))


_BUILDERS = {"terrace": _terrace, "house": _house, "block": _block, "hall": _hall, "tower": _tower}
