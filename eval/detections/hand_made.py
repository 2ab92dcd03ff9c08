"""Hand-made keypoints as detections, each in the cell where its extractor found it."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from echoscape.eval.detections.interface import Detections, ScoredScan, cells_of
from echoscape.eval.methods.keypoints import KeypointExtractor
from echoscape.sim.datasets.polar_scan import PolarScan


class HandMadeKeypoints:
    """The keypoints of an extractor, and its score of every cell."""

    def __init__(self, extractor: KeypointExtractor, *, settings: Mapping[str, Any] | None = None) -> None:
        """Take an extractor.

        Args:
            extractor: Finds the keypoints of a scan.
            settings: What is recorded of its settings.
        """
        self._extractor, self._settings = extractor, dict(settings or {})

    def record(self) -> dict[str, Any]:
        """Return the settings, for the record of a result."""
        return self._settings

    @property
    def name(self) -> str:
        """Name of the method in results."""
        return self._extractor.name

    @property
    def score_name(self) -> str:
        """What the score is, with its unit."""
        return self._extractor.score_name

    @property
    def score_limits(self) -> tuple[float, float]:
        """Lowest and highest score."""
        return self._extractor.score_limits

    def detect(self, scan: PolarScan) -> ScoredScan:
        """Find the keypoints.

        Args:
            scan: A scan.

        Returns:
            The keypoints, and every cell by its score.
        """
        found, scores = self._extractor.extract(scan), self._extractor.scores(scan)
        return ScoredScan(
            detections=Detections(azimuth=found.azimuth, range_m=found.range_m, score=found.score),
            score_map=cells_of(np.ones(scores.shape, np.bool_), scores, scan.bin_m),
        )
