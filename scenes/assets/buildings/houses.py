"""Terraced and detached houses: windows, doors, bays, shopfronts, pitched roofs, gutters, chimneys."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.assets.buildings import facade, roof
from echoscape.scenes.assets.buildings.builder import BuildingBuilder, columns, flat_top
from echoscape.scenes.assets.buildings.facade import Frame, Grid, Quads, grid
from echoscape.scenes.core import portable_math

_HEADROOM_M = 2.15


@dataclass(frozen=True, kw_only=True)
class _HouseLook:
    """Dimensions and materials of a house."""

    wall: str
    roof: str
    storey_m: float
    storeys: int
    width_m: float
    pitch_m: float
    depth_m: float
    shop: bool
    bay: bool


def _house_look(builder: BuildingBuilder, *, shops: float, bays: float) -> _HouseLook:
    """Draw dimensions and materials; `shops` and `bays` are the probabilities of a shop and of a bay."""
    rng = builder.rng
    storeys = max(1, round(builder.height_m / 2.85))
    return _HouseLook(
        wall=str(rng.choice(["brick", "brick", "concrete"])),
        roof=str(rng.choice(["brick", "concrete"])),
        storey_m=builder.height_m / storeys,
        storeys=storeys,
        width_m=rng.uniform(0.95, 1.4),
        pitch_m=rng.uniform(2.1, 2.9),
        depth_m=rng.uniform(0.1, 0.22),
        shop=bool(rng.random() < shops),
        bay=bool(rng.random() < bays),
    )


def terrace(builder: BuildingBuilder) -> None:
    """Add a terraced house, with gables towards its party walls.

    Args:
        builder: The building.
    """
    _dwelling(builder, _house_look(builder, shops=0.2, bays=0.45), hip=False)


def house(builder: BuildingBuilder) -> None:
    """Add a detached house with a gable or hip roof.

    Args:
        builder: The building.
    """
    _dwelling(builder, _house_look(builder, shops=0.0, bays=0.35), hip=bool(builder.rng.random() < 0.4))


def _dwelling(builder: BuildingBuilder, look: _HouseLook, *, hip: bool) -> None:
    """Add walls and roof."""
    front = builder.front
    for edge, (frame, is_open) in enumerate(zip(builder.frames, builder.open_edges, strict=True)):
        if is_open and frame.length_m > 2.0:
            _house_facade(builder, frame, look, is_front=edge == front)
        else:
            builder.add(look.wall, frame.to_world(facade.panels(0.0, frame.length_m, 0.0, builder.height_m)))
    _house_roof(builder, look, hip=builder.roof_shape == "hipped" if builder.roof_shape else hip)


def _house_facade(builder: BuildingBuilder, frame: Frame, look: _HouseLook, *, is_front: bool) -> None:
    """Add a wall with its windows, and on the front a door and perhaps a bay or a shop window."""
    length, storey = frame.length_m, look.storey_m
    left, right = columns(length, pitch_m=look.pitch_m, width_m=min(look.width_m, 0.6 * length))
    floor = storey * np.arange(look.storeys)
    low, high = floor + 0.32 * storey, floor + 0.8 * storey
    upper = grid(low=low[1:], high=high[1:], left=left, right=right, depth_m=look.depth_m)
    ground = grid(low=low[:1], high=high[:1], left=left, right=right, depth_m=look.depth_m)
    windows, grids = [upper, ground], [upper, ground]
    if is_front and look.shop:
        shop = _shopfront(builder, frame, storey)
        windows, grids = [upper], [upper, shop]
    elif is_front and len(left):
        door, ground = _door_and_windows(ground, look)
        windows, grids = [upper], [upper, door]
        builder.add("wood", frame.to_world(_door_leaf(door)))
        builder.add("glass", frame.to_world(facade.panes(ground)))
        builder.add(
            "paving", frame.to_world(facade.boxes(door.left[0] - 0.2, door.right[0] + 0.2, 0.0, 0.14, 0.4))
        )
        if ground.left.size:
            builder.add("paving", frame.to_world(facade.sills(ground)))
            if look.bay:
                _bay(builder, frame, look, float(ground.left[-1]), float(ground.right[-1]))
    builder.add(look.wall, frame.to_world(facade.pierced_wall(length, builder.height_m, grids)))
    for openings in windows:
        if openings.bottom.size:
            builder.add("glass", frame.to_world(facade.panes(openings)))
            builder.add("paving", frame.to_world(facade.sills(openings)))
            builder.add("wood", frame.to_world(facade.mullions(openings)))
    builder.add("metal", frame.to_world(facade.downpipe(0.18, builder.height_m)))


def _door_and_windows(ground: Grid, look: _HouseLook) -> tuple[Grid, Grid]:
    """Return the ground-floor row with its first column as a door, and the windows beside the door."""
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
    fields = facade.boxes(
        [s0 + 0.12] * 2, [s1 - 0.12] * 2, [z0 + 0.15, z0 + 1.05], [z0 + 0.9, z1 - 0.15], back + 0.03, back
    )
    return np.concatenate([facade.panels(s0, s1, z0, z1, back), fields])


def _shopfront(builder: BuildingBuilder, frame: Frame, storey_m: float) -> Grid:
    """Add shop windows, a door in their middle, a fascia and an awning; return the openings."""
    length = frame.length_m
    count = max(1, round(length / 2.6))
    edges = np.linspace(0.25, length - 0.25, count + 1)
    left, right = edges[:-1] + 0.06, edges[1:] - 0.06
    bottom = np.full((1, count), 0.5)
    bottom[0, count // 2] = 0.05
    row = grid(low=[0.05], high=[0.8 * storey_m], left=left, right=right, depth_m=0.15, bottom=bottom)
    builder.add("glass", frame.to_world(facade.panes(row)))
    builder.add("metal", frame.to_world(facade.mullions(row)))
    builder.add(
        "wood", frame.to_world(facade.boxes(0.15, length - 0.15, 0.82 * storey_m, 0.99 * storey_m, 0.14))
    )
    if builder.rng.random() < 0.5:
        high = 0.97 * storey_m
        low = max(high - 0.5, _HEADROOM_M)
        awning = np.array(
            [[[0.3, low, 1.2], [length - 0.3, low, 1.2], [length - 0.3, high, 0.05], [0.3, high, 0.05]]]
        )
        builder.add("wood", frame.to_world(np.concatenate([awning, awning[:, ::-1] - [0, 0.02, 0]])))
    return row


def _bay(builder: BuildingBuilder, frame: Frame, look: _HouseLook, left: float, right: float) -> None:
    """Add a canted bay in front of a ground-floor window: aprons, three panes, heads and a metal roof."""
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
    builder.add(look.wall, frame.to_world(np.concatenate([ring(0.0, 0.0, sill), ring(0.0, head, top)])))
    builder.add("glass", frame.to_world(ring(0.06, sill, head)))
    builder.add("metal", frame.to_world(np.concatenate([crown[[[1, 2, 3, 0]]], sides])))


def _house_roof(builder: BuildingBuilder, look: _HouseLook, *, hip: bool) -> None:
    """Add a pitched roof over a quadrilateral, or a mansard roof over any other outline."""
    if builder.roof_shape == "flat":
        flat_top(builder, look.wall, parapet_m=0.4)
        return
    if len(builder.outline) != 4 or builder.roof_shape == "mansard":
        _mansard(builder, look)
        return
    lengths = [frame.length_m for frame in builder.frames]
    plain = [not is_open for is_open in builder.open_edges]
    turned = lengths[0] + lengths[2] < lengths[1] + lengths[3]
    if plain[0] + plain[2] != plain[1] + plain[3]:
        turned = plain[0] + plain[2] > plain[1] + plain[3]
    order = np.roll(np.arange(4), -1 if turned else 0)
    is_open = np.array(builder.open_edges)[order]
    overhang = np.where(is_open, [0.32, 0.2, 0.32, 0.2], 0.0) if not hip else np.full(4, 0.32) * is_open
    slope = builder.rng.uniform(0.65, 0.95)
    if builder.roof_rise_m is not None:
        slope = builder.roof_rise_m / roof.half_span_m(builder.outline[order])
    surfaces, gables, ridge = roof.pitched_roof(
        builder.outline[order], overhang, height_m=builder.height_m, slope=slope, hip=hip
    )
    builder.add(look.roof, surfaces)
    if len(gables):
        builder.add(look.wall, gables)
    for edge in order[[0, 2]]:
        if builder.open_edges[edge]:
            _gutter(builder, builder.frames[edge], z_m=builder.height_m - 0.32 * slope - 0.05, out_m=0.32)
    if builder.rng.random() < 0.75:
        _chimney(builder, ridge)


def _gutter(builder: BuildingBuilder, frame: Frame, *, z_m: float, out_m: float) -> None:
    """Add a gutter along the eaves."""
    builder.add(
        "metal", frame.to_world(facade.boxes(0.0, frame.length_m, z_m - 0.11, z_m, out_m + 0.11, out_m))
    )


def _chimney(builder: BuildingBuilder, ridge: NDArray[np.float64]) -> None:
    """Add a chimney near one end of the ridge, with a cap and two pots."""
    along = ridge[1, :2] - ridge[0, :2]
    size = float(np.linalg.norm(along))
    if size < 1.5:
        return
    middle = ridge[0, :2] + along * (0.55 / size)
    yaw, top = float(portable_math.arctan2(along[1], along[0])), float(ridge[0, 2])
    across = np.array([-along[1], along[0]]) / size
    cap = roof.upright_box(middle, (0.7, 1.15), bottom_m=top + 0.85, top_m=top + 0.95, yaw_rad=yaw)
    pots = [
        roof.upright_box(
            middle + shift * across, (0.24, 0.24), bottom_m=top + 0.95, top_m=top + 1.3, yaw_rad=yaw
        )
        for shift in (-0.28, 0.28)
    ]
    stack = roof.upright_box(middle, (0.6, 1.05), bottom_m=top - 1.0, top_m=top + 0.85, yaw_rad=yaw)
    builder.add("brick", np.concatenate([stack, cap, *pots]))


def _mansard(builder: BuildingBuilder, look: _HouseLook) -> None:
    """Add a mansard roof, or a flat roof where the outline is too small for one."""
    inset = 1.4
    inner = roof.offset_outline(builder.outline, -inset)
    if roof.signed_area(inner) < 0.1 * roof.signed_area(builder.outline):
        flat_top(builder, look.wall, parapet_m=0.4)
        return
    builder.add(
        look.roof, roof.mansard_roof(builder.outline, height_m=builder.height_m, inset_m=inset, rise_m=1.2)
    )
