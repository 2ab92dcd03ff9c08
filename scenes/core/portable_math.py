"""Functions whose values do not depend on the vector instructions of the processor.

NumPy computes these differently, in the last bit, with AVX-512 and with AVX2, and a world built from angles
that differ so is another world. The C library computes them one by one, in the same way on every processor
that has fused multiply-add. Sine, cosine, square root, sums and products are the same in NumPy.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray


def _elementwise(function: Callable[..., float], count: int) -> Callable[..., NDArray[np.float64]]:
    """Return a function of `count` arguments, which broadcast, elementwise."""
    each = np.frompyfunc(function, count, 1)

    def apply(*values: ArrayLike) -> NDArray[np.float64]:
        return np.asarray(each(*values), np.float64)

    return apply


arctan2 = _elementwise(math.atan2, 2)
arctan = _elementwise(math.atan, 1)
arccos = _elementwise(math.acos, 1)
exp = _elementwise(math.exp, 1)
log = _elementwise(math.log, 1)
tan = _elementwise(math.tan, 1)
sinh = _elementwise(math.sinh, 1)
cosh = _elementwise(math.cosh, 1)
arcsinh = _elementwise(math.asinh, 1)
arctanh = _elementwise(math.atanh, 1)
power = _elementwise(math.pow, 2)
