import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from echoscape.sim.receiver.quantiser import codes, decibels, middle_power, power_width


def law(count: int) -> int:
    """The published law, in exact integers: floor(6 (e + n / 2^e - 1) + 1/2)."""
    if count <= 1:
        return 0
    exponent = count.bit_length() - 1
    twelfths = 12 * (exponent - 1) * 2**exponent + 12 * count + 2**exponent
    return twelfths // (2 * 2**exponent)


def test_never_writes_the_codes_that_no_real_scan_has() -> None:
    written = set(codes(np.arange(1 << 20)).tolist())
    assert set(range(120)) - written == {1, 2, 3, 4, 5, 7, 8, 10, 11, 13, 16}


@given(count=st.integers(0, 1 << 23))
def test_codes_follow_the_law(count: int) -> None:
    assert codes(count) == law(count)


@given(power=st.floats(0, 1e12, allow_nan=False))
def test_codes_grow_with_power_and_stay_below_255(power: float) -> None:
    assert codes(power) <= codes(power * 1.5 + 1) <= 254


@given(count=st.integers(8, 1 << 20))
def test_half_a_code_is_a_decibel_of_the_piecewise_logarithm(count: int) -> None:
    # The chord of log2 lies at most 0.0861 octaves low; an octave counts 3 dB for 3.0103; codes are rounded.
    tolerance = 0.0861 * 3.0103 + 0.0103 * math.log2(count) + 0.25
    assert decibels(codes(count)) == pytest.approx(10 * math.log10(count), abs=tolerance)


@pytest.mark.parametrize("power", [-1.0, math.nan, math.inf])
def test_refuses_what_is_no_power(power: float) -> None:
    with pytest.raises(ValueError, match="power"):
        codes(power)


def test_power_in_the_middle_of_a_code_gives_the_code_again() -> None:
    written = np.unique(codes(np.geomspace(1e-3, 1e13, 200_000)))
    assert written[-1] == 254
    assert_array_equal(codes(middle_power(written)), written)
    strong = written[written > 60].astype(float)  # six codes an octave, bent by 0.26 dB at most
    assert_allclose(10 * np.log10(middle_power(strong)), strong / 6 * 10 * np.log10(2), atol=0.27)


def test_width_of_a_code_is_that_of_the_powers_that_have_it() -> None:
    power = np.linspace(0.0, 200.0, 200 * 1024 + 1)
    code = codes(power)
    for each in np.unique(code)[:-1]:  # the last one goes on beyond
        assert power_width(each) == pytest.approx(np.ptp(power[code == each]), abs=2e-3)
    assert not power_width([1, 2, 3, 4, 5, 7, 8, 10, 11, 13, 16]).any()
