"""The tolerance of a match in cells: what lies within it, for whole scans and for single places.

A place is within the tolerance of a cell if it is so in range and, by the range of the cell, across.
"""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

_CHUNK = 2000
"""Places whose surroundings are gathered at a time."""


@dataclass(frozen=True, kw_only=True)
class Reach:
    """The tolerance in cells: of `bins` in range, and of `azimuths` across, which fall with range.

    Attributes:
        bins: Largest difference in range [bins].
        azimuths: Largest difference across from a target cell in each bin (bins,) [azimuths].
    """

    bins: int
    azimuths: NDArray[np.int64]

    @classmethod
    def of(cls, tolerance_m: float, *, azimuths: int, bins: int, bin_m: float) -> "Reach":
        """Convert a tolerance to cells.

        Args:
            tolerance_m: The tolerance [m].
            azimuths: Azimuths of a scan.
            bins: Bins of an azimuth.
            bin_m: Length of a bin [m].

        Returns:
            The tolerance; across it is at least one azimuth, and at most half a revolution.
        """
        step_m = (np.arange(bins) + 0.5) * bin_m * (2 * math.pi / azimuths)
        across = np.clip(np.floor(tolerance_m / step_m + 1e-9), 1, max(azimuths // 2, 1))
        return cls(bins=math.floor(tolerance_m / bin_m + 1e-9), azimuths=across.astype(np.int64))

    def from_cells(self, values: NDArray) -> NDArray:
        """Return the maximum of the values of the cells within whose tolerance each place lies.

        Args:
            values: Values of cells (azimuths, bins).

        Returns:
            The maxima at places (azimuths, bins).
        """
        return self._along_range(self._across(values))

    def to_cells(self, values: NDArray) -> NDArray:
        """Return the maximum of the values of the places within the tolerance of each cell.

        Args:
            values: Values of places (azimuths, bins).

        Returns:
            The maxima at cells (azimuths, bins).
        """
        return self._across(self._along_range(values))

    def _along_range(self, values: NDArray) -> NDArray:
        low = np.iinfo(values.dtype).min
        return maximum_filter1d(values, 2 * self.bins + 1, axis=1, mode="constant", cval=low)

    def _across(self, values: NDArray) -> NDArray:
        found = np.empty_like(values)
        edges = np.flatnonzero(np.diff(self.azimuths, prepend=0, append=0))
        for start, stop in pairwise(edges):
            width = 2 * int(self.azimuths[start]) + 1
            found[:, start:stop] = maximum_filter1d(values[:, start:stop], width, axis=0, mode="wrap")
        return found

    def strongest(
        self, codes: NDArray[np.uint8], azimuth: NDArray[np.int64], bins: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        """Return the strongest cell within the tolerance of places, of equal ones the nearest.

        Args:
            codes: Codes of the cells (azimuths, bins).
            azimuth: Azimuths of N places (N,).
            bins: Their bins (N,).

        Returns:
            Flat numbers of the cells (N,).
        """
        found = np.empty(len(bins), np.int64)
        widths = self.azimuths[np.maximum(bins - self.bins, 0)]  # that of the nearest cell, the widest
        for width in np.unique(widths):
            group = np.flatnonzero(widths == width)
            for part in np.array_split(group, -(-len(group) // _CHUNK)):
                found[part] = self._strongest(codes, azimuth[part], bins[part], int(width))
        return found

    def _strongest(
        self, codes: NDArray[np.uint8], azimuth: NDArray[np.int64], bins: NDArray[np.int64], width: int
    ) -> NDArray[np.int64]:
        """Return the strongest cells for places whose tolerance is at most `width` azimuths."""
        count, length = codes.shape
        rows, columns = np.mgrid[-width : width + 1, -self.bins : self.bins + 1].reshape(2, -1)
        order = np.lexsort((columns, rows, np.abs(columns), np.abs(rows)))
        rows, columns = rows[order], columns[order]
        cell = bins[:, None] + columns  # (N, cells)
        inside = (cell >= 0) & (cell < length)
        cell = np.clip(cell, 0, length - 1)
        inside &= np.abs(rows) <= self.azimuths[cell]
        flat = (azimuth[:, None] + rows) % count * length + cell
        level = np.where(inside, codes.ravel()[flat].astype(np.int16), np.int16(-1))
        return flat[np.arange(len(flat)), np.argmax(level, axis=1)]
