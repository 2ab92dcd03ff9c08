"""What numbers of settings may be: refusals that name the field, what is allowed and what came.

The limits stand beside the fields; whatever is not finite lies beyond them all.
"""

import math
from itertools import pairwise


def check_between(settings: object, **limits: tuple[float, float]) -> None:
    """Refuse settings of which a field, a number or several, is beyond its (least, most).

    Raises:
        ValueError: the first field that is; the message names it.
    """
    for name, (least, most) in limits.items():
        found = getattr(settings, name)
        for value in found if isinstance(found, tuple) else (found,):
            if not least <= value <= most:
                raise ValueError(f"{name} must be between {least:g} and {most:g}, got {value:g}")


def check_rising(settings: object, *names: str, above_zero: bool = True) -> None:
    """Refuse settings of which a field with several numbers, from low to high, falls or has a 0.

    Raises:
        ValueError: the first field that does; the message names it.
    """
    for name in names:
        found: tuple[float, ...] = getattr(settings, name)
        finite = all(math.isfinite(value) for value in found)
        if not finite or (found[0] <= 0 if above_zero else found[0] < 0):
            raise ValueError(
                f"{name} must be finite and {'above 0' if above_zero else '0 or more'}, got {_said(found)}"
            )
        if any(high < low for low, high in pairwise(found)):
            raise ValueError(f"{name} must not fall from low to high, got {_said(found)}")


def _said(values: tuple[float, ...]) -> str:
    return " ".join(f"{value:g}" for value in values)
