"""Cell-averaging CFAR along range (Finn & Johnson, RCA Review 29, 1968)."""

import numpy as np
from numpy.typing import NDArray


def detections(
    codes: NDArray[np.uint8], *, window: int = 24, guard: int = 8, false_alarm_rate: float = 1e-4
) -> NDArray[np.bool_]:
    """Mark the cells that stand out of their neighbourhood in range.

    Args:
        codes: Received power (azimuths, bins) in half decibels.
        window: Cells averaged on each side.
        guard: Cells left out on each side, at least half the width of an echo.
        false_alarm_rate: Probability of a mark in noise of exponential power.

    Returns:
        Marks (azimuths, bins).
    """
    power = 10.0 ** (codes / 20.0)
    reach = guard + window
    padded = np.pad(power, ((0, 0), (reach, reach)), mode="reflect")
    total = np.cumsum(np.pad(padded, ((0, 0), (1, 0))), axis=1)
    bins = codes.shape[1]

    def sums(half: int) -> NDArray[np.float64]:
        """Sum over 2 half + 1 cells around each cell."""
        first = reach - half
        return total[:, first + 2 * half + 1 :][:, :bins] - total[:, first:][:, :bins]

    count = 2 * window
    factor = false_alarm_rate ** (-1 / count) - 1
    return power > factor * (sums(reach) - sums(guard))
