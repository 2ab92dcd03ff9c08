"""Keypoints of Cen & Newman 2019: peaks of stretches of high power and low gradient that lie side by side.

Source: Cen & Newman, "Radar-only ego-motion estimation in difficult settings via graph matching", ICRA 2019,
algorithm 1.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import correlate1d

from echoscape.eval.methods.keypoints import Keypoints, first_bin, keypoints_at
from echoscape.eval.methods.runs import Runs
from echoscape.sim.datasets.polar_scan import PolarScan


@dataclass(frozen=True, kw_only=True)
class Cen2019Settings:
    """How many stretches are taken, and from where on."""

    regions: int = 1000
    """l_max: stretches that are marked at most, those of the highest score first; the default is for some 400
    azimuths. Those without a neighbour in an adjacent azimuth give no keypoint."""
    cells: int | None = None
    """Mark so many cells of the highest scores in place of whole stretches, as the public implementation of
    Burnett et al., RA-L 2021, does with 10,000: their number then tells how the strongest cells are
    scattered."""
    near_m: float = 2.5
    """Range below which there are no keypoints [m]: leakage and the car itself are there."""

    def __post_init__(self) -> None:
        if self.regions < 1:
            raise ValueError(f"regions must be 1 or more, got {self.regions}")
        if self.cells is not None and self.cells < 1:
            raise ValueError(f"cells must be 1 or more, got {self.cells}")
        if not 0 <= self.near_m < math.inf:
            raise ValueError(f"near_m must be finite and 0 or more, got {self.near_m}")


class Cen2019:
    """One keypoint at the highest score of each marked stretch that touches one in an adjacent azimuth."""

    name = "cen2019"
    score_name = "code above the mean, less by the gradient"
    score_limits = (-256.0, 256.0)

    def __init__(self, settings: Cen2019Settings | None = None) -> None:
        """Take the settings.

        Args:
            settings: Number of stretches and nearest range; None takes the defaults.
        """
        self.settings = settings or Cen2019Settings()

    def scores(self, scan: PolarScan) -> NDArray[np.float64]:
        """Score every cell.

        Args:
            scan: A scan.

        Returns:
            Scores of the cells (azimuths, bins), see `low_gradient_power`.
        """
        return low_gradient_power(scan.codes)

    def extract(self, scan: PolarScan, *, range_offset_m: float = 0.0) -> Keypoints:
        """Find the keypoints.

        Args:
            scan: A scan.
            range_offset_m: Offset to the ranges of bins [m], as in `ScanFolder`.

        Returns:
            The keypoints by azimuth, nearest first.
        """
        scores = self.scores(scan)
        runs = side_by_side(self._marked(scan, scores))
        bins = runs.peaks(scores)
        return keypoints_at(
            scan, runs.azimuth, bins, scores[runs.azimuth, bins], range_offset_m=range_offset_m
        )

    def _marked(self, scan: PolarScan, scores: NDArray[np.float64]) -> Runs:
        above = scan.codes > scan.codes.mean()
        above[:, : first_bin(self.settings.near_m, scan.bin_m)] = False
        if self.settings.cells is None:
            return strongest(Runs.of(above), scores, self.settings.regions)
        return Runs.of(highest_cells(np.where(above, scores, 0.0), self.settings.cells))


def low_gradient_power(codes: NDArray[np.number]) -> NDArray[np.float64]:
    """Score cells by their power, less where it changes along range: H = (1 - |G| / max |G|) (S - mean S).

    Args:
        codes: Power codes S (azimuths, bins), in decibels or any other unit.

    Returns:
        H (azimuths, bins); its sign is that of the power above the mean of the scan.
    """
    power = codes.astype(np.float64)
    gradient = np.abs(correlate1d(power, [-1.0, 0.0, 1.0], axis=1, mode="mirror"))  # Prewitt's, along range
    steepest = gradient.max(initial=0.0)
    weight = 1 - gradient / steepest if steepest > 0 else np.ones_like(gradient)
    return weight * (power - power.mean())


def strongest(runs: Runs, scores: NDArray[np.float64], count: int) -> Runs:
    """Mark the stretches of the highest scores.

    The paper takes cells in the order of their scores and marks each along range to where the power falls
    below its mean. As no two such stretches meet, this is the order of their highest scores.

    Args:
        runs: Stretches of power above the mean.
        scores: H (azimuths, bins).
        count: Stretches that are marked at most; of equal peaks that with the greater sum of scores, then the
            nearer one.

    Returns:
        The marked ones.
    """
    highest, total = runs.reduce(np.maximum, scores), runs.reduce(np.add, scores)
    return runs[np.sort(np.lexsort((runs.first, -total, -highest))[:count])]


def highest_cells(scores: NDArray[np.float64], count: int) -> NDArray[np.bool_]:
    """Mark the cells of the highest scores.

    Args:
        scores: H (azimuths, bins).
        count: How many are marked at most; those that tie for the last place are left out together.

    Returns:
        Which cells are marked (azimuths, bins), none with a score of 0 or less.
    """
    last = np.partition(scores, -count - 1, axis=None)[-count - 1] if count < scores.size else -np.inf
    return scores > max(last, 0.0)


def side_by_side(runs: Runs) -> Runs:
    """Keep the stretches that overlap in range with one in an adjacent azimuth.

    Args:
        runs: Marked stretches.

    Returns:
        Those of them that are not alone.
    """
    marked = runs.mask()
    beside = np.roll(marked, 1, axis=0) | np.roll(marked, -1, axis=0)
    return runs[runs.reduce(np.logical_or, beside).astype(np.bool_)]
