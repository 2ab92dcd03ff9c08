"""Runs of successive range bins, and what holds within each."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True)
class Runs:
    """R runs of successive bins in the azimuths of a scan, by azimuth, nearest first.

    Attributes:
        shape: Azimuths and bins of the scan.
        azimuth: Numbers of their azimuths (R,) int64.
        first: Their first bins (R,) int64.
        end: The bins after their last ones (R,) int64.
    """

    shape: tuple[int, int]
    azimuth: NDArray[np.int64]
    first: NDArray[np.int64]
    end: NDArray[np.int64]

    @classmethod
    def of(cls, marked: NDArray[np.bool_]) -> "Runs":
        """Find the runs of marked cells.

        Args:
            marked: Which cells are marked (azimuths, bins).

        Returns:
            The runs, each as long as possible.
        """
        edges = np.diff(np.pad(marked, ((0, 0), (1, 1))).astype(np.int8), axis=1)
        azimuth, first = np.nonzero(edges > 0)
        end = np.nonzero(edges < 0)[1]
        return cls(shape=(marked.shape[0], marked.shape[1]), azimuth=azimuth, first=first, end=end)

    def __len__(self) -> int:
        """Return the number of runs."""
        return len(self.azimuth)

    def __getitem__(self, chosen: NDArray) -> "Runs":
        """Select runs.

        Args:
            chosen: Their numbers in increasing order, or which of them (R,) bool.

        Returns:
            The runs.
        """
        return Runs(
            shape=self.shape,
            azimuth=self.azimuth[chosen],
            first=self.first[chosen],
            end=self.end[chosen],
        )

    @property
    def middle(self) -> NDArray[np.int64]:
        """Middle bins (R,), of two the farther one."""
        return (self.first + self.end) // 2

    def reduce(self, ufunc: np.ufunc, values: NDArray) -> NDArray:
        """Reduce the values within each run.

        Args:
            ufunc: Such as `np.maximum` or `np.add`.
            values: Values of the cells (azimuths, bins).

        Returns:
            The results (R,).
        """
        if not len(self):
            return values.ravel()[:0]
        edges = self.azimuth[:, None] * self.shape[1] + np.stack([self.first, self.end], axis=1)
        return ufunc.reduceat(np.append(values, values.flat[-1]), edges.ravel())[::2]

    def peaks(self, values: NDArray) -> NDArray[np.int64]:
        """Find the highest value of each run.

        Args:
            values: Values of the cells (azimuths, bins).

        Returns:
            The bins (R,), of equal values the nearest.
        """
        run, cell = self._cells()
        at_peak = values.ravel()[cell] == self.reduce(np.maximum, values)[run]
        _, where = np.unique(run[at_peak], return_index=True)
        return cell[at_peak][where] % self.shape[1]

    def mask(self) -> NDArray[np.bool_]:
        """Mark the cells of the runs.

        Returns:
            Which cells belong to one (azimuths, bins).
        """
        marked = np.zeros(self.shape, np.bool_)
        marked.flat[self._cells()[1]] = True
        return marked

    def _cells(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the number of the run and the flat number of every cell of every run, in order."""
        lengths = self.end - self.first
        run = np.repeat(np.arange(len(self)), lengths)
        within = np.arange(lengths.sum()) - np.repeat(np.cumsum(lengths) - lengths, lengths)
        return run, self.azimuth[run] * self.shape[1] + self.first[run] + within
