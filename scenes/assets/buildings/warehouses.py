"""Industrial halls: profiled sheet on a plinth, roller doors, loading docks, shallow roofs."""

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.assets.buildings import facade as fc
from echoscape.scenes.assets.buildings import roof as roofs
from echoscape.scenes.assets.buildings.builder import Site, flat_top
from echoscape.scenes.assets.buildings.facade import Frame, grid


def hall(site: Site) -> None:
    """Add an industrial hall: profiled sheet on a concrete plinth, roller doors, a shallow roof."""
    pitch, depth = site.rng.uniform(0.7, 1.0), site.rng.uniform(0.04, 0.1)
    front = site.front
    for edge, (frame, is_open) in enumerate(zip(site.frames, site.open_edges, strict=True)):
        doors = _hall_doors(site, frame) if edge == front and is_open else np.zeros((0, 2))
        _clad(site, frame, doors, pitch_m=pitch if is_open else 1.0, depth_m=depth)
        site.add(
            "metal", frame.to_world(fc.boxes(0.0, frame.length_m, site.height_m - 0.15, site.height_m, 0.16))
        )
        count = max(2, round(frame.length_m / 12.0) + 1)
        places = np.linspace(0.3, frame.length_m - 0.3, count)
        clear = [not any(a - 0.2 < s < b + 0.2 for a, b in doors) for s in places]
        if any(clear):
            pipes = fc.downpipe(places[clear], site.height_m, radius_m=0.08)
            site.add("metal", frame.to_world(pipes + np.array([0.0, 0.0, depth])))
    if len(site.outline) == 4:
        order = np.roll(np.arange(4), -int(site.frames[0].length_m < site.frames[1].length_m))
        surfaces, gables, _ = roofs.pitched_roof(
            site.outline[order], np.full(4, 0.1), height_m=site.height_m, slope=0.12, hip=False
        )
        site.add("metal", np.concatenate([surfaces, gables]))
    else:
        flat_top(site, "metal", parapet_m=0.4)


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
