"""The sensor's quantiser: a piecewise-linear logarithm of the integer power, in half decibels.

    code = 0 if n <= 1 else floor(6 (e + n / 2^e - 1) + 1/2),  e = floor(log2 n)

It reproduces the codes that never occur in scans of four Navtech radars (1-5, 7, 8, 10, 11, 13, 16); code / 2
is dB. 8-bit codes end at 255, which no real scan reaches.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

LARGEST_CODE = 254
_ROUNDED = np.float32(0.74)
"""Added before a power is cut to whole counts. The shares of codes 0, 6, 9, 12, ... in quiet cells of real
scans (60.1, 20.3, 9.9, 4.8 %) are those of an exponential law cut so; with one half code 6 is too rare."""
LEAST_POWER = 2 - float(_ROUNDED)
"""Power below which the code is 0: two counts."""
_BITS_OF_ONE = np.float32(1).view(np.uint32)
_HALF = np.uint32(1 << 22)


def codes(power: ArrayLike) -> NDArray[np.uint8]:
    """Quantise powers.

    Args:
        power: Powers of any shape, 0 or more [units of written power].

    Returns:
        Codes uint8 of the same shape, in half decibels.

    Raises:
        ValueError: A power is negative or not finite.
    """
    counts = np.floor(np.asarray(power, np.float32) + _ROUNDED)
    if not (counts.min(initial=0.0) >= 0 and counts.max(initial=0.0) < np.inf):
        raise ValueError("power must be finite and 0 or more")
    # The bits of a float32 n >= 1, less those of 1.0, are (e + n / 2^e - 1) 2^23: the law in integers.
    steps = np.maximum(counts, 1).view(np.uint32)
    steps = ((steps - _BITS_OF_ONE) * np.uint32(6) + _HALF) >> np.uint32(23)
    return np.minimum(steps, LARGEST_CODE).astype(np.uint8)


def decibels(code: ArrayLike) -> NDArray[np.float32]:
    """Convert codes to levels.

    Args:
        code: Codes of any shape.

    Returns:
        Levels of the same shape, float32 [dB above one unit]; code 0 stands for 0 dB or less.
    """
    return np.asarray(code, np.float32) / np.float32(2)


def middle_power(code: ArrayLike) -> NDArray[np.float32]:
    """Invert the quantiser: the power in the middle of those that give a count with this code.

    Args:
        code: Codes of any shape.

    Returns:
        Powers of the same shape, float32 [units of written power]; `codes` gives each code that occurs again.
    """
    octave, sixths = np.divmod(np.asarray(code, np.uint8), 6)
    counts = np.rint(np.ldexp(1 + sixths.astype(np.float32) / 6, octave.astype(np.int32)))
    return np.where(octave + sixths > 0, counts + (np.float32(0.5) - _ROUNDED), np.float32(LEAST_POWER / 2))


def power_width(code: ArrayLike) -> NDArray[np.float32]:
    """Compute how wide the interval of powers is that are written as a code.

    A code c above 0 begins at the count 2^e (1 + x - e), rounded up, with x = (c - 1/2) / 6 and e = floor(x).

    Args:
        code: Codes of any shape.

    Returns:
        Widths of the same shape, float32 [units of written power]; 0 for codes that never occur.
    """
    edge = np.zeros(258)
    step = (np.arange(1, 258) - 0.5) / 6
    octave = np.floor(step)
    edge[1:] = np.ceil(np.exp2(octave) * (1 + step - octave)) - float(_ROUNDED)
    return np.diff(edge).astype(np.float32)[np.asarray(code, np.uint8)]
