"""The k strongest cells of every azimuth above a floor.

Source: Adolfsson et al., "Lidar-level localization with radar? The CFEAR approach", IEEE T-RO 39(2), 2023: 40
cells with codes of 60 or more.
"""

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from echoscape.eval.detections.interface import ScoredScan, cells_of
from echoscape.sim.datasets.polar_scan import PolarScan


@dataclass(frozen=True, kw_only=True)
class KStrongestSettings:
    """How many cells are kept, and from which level on."""

    k: int = 40
    """Cells of an azimuth that are kept at most."""
    floor_db: float = 30.0
    """Least level of a cell: half its code [dB]."""
    near_m: float = 3.0
    """Range below which no cell is kept [m]: leakage and the car itself are there."""

    def __post_init__(self) -> None:
        if self.k < 1:
            raise ValueError(f"k must be 1 or more, got {self.k}")
        for name in ("floor_db", "near_m"):
            if not 0 <= getattr(self, name) < math.inf:
                raise ValueError(f"{name} must be finite and 0 or more, got {getattr(self, name)}")


class KStrongest:
    """The k strongest cells of every azimuth; of equally strong ones the nearest."""

    name = "kstrongest"
    score_name = "code [half dB]"
    score_limits = (0.0, 256.0)

    def __init__(self, settings: KStrongestSettings) -> None:
        """Take the settings.

        Args:
            settings: Number and floor.
        """
        self.settings = settings

    def record(self) -> dict[str, Any]:
        """Return the settings, for the record of a result."""
        return asdict(self.settings)

    def detect(self, scan: PolarScan) -> ScoredScan:
        """Select the strongest cells.

        Args:
            scan: A scan.

        Returns:
            The detections, and every cell by its code.
        """
        azimuths, bins = scan.codes.shape
        centres_m = (np.arange(bins) + 0.5) * scan.bin_m
        level = np.where(centres_m >= self.settings.near_m, scan.codes.astype(np.int64), -1)
        rank = level * bins + np.arange(bins)[::-1]  # no two alike: of equal codes the nearer one is first
        k = min(self.settings.k, bins)
        strongest = np.argpartition(rank, bins - k, axis=1)[:, bins - k :]
        kept = np.zeros((azimuths, bins), np.bool_)
        np.put_along_axis(kept, strongest, True, axis=1)
        kept &= level >= 2 * self.settings.floor_db
        everywhere = np.ones_like(kept)
        return ScoredScan(
            detections=cells_of(kept, scan.codes, scan.bin_m),
            score_map=cells_of(everywhere, scan.codes, scan.bin_m),
        )
