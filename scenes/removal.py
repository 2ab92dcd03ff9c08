"""Taking things out of a world: a town, its movers and its targets without some instances.

Instance ids and classes of all others stay what they were, and so do their draws.
"""

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from echoscape.scenes.world import Mover, Placements, StaticMesh, Town


def without(
    town: Town, movers: Sequence[Mover], instances: Collection[int]
) -> tuple[Town, tuple[Mover, ...]]:
    """Return the town and the movers without `instances`, shadows and all.

    Raises:
        ValueError: an instance is neither in the town nor among the movers.
    """
    known = set(range(1, len(town.instance_class))) | {mover.instance for mover in movers}
    strange = sorted(set(instances) - known)
    if strange:
        raise ValueError(f"instances must be of the town or its movers, got {strange[0]}")
    gone = np.array(sorted(instances), np.uint32)
    left = replace(
        town,
        static={material: _less(mesh, gone) for material, mesh in town.static.items()},
        placements=_fewer(town.placements, gone),
        targets=tuple(each for each in town.targets if each.instance not in instances),
    )
    return left, tuple(mover for mover in movers if mover.instance not in instances)


def _less(mesh: StaticMesh, gone: np.ndarray) -> StaticMesh:
    keep = ~np.isin(mesh.instance, gone)
    return mesh if keep.all() else replace(mesh, faces=mesh.faces[keep], instance=mesh.instance[keep])


def _fewer(places: Placements, gone: np.ndarray) -> Placements:
    keep = ~np.isin(places.instance, gone)
    return Placements(**{name: values[keep] for name, values in vars(places).items()})
