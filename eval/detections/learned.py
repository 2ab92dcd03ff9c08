"""The keypoints of learned odometry as detections, with the scores of the network.

Source: Barnes & Posner, ICRA 2020, section III. The network sees a Cartesian image that shows every azimuth
as it was measured; a place in it goes back to the azimuth of its direction, not corrected for motion.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from echoscape.eval.detections.interface import Detections, ScoredScan, polar_detections
from echoscape.learn.odometry.keypoint_detector import KeypointDetector
from echoscape.sim.datasets.cartesian import pixel_offsets
from echoscape.sim.datasets.polar_scan import PolarScan


class LearnedKeypoints:
    """Keypoints with scores of at least a floor, and the score of every pixel of the image."""

    name = "learned"
    score_name = "score of the network"
    score_limits = (0.0, 1.0)

    def __init__(
        self,
        detector: KeypointDetector,
        *,
        least_score: float = 0.0,
        weights: Mapping[str, Any] | None = None,
    ) -> None:
        """Take a network.

        Args:
            detector: Computes the keypoints of a scan.
            least_score: Least score of a keypoint that is reported.
            weights: What is recorded of its weights: file, hash and device.
        """
        self._detector, self._least_score = detector, least_score
        self._weights = dict(weights or {})

    def record(self) -> dict[str, Any]:
        """Return the settings and the weights, for the record of a result."""
        return {"least_score": self._least_score, **self._weights}

    def detect(self, scan: PolarScan) -> ScoredScan:
        """Detect keypoints.

        Args:
            scan: A scan.

        Returns:
            The keypoints, and every pixel of the image by its score.
        """
        found = self._detector.detect(scan, score_map=True)
        assert found.score_map is not None
        kept = found.score >= self._least_score
        points_m = np.stack([found.x_m, found.y_m], axis=-1)[kept]
        return ScoredScan(
            detections=polar_detections(points_m, found.score[kept], scan),
            score_map=pixel_detections(found.score_map, found.pixel_m, scan),
        )


def pixel_detections(score: np.ndarray, pixel_m: float, scan: PolarScan) -> Detections:
    """Convert the pixels of a square image to detections.

    Args:
        score: Scores of the pixels (size, size), forward up, the radar in the middle.
        pixel_m: Width of a pixel [m].
        scan: The scan that the image shows.

    Returns:
        All pixels, row by row.
    """
    offset_m = pixel_offsets(len(score), pixel_m=pixel_m, bin_m=1.0)
    points_m = np.stack(np.meshgrid(-offset_m, offset_m, indexing="ij"), axis=-1)
    return polar_detections(points_m.reshape(-1, 2), score.ravel(), scan)
