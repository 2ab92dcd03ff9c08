"""Data association of keypoints: the most alike by descriptor, of these the set whose distances agree.

Source: Cen & Newman, ICRA 2018 and ICRA 2019, who match each keypoint by its descriptor and keep a set of
matches of high mutual compatibility; the set is found by the spectral method of Leordeanu & Hebert, "A
Spectral Technique for Correspondence Problems Using Pairwise Constraints", ICCV 2005.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

_POWER_ITERATIONS = 50
"""Iterations for the principal eigenvector, of which only the order of the elements is used."""


def most_alike(earlier: NDArray[np.floating], later: NDArray[np.floating]) -> NDArray[np.int64]:
    """Match keypoints by their descriptors.

    Args:
        earlier: Descriptors (N, D) of unit length.
        later: Descriptors (M, D) of unit length, M of 1 or more.

    Returns:
        For each earlier keypoint the later one with the largest inner product (N,).
    """
    return np.argmax(earlier @ later.T, axis=1)


def compatibility(
    earlier_m: NDArray[np.floating], later_m: NDArray[np.floating], tolerance_m: float
) -> NDArray[np.float64]:
    """Compute how well pairs of matches agree: a rigid motion keeps the distance of two points.

    Args:
        earlier_m: Earlier points of the matches (K, 2) [m].
        later_m: Later points (K, 2) [m].
        tolerance_m: Difference of the two distances from which on matches do not agree [m].

    Returns:
        1 - (difference / tolerance)^2, 0 or more (K, K); 0 on the diagonal.
    """
    difference = cdist(earlier_m, earlier_m) - cdist(later_m, later_m)
    agreement = np.maximum(1 - (difference / tolerance_m) ** 2, 0.0)
    np.fill_diagonal(agreement, 0.0)
    return agreement


def compatible_set(agreement: NDArray[np.float64], target: NDArray[np.int64]) -> NDArray[np.int64]:
    """Select matches that agree with each other, each target once.

    Matches are taken in the order of the principal eigenvector v of the compatibility W, while that raises
    x' W x / x' x, of which v is the maximiser over real x and the selection x is one of zeros and ones.

    Args:
        agreement: W, symmetric, 0 or more (K, K).
        target: What each match leads to (K,): of matches to the same target the first is taken.

    Returns:
        Numbers of the selected matches, in the order in which they were taken; none where nothing agrees.
    """
    if not agreement.any():
        return np.zeros(0, np.int64)
    order = np.argsort(-principal_eigenvector(agreement), kind="stable")
    _, first = np.unique(target[order], return_index=True)
    order = order[np.sort(first)]
    with_earlier = np.tril(agreement[np.ix_(order, order)], -1).sum(axis=1)
    reward = np.cumsum(2 * with_earlier) / np.arange(1, len(order) + 1)
    return order[: int(np.argmax(reward)) + 1]


def principal_eigenvector(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Approximate the eigenvector of the largest eigenvalue by power iteration.

    Args:
        matrix: Symmetric, 0 or more, not 0 throughout (K, K).

    Returns:
        The vector (K,) of unit length, 0 or more.
    """
    vector = np.full(len(matrix), 1 / np.sqrt(len(matrix)))
    for _ in range(_POWER_ITERATIONS):
        vector = matrix @ vector + vector  # the shift damps the negative eigenvalues of bipartite graphs
        vector /= np.linalg.norm(vector)
    return vector
