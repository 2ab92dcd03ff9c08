"""What keypoints were matched to, and what follows: the motion, and how far matches are from one.

Source: Barnes & Posner 2020, section III-B and III-C; precisions are ours, see `precision`.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from echoscape.learn.geometry.pose_refinement import motion_by_precision, weighed_squares
from echoscape.learn.geometry.procrustes import Motion, motion_of_matches, moved, robust_motion


@dataclass(frozen=True, kw_only=True)
class Matches:
    """Keypoints of B sources and what they were matched to.

    source_m, destination_m: (B, N, 2) forward, right [m], each in its own frame; weights: (B, N); surprisal:
    (B, N), where the true motion was given: cross entropy [nat] of the matching softmax with the samples
    around each keypoint's true place, 0 for those that are outside the destination; precision:
    (B, N, 2, 2), where matches were looked for near where they were expected: how much a destination says by
    direction, see `precision`; the expectation is taken out of it and of the places.
    """

    source_m: Tensor
    destination_m: Tensor
    weights: Tensor
    surprisal: Tensor | None = None
    precision: Tensor | None = None

    def motion(self, *, robust_scale_m: float | None = None, near: Motion | None = None) -> Motion:
        """Return the motion T_destination_source that fits the matches best.

        robust_scale_m: see `pose.robust_motion`; None for least squares of all; near: a motion to begin with
        that is nearly right already, of use where precisions are known.
        """
        points = self.source_m, self.destination_m, self.weights
        if self.precision is not None:
            return motion_by_precision(*points, self.precision, scale_m=robust_scale_m, near=near)
        if robust_scale_m is None:
            return motion_of_matches(*points)
        return robust_motion(*points, scale_m=robust_scale_m)

    def errors_m(self, motion: Motion) -> Tensor:
        """Return (B, N) [m]: how far destinations are from where a motion takes their sources.

        Where precisions are known a distance counts by them, sqrt(r^T P r).
        """
        off_m = self.destination_m - moved(self.source_m, motion)
        if self.precision is None:
            return torch.linalg.vector_norm(off_m, dim=-1)
        return weighed_squares(off_m, self.precision).clamp(min=0).sqrt()
