"""Paths from a radar over the surface of a target and back, with what each adds to the phase sum."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vectors = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class SurfacePaths:
    """S paths from the radar over a target and back.

    Attributes:
        first: Points where the paths meet the target first (S, 3) float64 [m].
        last: Points where they meet it last (S, 3) float64 [m]; the same array where both coincide.
        path_m: Whole length (S,) float64 [m].
        amplitude: Share of the sum, dA without antenna gains (S,) complex128 [1].
    """

    first: Vectors
    last: Vectors
    path_m: NDArray[np.float64]
    amplitude: NDArray[np.complex128]

    def take(self, keep: NDArray) -> "SurfacePaths":
        """Return some of the paths.

        Args:
            keep: A mask or an index of them.

        Returns:
            These paths.
        """
        first = self.first[keep]
        return SurfacePaths(
            first=first,
            last=first if self.last is self.first else self.last[keep],
            path_m=self.path_m[keep],
            amplitude=self.amplitude[keep],
        )


def no_paths() -> SurfacePaths:
    """Return the paths over a target that is not seen."""
    points, none = np.zeros((0, 3)), np.zeros(0, np.complex128)
    return SurfacePaths(first=points, last=points, path_m=np.zeros(0), amplitude=none)


def phase_factor(path_m: NDArray, wavelength_m: float) -> NDArray[np.complex128]:
    """Return exp(-j k path).

    Args:
        path_m: Whole lengths of paths (S,) [m].
        wavelength_m: Wavelength [m].

    Returns:
        The factors (S,).
    """
    cycles = path_m / wavelength_m
    return np.exp(-2j * math.pi * (cycles - np.floor(cycles)))
