"""Blocks of scans along the way: successive scans show nearly the same, only blocks of them vary freely."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

BLOCK_M = 80.0
"""Least way of a block [m]: figures of single scans, which see some 100 m, are alike up to 60 m apart."""


def block_numbers(travelled_m: Sequence[float] | NDArray[np.float64]) -> NDArray[np.int64]:
    """Number the blocks in which scans lie.

    Args:
        travelled_m: Way from the first scan to each scan (N,) [m], never falling.

    Returns:
        Numbers of the blocks (N,), from 0 without gaps. A block ends where the next scan is `BLOCK_M` or more
        from its first one; what is left at the end belongs to the last block, so that none but an only block
        is shorter.
    """
    found = np.zeros(len(travelled_m), np.int64)
    number, start_m = 0, 0.0
    for place, way_m in enumerate(travelled_m):
        if way_m - start_m >= BLOCK_M:
            number, start_m = number + 1, float(way_m)
        found[place] = number
    if number and travelled_m[-1] - start_m < BLOCK_M:
        found[found == number] = number - 1
    return found
