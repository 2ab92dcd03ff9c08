"""Dataclasses of arrays that compare as a whole: `==` answers True or False instead of an array."""

from dataclasses import fields
from typing import Any

import numpy as np


class ArrayRecord:
    """Base of dataclasses with array fields, which must be made with `eq=False`.

    Records of one class are equal where all their fields are; arrays are equal where shapes and all values
    are, NaN included. Records have no hash, since their arrays may change.
    """

    def __eq__(self, other: object) -> bool:
        """Compare all fields.

        Args:
            other: Any object.

        Returns:
            Whether it is a record of the same class with equal fields; NotImplemented for another class.
        """
        if type(other) is not type(self):
            return NotImplemented
        names = [field.name for field in fields(self)]  # pyright: ignore[reportArgumentType]
        return all(_equal(getattr(self, name), getattr(other, name)) for name in names)

    __hash__ = None  # pyright: ignore[reportAssignmentType]
    __array_ufunc__ = None
    """Comparisons with NumPy's arrays, on either side, go to `__eq__` instead of through each element."""


def _equal(first: Any, second: Any) -> bool:
    if not (isinstance(first, np.ndarray) or isinstance(second, np.ndarray)):
        return bool(first == second)
    if type(first) is not type(second):
        return False
    may_be_nan = first.dtype.kind in "fc" and second.dtype.kind in "fc"
    return np.array_equal(first, second, equal_nan=may_be_nan)
