"""Builds a road graph lane by lane: adds lanes, connects them, and limits the speed in bends.

Connecting lanes are smooth curves, see `scenes.geometry.curves.connecting_curve`.
"""

from dataclasses import replace

import numpy as np

from echoscape.scenes.core.lane_graph import Lane, LaneKind, RoadGraph
from echoscape.scenes.geometry.curves import Line, connecting_curve, smallest_radius

_LATERAL_MPS2 = 2.0
"""Lateral acceleration that sets the speed limit of a bend [m/s^2]."""


class LaneGraphBuilder:
    """A road graph under construction."""

    def __init__(self) -> None:
        """Start without lanes."""
        self._lanes: list[Lane] = []
        self._next: list[list[int]] = []

    def add(
        self, centre: Line, kind: LaneKind, *, width_m: float, speed_mps: float, junction: int | None = None
    ) -> int:
        """Add a lane.

        Args:
            centre: Centre line (P, 2) [m].
            kind: Kind of lane.
            width_m: Width [m].
            speed_mps: Speed limit [m/s]; outside streets it is lowered to suit the smallest radius.
            junction: Index of the junction that the lane crosses, None for a street lane.

        Returns:
            Id of the lane.
        """
        limit = float(np.sqrt(_LATERAL_MPS2 * smallest_radius(centre)))
        speed = speed_mps if kind == "street" else float(np.clip(limit, 5.0, speed_mps))
        lane = Lane(
            id=len(self._lanes),
            kind=kind,
            centre=centre,
            width_m=width_m,
            speed_limit_mps=speed,
            successors=(),
            junction=junction,
        )
        self._lanes.append(lane)
        self._next.append([])
        return lane.id

    def __getitem__(self, lane: int) -> Lane:
        """Return a lane by its id."""
        return self._lanes[lane]

    def is_unconnected(self, lane: int) -> bool:
        """Check for successors.

        Args:
            lane: Id of the lane.

        Returns:
            Whether the lane has no successor yet.
        """
        return not self._next[lane]

    def join(self, before: int, after: int) -> None:
        """Let traffic continue from one lane to another.

        Args:
            before: Id of the first lane.
            after: Id of the lane that follows.
        """
        self._next[before].append(after)

    def connect(self, before: int, after: int, *, junction: int, kind: LaneKind = "turn") -> int:
        """Add a smooth lane between two lanes.

        Args:
            before: Id of the lane at whose end it starts.
            after: Id of the lane at whose start it ends.
            junction: Index of the junction that it crosses.
            kind: Kind of lane.

        Returns:
            Id of the new lane.
        """
        first, second = self._lanes[before], self._lanes[after]
        lane = self.add(
            connecting_curve(first.centre, second.centre),
            kind,
            width_m=min(first.width_m, second.width_m),
            speed_mps=min(first.speed_limit_mps, second.speed_limit_mps),
            junction=junction,
        )
        self.join(before, lane)
        self.join(lane, after)
        return lane

    def pair_directions(self, first: int, second: int) -> None:
        """Mark two lanes as the two directions of one street.

        Args:
            first: Id of one lane.
            second: Id of the other.
        """
        self._lanes[first] = replace(self._lanes[first], opposite=second)
        self._lanes[second] = replace(self._lanes[second], opposite=first)

    def set_yield(self, lane: int) -> None:
        """Let traffic give way at the end of a lane.

        Args:
            lane: Id of the lane.
        """
        self._lanes[lane] = replace(self._lanes[lane], yields=True)

    def graph(self, junctions: Line) -> RoadGraph:
        """Return the finished graph.

        Args:
            junctions: Centres of the junctions (J, 2) [m].

        Returns:
            The graph, without footpaths and kerbs.
        """
        lanes = tuple(
            replace(lane, successors=tuple(after))
            for lane, after in zip(self._lanes, self._next, strict=True)
        )
        return RoadGraph(lanes=lanes, junctions=np.asarray(junctions, dtype=np.float64))
