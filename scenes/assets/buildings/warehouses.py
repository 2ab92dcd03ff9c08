"""Industrial halls: profiled sheet on a plinth, roller doors, loading docks, shallow roofs."""

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.assets.buildings import facade, roof
from echoscape.scenes.assets.buildings.builder import BuildingBuilder, flat_top
from echoscape.scenes.assets.buildings.facade import Frame, grid


def hall(builder: BuildingBuilder) -> None:
    """Add an industrial hall: profiled sheet on a concrete plinth, roller doors, a shallow roof.

    Args:
        builder: The building.
    """
    pitch, depth = builder.rng.uniform(0.7, 1.0), builder.rng.uniform(0.04, 0.1)
    front = builder.front
    for edge, (frame, is_open) in enumerate(zip(builder.frames, builder.open_edges, strict=True)):
        doors = _hall_doors(builder, frame) if edge == front and is_open else np.zeros((0, 2))
        _clad(builder, frame, doors, pitch_m=pitch if is_open else 1.0, depth_m=depth)
        builder.add(
            "metal",
            frame.to_world(
                facade.boxes(0.0, frame.length_m, builder.height_m - 0.15, builder.height_m, 0.16)
            ),
        )
        count = max(2, round(frame.length_m / 12.0) + 1)
        places = np.linspace(0.3, frame.length_m - 0.3, count)
        clear = [not any(a - 0.2 < s < b + 0.2 for a, b in doors) for s in places]
        if any(clear):
            pipes = facade.downpipe(places[clear], builder.height_m, radius_m=0.08)
            builder.add("metal", frame.to_world(pipes + np.array([0.0, 0.0, depth])))
    if len(builder.outline) == 4:
        order = np.roll(np.arange(4), -int(builder.frames[0].length_m < builder.frames[1].length_m))
        surfaces, gables, _ = roof.pitched_roof(
            builder.outline[order], np.full(4, 0.1), height_m=builder.height_m, slope=0.12, hip=False
        )
        builder.add("metal", np.concatenate([surfaces, gables]))
    else:
        flat_top(builder, "metal", parapet_m=0.4)


def _hall_doors(builder: BuildingBuilder, frame: Frame) -> NDArray[np.float64]:
    """Add roller doors, docks and canopies; return the left and right edges of the doors (D, 2) [m]."""
    width, top = 4.0, min(4.4, 0.75 * builder.height_m)
    count = int(min(4, frame.length_m // 8.0))
    middle = (np.arange(count) + 0.5) * frame.length_m / max(count, 1)
    doors = np.stack([middle - 0.5 * width, middle + 0.5 * width], axis=1)
    for number, (left, right) in enumerate(doors.tolist()):
        is_dock = number >= count - 2 and count > 2
        low = 1.1 if is_dock else 0.0
        opening = grid(low=[low], high=[top], left=[left], right=[right], depth_m=0.25)
        # The first four quads are the wall itself, which the sheet replaces.
        reveal = facade.pierced_wall(frame.length_m, top, [opening])[4:]
        builder.add(
            "metal", frame.to_world(np.concatenate([reveal, facade.slats(left, right, low, top, -0.25)]))
        )
        if is_dock:
            builder.add("concrete", frame.to_world(facade.boxes(left - 0.6, right + 0.6, 0.0, 1.1, 1.5)))
            builder.add(
                "rubber",
                frame.to_world(facade.boxes([left, right - 0.3], [left + 0.3, right], 0.7, 1.05, 1.6, 1.5)),
            )
        builder.add(
            "metal", frame.to_world(facade.boxes(left - 0.4, right + 0.4, top + 0.25, top + 0.4, 1.4))
        )
    return doors


def _clad(
    builder: BuildingBuilder, frame: Frame, doors: NDArray[np.float64], *, pitch_m: float, depth_m: float
) -> None:
    """Add the plinth and ribbed sheet, which is left out at the doors and continues above them."""
    plinth, top = 0.5, min(4.4, 0.75 * builder.height_m)
    edges = np.r_[0.0, doors.ravel(), frame.length_m]
    sheet = []
    for left, right in edges.reshape(-1, 2):
        sheet.append(facade.ribs(left, right, plinth, builder.height_m, pitch_m=pitch_m, depth_m=depth_m))
        builder.add("concrete", frame.to_world(facade.boxes(left, right, 0.0, plinth, depth_m + 0.03)))
    for left, right in doors:
        sheet.append(facade.ribs(left, right, top, builder.height_m, pitch_m=pitch_m, depth_m=depth_m))
    builder.add("metal", frame.to_world(np.concatenate(sheet)))
