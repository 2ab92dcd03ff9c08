import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from echoscape.eval.detections.k_strongest import KStrongest, KStrongestSettings
from tests.eval.detections.made_scans import BIN_M, made_scan, map_of


@given(seed=st.integers(0, 2**32 - 1), k=st.integers(1, 12))
@settings(max_examples=40, deadline=None)
def test_of_every_azimuth_the_k_strongest_above_the_floor_are_kept(seed: int, k: int) -> None:
    codes = np.random.default_rng(seed).integers(0, 12, (5, 40)) * 8  # many are equal
    settings = KStrongestSettings(k=k, floor_db=20.0, near_m=1.0)
    found = KStrongest(settings).detect(made_scan(codes)).detections
    expected = []
    for azimuth, row in enumerate(codes.tolist()):
        cells = [(-code, place) for place, code in enumerate(row) if code >= 40 and place >= 10]
        expected += [(azimuth, place) for _, place in sorted(sorted(cells)[:k], key=lambda cell: cell[1])]
    places = np.floor(found.range_m / BIN_M).astype(int)
    assert list(zip(found.azimuth.tolist(), places.tolist(), strict=True)) == expected
    assert_allclose(found.score, codes[found.azimuth, places])


def test_more_cells_than_there_are_keeps_all() -> None:
    found = KStrongest(KStrongestSettings(k=999, floor_db=0.0, near_m=0.0)).detect(
        made_scan(np.ones((3, 20)))
    )
    assert len(found.detections) == len(map_of(found)) == 60


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"k": 0}, "k must be 1 or more, got 0"),
        ({"floor_db": math.nan}, "floor_db must be finite and 0 or more, got nan"),
        ({"near_m": -1.0}, "near_m must be finite and 0 or more, got -1.0"),
    ],
)
def test_refuses_settings(given: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        KStrongestSettings(**given)
