"""Blocks and towers of equal storeys: window columns, string courses, balconies, entrances, flat roofs."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.assets.buildings import facade, roof
from echoscape.scenes.assets.buildings.builder import BuildingBuilder, columns, flat_top
from echoscape.scenes.assets.buildings.facade import Frame, Grid, grid
from echoscape.scenes.core import portable_math


@dataclass(frozen=True, kw_only=True)
class _BlockLook:
    """Dimensions and materials of a block."""

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


def _block_look(
    builder: BuildingBuilder, *, width_m: tuple[float, float], gap_m: float, balconies: float, windows: int
) -> _BlockLook:
    """Draw dimensions and materials, with at most about `windows` windows in the whole building."""
    rng = builder.rng
    storeys = max(2, round(builder.height_m / 3.0))
    perimeter = sum(frame.length_m for frame in builder.frames)
    width = rng.uniform(*width_m)
    pitch = max(width + gap_m, perimeter * storeys / windows)
    return _BlockLook(
        wall=str(rng.choice(["brick", "concrete", "concrete"])),
        storey_m=builder.height_m / storeys,
        storeys=storeys,
        width_m=max(width, 0.45 * pitch),
        pitch_m=pitch,
        depth_m=rng.uniform(0.12, 0.25),
        parapet_m=rng.uniform(0.4, 1.0),
        balcony=bool(rng.random() < balconies),
        solid=bool(rng.random() < 0.4),
        shops=bool(rng.random() < 0.35),
    )


def block(builder: BuildingBuilder) -> None:
    """Add a block of flats or offices.

    Args:
        builder: The building.
    """
    _storeyed(builder, _block_look(builder, width_m=(1.4, 2.1), gap_m=1.2, balconies=0.7, windows=95))


def tower(builder: BuildingBuilder) -> None:
    """Add a tower with wide windows close together.

    Args:
        builder: The building.
    """
    _storeyed(builder, _block_look(builder, width_m=(2.2, 3.2), gap_m=0.8, balconies=0.3, windows=170))


def _storeyed(builder: BuildingBuilder, look: _BlockLook) -> None:
    """Add facades, flat roof and roof equipment."""
    front = builder.front
    for edge, (frame, is_open) in enumerate(zip(builder.frames, builder.open_edges, strict=True)):
        if is_open and frame.length_m > 2.5:
            _block_facade(builder, frame, look, is_front=edge == front)
        else:
            builder.add(look.wall, frame.to_world(facade.panels(0.0, frame.length_m, 0.0, builder.height_m)))
    flat_top(builder, look.wall, parapet_m=look.parapet_m)
    _plant(builder)


def _block_facade(builder: BuildingBuilder, frame: Frame, look: _BlockLook, *, is_front: bool) -> None:
    """Add a wall of equal storeys: window columns, string courses, balconies, an entrance."""
    length, storey = frame.length_m, look.storey_m
    width = min(look.width_m, 0.7 * length)
    left, right = columns(length, pitch_m=max(look.pitch_m, width + 0.4), width_m=width)
    floor = np.arange(1.0, look.storeys) * storey
    bottom = np.repeat(floor[:, None] + 0.3 * storey, len(left), axis=1)
    with_balcony = np.arange(len(left)) % 3 == 1
    if look.balcony and is_front and with_balcony.any():
        bottom[:, with_balcony] = floor[:, None] + 0.06
        _add_balconies(builder, frame, look, left[with_balcony], right[with_balcony], floor)
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
        grids.append(_entrance(builder, frame, look, left, right))
    else:
        plain = grid(low=0.35 * storey, high=0.82 * storey, left=left, right=right, depth_m=look.depth_m)
        grids.append(plain)
        builder.add("glass", frame.to_world(facade.panes(plain)))
    builder.add(look.wall, frame.to_world(facade.pierced_wall(length, builder.height_m, grids)))
    builder.add("glass", frame.to_world(facade.panes(upper)))
    builder.add("metal", frame.to_world(facade.mullions(upper)))
    courses = np.r_[floor, builder.height_m - 0.12] if is_front else np.array([builder.height_m - 0.12])
    builder.add("concrete", frame.to_world(facade.boxes(0.0, length, courses - 0.1, courses + 0.08, 0.08)))
    if is_front:
        builder.add("concrete", frame.to_world(facade.sills(windows)[_is_sill(windows, with_balcony, look)]))
    builder.add(
        "metal", frame.to_world(facade.downpipe([0.25, length - 0.25], builder.height_m, radius_m=0.06))
    )


def _is_sill(windows: Grid, with_balcony: NDArray[np.bool_], look: _BlockLook) -> NDArray[np.bool_]:
    """Return which of the five quads of each sill to keep: none under balcony doors."""
    keep = np.broadcast_to(~(with_balcony & look.balcony), windows.bottom.shape).ravel()
    return np.repeat(keep, 5)


def _add_balconies(
    builder: BuildingBuilder,
    frame: Frame,
    look: _BlockLook,
    left: NDArray[np.float64],
    right: NDArray[np.float64],
    floor: NDArray[np.float64],
) -> None:
    """Add balconies at the given window columns of every upper floor."""
    s0, z = np.meshgrid(np.maximum(left - 0.35, 0.05), floor)
    s1, _ = np.meshgrid(np.minimum(right + 0.35, frame.length_m - 0.05), floor)
    slab, rails = facade.balconies(s0.ravel(), s1.ravel(), z.ravel(), out_m=1.3, solid=look.solid)
    builder.add("concrete", frame.to_world(slab))
    if len(rails):
        builder.add("metal", frame.to_world(rails))


def _entrance(
    builder: BuildingBuilder,
    frame: Frame,
    look: _BlockLook,
    left: NDArray[np.float64],
    right: NDArray[np.float64],
) -> Grid:
    """Add the windows of the ground floor with a door in the middle and a canopy; return the openings."""
    storey, count = look.storey_m, len(left)
    if look.shops and count:
        gap = 0.3
        edges = np.linspace(0.2, frame.length_m - 0.2, count + 1)
        left, right = edges[:-1] + gap / 2, edges[1:] - gap / 2
    bottom = np.full((1, count), 0.45 if look.shops else 0.35 * storey)
    if count:
        bottom[0, count // 2] = 0.05
        s0, s1 = float(left[count // 2]) - 0.3, float(right[count // 2]) + 0.3
        builder.add("metal", frame.to_world(facade.boxes(s0, s1, 0.86 * storey, 0.92 * storey, 1.2)))
        builder.add("paving", frame.to_world(facade.boxes(s0, s1, 0.0, 0.05, 1.0)))
    row = grid(low=[0.05], high=[0.82 * storey], left=left, right=right, depth_m=look.depth_m, bottom=bottom)
    builder.add("glass", frame.to_world(facade.panes(row)))
    builder.add("metal", frame.to_world(facade.mullions(row)))
    return row


def _plant(builder: BuildingBuilder) -> None:
    """Add a stair head and two ventilation units to a flat roof."""
    frame, base = builder.frames[builder.front], builder.height_m
    step = frame.length_m * frame.along
    inward = np.array([-frame.along[1], frame.along[0]])
    room = min(5.0, 0.4 * roof.signed_area(builder.outline) / frame.length_m)
    middle = frame.origin + 0.5 * step + room * inward
    yaw = float(portable_math.arctan2(step[1], step[0]))
    reach = 0.18 * frame.length_m
    builder.add(
        "concrete", roof.upright_box(middle, (3.0, 2.4), bottom_m=base, top_m=base + 2.6, yaw_rad=yaw)
    )
    units = [
        roof.upright_box(
            middle + shift * reach * frame.along,
            (1.6, 1.1),
            bottom_m=base + 0.2,
            top_m=base + 1.5,
            yaw_rad=yaw,
        )
        for shift in (-1.0, 1.0)
    ]
    builder.add("metal", np.concatenate(units))
