"""Which lanes of a junction conflict."""

import numpy as np
from numpy.testing import assert_allclose

from echoscape.scenes.core.lane_graph import RoadGraph
from echoscape.scenes.traffic.right_of_way import conflicting_lanes


def test_crossing_lanes_conflict_and_parallel_ones_do_not(blocks: RoadGraph) -> None:
    conflict = conflicting_lanes(blocks)
    assert_allclose(conflict, conflict.T)
    assert not conflict[[lane.id for lane in blocks.lanes if lane.kind == "street"]].any()
    turns = [lane for lane in blocks.lanes if lane.kind == "turn" and lane.junction == 12]
    straight_on = [lane for lane in turns if np.hypot(*(lane.centre[-1] - lane.centre[0])) > 17.9]
    assert len(straight_on) == 4
    for first in straight_on:
        chord = first.centre[-1] - first.centre[0]
        for second in straight_on:
            cosine = chord @ (second.centre[-1] - second.centre[0]) / (chord @ chord)
            assert conflict[first.id, second.id] == (
                cosine > -0.5
            )  # itself and the two that cross, not the opposite
