"""Matches of keypoints, the motion that fits them, and their distances from a motion.

Source: Barnes & Posner 2020, section III-B and III-C; precisions are ours, see `learn.model.prior_removal`.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from echoscape.learn.geometry.pose_refinement import motion_by_precision, weighed_squares
from echoscape.learn.geometry.procrustes import Motion, motion_of_matches, moved, robust_motion


@dataclass(frozen=True, kw_only=True)
class Matches:
    """Keypoints of B sources and their matches in B destinations.

    Attributes:
        source_m: Keypoints (B, N, 2) in the source's own frame: forward, right [m].
        destination_m: Their matches (B, N, 2) in the destination's own frame [m].
        weights: Weights (B, N).
        surprisal: Where the true motion was given: cross entropy (B, N) [nat] of the matching softmax with
            the samples around each keypoint's true location, 0 for those outside the destination.
        precision: Of local matches, what the destination contributes by direction (B, N, 2, 2); the search
            prior is removed from it and from the locations.
    """

    source_m: Tensor
    destination_m: Tensor
    weights: Tensor
    surprisal: Tensor | None = None
    precision: Tensor | None = None

    def cpu(self) -> "Matches":
        """Return the matches on the CPU."""
        return Matches(
            source_m=self.source_m.cpu(),
            destination_m=self.destination_m.cpu(),
            weights=self.weights.cpu(),
            surprisal=None if self.surprisal is None else self.surprisal.cpu(),
            precision=None if self.precision is None else self.precision.cpu(),
        )

    def motion(self, *, robust_scale_m: float | None = None, near: Motion | None = None) -> Motion:
        """Solve for the motion that fits the matches best.

        Args:
            robust_scale_m: Scale of `robust_motion` [m]; None for least squares of all matches.
            near: Motion to start from, nearly the answer; used where precisions are known.

        Returns:
            The motions T_destination_source.
        """
        points = self.source_m, self.destination_m, self.weights
        if self.precision is not None:
            return motion_by_precision(*points, self.precision, scale_m=robust_scale_m, near=near)
        if robust_scale_m is None:
            return motion_of_matches(*points)
        return robust_motion(*points, scale_m=robust_scale_m)

    def errors_m(self, motion: Motion) -> Tensor:
        """Compute the distances of matches from where a motion takes their keypoints.

        Args:
            motion: The motions T_destination_source.

        Returns:
            Distances (B, N) [m]; with precisions sqrt(r^T P r) of the residual r.
        """
        residual_m = self.destination_m - moved(self.source_m, motion)
        if self.precision is None:
            return torch.linalg.vector_norm(residual_m, dim=-1)
        return weighed_squares(residual_m, self.precision).clamp(min=0).sqrt()
