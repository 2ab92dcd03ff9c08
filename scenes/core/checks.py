"""Checks of settings and arguments.

The error messages name the field, the range allowed and the value given. Non-finite values are always
refused.
"""

import math
from itertools import pairwise
from numbers import Integral, Real
from types import UnionType


def check_between(settings: object, **limits: tuple[float, float]) -> None:
    """Check that fields of settings lie within their limits.

    Args:
        settings: The settings; a field may hold one number or a tuple of numbers.
        **limits: (minimum, maximum) of each field, both inclusive, by field name.

    Raises:
        ValueError: A value is outside its limits.
    """
    for name, (least, most) in limits.items():
        found = getattr(settings, name)
        for value in found if isinstance(found, tuple) else (found,):
            if not least <= value <= most:
                raise ValueError(f"{name} must be between {least:g} and {most:g}, got {value:g}")


def check_whole(*, least: int | None = 0, **values: object) -> None:
    """Check that arguments are whole numbers.

    Args:
        least: Smallest number allowed; None is any.
        **values: The arguments by name.

    Raises:
        ValueError: A value is no whole number, or below `least`.
    """
    for name, value in values.items():
        if isinstance(value, bool) or not isinstance(value, Integral):
            raise ValueError(f"{name} must be a whole number, got {value!r}")
        if least is not None and int(value) < least:
            raise ValueError(f"{name} must be {least} or more, got {value}")


def check_kind(kind: type | UnionType, **values: object) -> None:
    """Check that arguments are of a type.

    Args:
        kind: The type, or a union of types.
        **values: The arguments by name.

    Raises:
        TypeError: A value is of another type.
    """
    for name, value in values.items():
        if not isinstance(value, kind):
            wanted = kind.__name__ if isinstance(kind, type) else str(kind)
            words = " or ".join(each.rpartition(".")[2] for each in wanted.split(" | "))
            raise TypeError(f"{name} must be of type {words}, got {value!r}")


def check_number(**values: object) -> None:
    """Check that arguments are numbers, not bools.

    Args:
        **values: The arguments by name.

    Raises:
        ValueError: A value is no number.
    """
    for name, value in values.items():
        if isinstance(value, bool) or not isinstance(value, Real):
            raise ValueError(f"{name} must be a number, got {value!r}")


def check_ascending(settings: object, *names: str, above_zero: bool = True) -> None:
    """Check that fields with several numbers are finite, positive and in ascending order.

    Args:
        settings: The settings.
        *names: Names of the fields, each a tuple of numbers.
        above_zero: Whether the first number must be above 0; otherwise 0 is allowed.

    Raises:
        ValueError: A field is not finite, is negative (or 0 where it must be above 0), or decreases.
    """
    for name in names:
        found: tuple[float, ...] = getattr(settings, name)
        finite = all(math.isfinite(value) for value in found)
        if not finite or (found[0] <= 0 if above_zero else found[0] < 0):
            raise ValueError(
                f"{name} must be finite and {'above 0' if above_zero else '0 or more'}, got {_joined(found)}"
            )
        if any(high < low for low, high in pairwise(found)):
            raise ValueError(f"{name} must not decrease from low to high, got {_joined(found)}")


def _joined(values: tuple[float, ...]) -> str:
    return " ".join(f"{value:g}" for value in values)
