"""The sampled beat signal of a scan, as the converter gives it: integers and what one of them is worth.

Raw data in the sense of an FMCW radar: one real sweep a row, before window, transform and logarithm
(docs/raw_data.md). `sim.receiver.range_fft` turns it into the codes of a scan.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

LARGEST_SAMPLE = 32767
"""Largest magnitude of a sample."""
_INT16 = np.dtype(np.int16)
_FLOAT32 = np.dtype(np.float32)


@dataclass(frozen=True, kw_only=True)
class BeatSignal:
    """The beat signal of some rows of a scan.

    samples (rows, samples) int16; scale (rows,) float32 [sqrt(W)]: what a step of a row's samples is worth.
    A tone of an echo that brings P watts to the antenna has the amplitude sqrt(2 P).
    """

    samples: NDArray[np.int16]
    scale: NDArray[np.float32]

    def __post_init__(self) -> None:
        """Refuse arrays that are no beat signal, naming the array."""
        if self.samples.dtype != _INT16 or self.samples.ndim != 2:
            raise ValueError(f"samples must be (rows, samples) int16, got {_told(self.samples)}")
        if self.scale.dtype != _FLOAT32 or self.scale.shape != self.samples.shape[:1]:
            raise ValueError(f"scale must be ({len(self.samples)},) float32, got {_told(self.scale)}")
        if not (np.isfinite(self.scale) & (self.scale > 0)).all():
            raise ValueError("scale must be finite and above 0 in every row")

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.samples)

    def rows(self, rows: slice) -> "BeatSignal":
        """Return the signal of some rows alone."""
        return BeatSignal(samples=self.samples[rows], scale=self.scale[rows])

    def amplitude(self) -> NDArray[np.float32]:
        """Return the signal (rows, samples) float32 [sqrt(W)]."""
        return self.samples * self.scale[:, None]


def _told(array: NDArray) -> str:
    return f"{array.shape} {array.dtype}"


def joined(parts: Sequence[BeatSignal]) -> BeatSignal:
    """Return the rows of one or more signals as one."""
    return BeatSignal(
        samples=np.concatenate([part.samples for part in parts]),
        scale=np.concatenate([part.scale for part in parts]),
    )


def sampled(signal: NDArray[np.float32], step: NDArray[np.float32]) -> BeatSignal:
    """Return a signal (rows, samples) [sqrt(W)] as integers of a step (rows,) [sqrt(W)] in each row.

    Rows whose samples do not fit 16 bits get the least power of two times their step with which they do.
    """
    peak = np.maximum(signal.max(axis=1), -signal.min(axis=1))
    # Half a step beyond the largest sample would be rounded away from zero.
    _, doublings = np.frexp(peak / (step * np.float32(LARGEST_SAMPLE + 0.5)))
    scale = np.ldexp(step, np.maximum(doublings, 0))
    return BeatSignal(samples=np.rint(signal / scale[:, None]).astype(np.int16), scale=scale)


def finely_sampled(signal: NDArray[np.float32]) -> BeatSignal:
    """Return a signal (rows, samples) [sqrt(W)] as integers that use all of 16 bits in every row.

    The error of rounding has 98 dB less power than a sine as strong as the row's largest sample.
    """
    peak = np.maximum(signal.max(axis=1), -signal.min(axis=1))
    # A silent row has a scale as well, so that no reader divides by 0.
    scale = np.maximum(peak / np.float32(LARGEST_SAMPLE), np.finfo(np.float32).tiny)
    return BeatSignal(samples=np.rint(signal / scale[:, None]).astype(np.int16), scale=scale)
