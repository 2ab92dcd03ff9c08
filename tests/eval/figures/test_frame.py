"""What a figure shows of a scan's truth: ghosts in place apart from displaced ones."""

import numpy as np

from echoscape.eval.figures.frame import shown_components
from echoscape.sim.datasets.polar_scan import Component
from tests.sim.scans import drawn_scan

NAMES = [component.name.lower() for component in Component]


def test_ghosts_in_place_are_shown_apart_and_nothing_else_changes() -> None:
    truth = drawn_scan().truth
    assert truth is not None
    cells = truth.cells
    shown = shown_components(cells, NAMES)
    in_place = (cells.component == Component.GHOST) & ~cells.displaced
    assert in_place.any()
    assert (shown[in_place] == len(NAMES)).all()
    np.testing.assert_array_equal(shown[~in_place], cells.component[~in_place])
