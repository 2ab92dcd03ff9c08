"""The result of matching a pair of scans: the motion and the matches behind it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.learn.geometry.matches import Matches
from echoscape.learn.geometry.procrustes import Motion
from echoscape.learn.geometry.se2 import to_pose
from echoscape.sim.datasets.se2 import SE2


@dataclass(frozen=True, kw_only=True)
class PairEstimate:
    """The motion T_destination_source of a pair of scans and the matches behind it.

    Attributes:
        motion: Pose of the source in the frame of the destination.
        source_m: Keypoints (N, 2) float32 in the source's own frame: forward, right [m].
        destination_m: Their matches (N, 2) float32 in the destination's own frame [m].
        weights: Weights of the matches (N,) float32.
        certain: Whether the matches determine the motion.
        agreement: Sum of the weights of the matches that the motion explains, in all destinations.
    """

    motion: SE2
    source_m: NDArray[np.float32]
    destination_m: NDArray[np.float32]
    weights: NDArray[np.float32]
    certain: bool
    agreement: float


def pair_estimate(motion: Motion, matches: Matches, *, agreement: float) -> PairEstimate:
    """Convert the first of a batch of motions and its matches to NumPy.

    Args:
        motion: B >= 1 motions, on any device.
        matches: Their matches.
        agreement: Sum of the weights of the matches that the motion explains.

    Returns:
        The first of them.
    """
    return PairEstimate(
        motion=to_pose(motion),
        source_m=matches.source_m[0].cpu().numpy(),
        destination_m=matches.destination_m[0].cpu().numpy(),
        weights=matches.weights[0].cpu().numpy(),
        certain=bool(motion.certain[0]),
        agreement=agreement,
    )
