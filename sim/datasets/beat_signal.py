"""The sampled beat signal of a scan, as the converter gives it: integers and the size of their steps.

This is the raw data of an FMCW radar: one real sweep an azimuth, before window, transform and logarithm
(docs/raw_data.md). `sim.receiver.range_fft` turns it into the codes of a scan.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.datasets.array_record import ArrayRecord

LARGEST_SAMPLE = 32767
"""Largest magnitude of a sample."""
_INT16 = np.dtype(np.int16)
_FLOAT32 = np.dtype(np.float32)


@dataclass(frozen=True, kw_only=True, eq=False)
class BeatSignal(ArrayRecord):
    """The beat signal of some azimuths of a scan.

    An echo that delivers P watts at the antenna is a tone of amplitude sqrt(2 P).

    Attributes:
        samples: Samples (azimuths, samples) int16.
        scale: Size of a step of each azimuth's samples (azimuths,) float32 [sqrt(W)].
    """

    samples: NDArray[np.int16]
    scale: NDArray[np.float32]

    def __post_init__(self) -> None:
        """Refuse arrays that are no beat signal, naming the array."""
        if self.samples.dtype != _INT16 or self.samples.ndim != 2:
            raise ValueError(f"samples must be (azimuths, samples) int16, got {_layout(self.samples)}")
        if self.scale.dtype != _FLOAT32 or self.scale.shape != self.samples.shape[:1]:
            raise ValueError(f"scale must be ({len(self.samples)},) float32, got {_layout(self.scale)}")
        if not (np.isfinite(self.scale) & (self.scale > 0)).all():
            raise ValueError("scale must be finite and above 0 at every azimuth")

    def __len__(self) -> int:
        """Return the number of azimuths."""
        return len(self.samples)

    def select(self, azimuths: slice) -> "BeatSignal":
        """Take the signal of some azimuths.

        Args:
            azimuths: Which of them.

        Returns:
            Their signal.
        """
        return BeatSignal(samples=self.samples[azimuths], scale=self.scale[azimuths])

    def amplitude(self) -> NDArray[np.float32]:
        """Convert the samples to amplitudes.

        Returns:
            The signal (azimuths, samples) float32 [sqrt(W)].
        """
        return self.samples * self.scale[:, None]


def _layout(array: NDArray) -> str:
    return f"{array.shape} {array.dtype}"


def joined(parts: Sequence[BeatSignal]) -> BeatSignal:
    """Join the azimuths of several signals.

    Args:
        parts: One or more signals with equally many samples.

    Returns:
        One signal with all azimuths, in their order.
    """
    return BeatSignal(
        samples=np.concatenate([part.samples for part in parts]),
        scale=np.concatenate([part.scale for part in parts]),
    )


def sampled(signal: NDArray[np.float32], step: NDArray[np.float32]) -> BeatSignal:
    """Round a signal to whole steps.

    Args:
        signal: Signal (azimuths, samples) [sqrt(W)].
        step: Size of a step at each azimuth (azimuths,) [sqrt(W)].

    Returns:
        The rounded signal. An azimuth whose samples do not fit 16 bits gets the least power of two times its
        step with which they do.
    """
    peak = np.maximum(signal.max(axis=1), -signal.min(axis=1))
    # Half a step beyond the largest sample would be rounded away from zero.
    _, doublings = np.frexp(peak / (step * np.float32(LARGEST_SAMPLE + 0.5)))
    scale = np.ldexp(step, np.maximum(doublings, 0))
    return BeatSignal(samples=np.rint(signal / scale[:, None]).astype(np.int16), scale=scale)


def finely_sampled(signal: NDArray[np.float32]) -> BeatSignal:
    """Round a signal to the finest steps that 16 bits allow at each azimuth.

    Args:
        signal: Signal (azimuths, samples) [sqrt(W)].

    Returns:
        The rounded signal. Its rounding error has 98 dB less power than a sine as strong as the largest
        sample of the azimuth.
    """
    peak = np.maximum(signal.max(axis=1), -signal.min(axis=1))
    # A silent azimuth has a scale as well, so that no reader divides by 0.
    scale = np.maximum(peak / np.float32(LARGEST_SAMPLE), np.finfo(np.float32).tiny)
    return BeatSignal(samples=np.rint(signal / scale[:, None]).astype(np.int16), scale=scale)
