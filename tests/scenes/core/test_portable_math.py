"""Functions that are the same on every processor: values of the C library, for arrays of any shape."""

import math
import re

import numpy as np
import pytest

from echoscape.scenes.core import portable_math
from tests.paths import ROOT

X = np.random.default_rng(1).uniform(-3, 3, (50, 4))


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (
            portable_math.arctan2(X, X[::-1]),
            [math.atan2(*each) for each in zip(X.flat, X[::-1].flat, strict=True)],
        ),
        (portable_math.arctan(X), [math.atan(each) for each in X.flat]),
        (portable_math.arccos(X / 3), [math.acos(each / 3) for each in X.flat]),
        (portable_math.exp(X), [math.exp(each) for each in X.flat]),
        (portable_math.log(X**2), [math.log(each**2) for each in X.flat]),
        (portable_math.tan(X), [math.tan(each) for each in X.flat]),
        (portable_math.sinh(X), [math.sinh(each) for each in X.flat]),
        (portable_math.cosh(X), [math.cosh(each) for each in X.flat]),
        (portable_math.arcsinh(X), [math.asinh(each) for each in X.flat]),
        (portable_math.arctanh(X / 4), [math.atanh(each / 4) for each in X.flat]),
        (portable_math.power(X**2, 0.4), [math.pow(each**2, 0.4) for each in X.flat]),
    ],
)
def test_values_are_those_of_the_c_library(found: np.ndarray, expected: list[float]) -> None:
    assert found.dtype == np.float64
    assert found.shape == X.shape
    np.testing.assert_array_equal(found.ravel(), expected)


def test_worlds_use_no_function_that_differs_between_processors() -> None:
    functions = "arctan2|arctan|arccos|arcsin|exp|log|log10|tan|sinh|cosh|tanh|arcsinh|arccosh|arctanh|power"
    forbidden = re.compile(rf"\bnp\.({functions})\b|scipy.ndimage import .*gaussian_filter")
    sources = [path for path in (ROOT / "scenes").rglob("*.py")]
    assert len(sources) > 50
    used = [
        f"{path.relative_to(ROOT)}: {found[0]}"
        for path in sources
        for found in forbidden.finditer(path.read_text(encoding="utf-8"))
    ]
    assert not used
