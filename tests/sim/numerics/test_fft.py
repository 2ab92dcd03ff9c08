"""Fourier transforms: inverses of each other, Parseval's theorem, and the line of a tone."""

import numpy as np
import pytest

from echoscape.sim.numerics.fft import fft, ifft, irfft, rfft

RNG_SEED = 5
ROUNDING = 2e-6
"""Single precision over some thousand samples."""


def test_real_transform_and_its_inverse_cancel() -> None:
    signal = np.random.default_rng(RNG_SEED).normal(size=(3, 1000)).astype(np.float32)
    spectrum = rfft(signal)
    assert spectrum.dtype == np.complex64
    np.testing.assert_allclose(irfft(spectrum, 1000), signal, atol=ROUNDING * 4)


def test_complex_transform_keeps_energy_and_its_inverse_cancels() -> None:
    rng = np.random.default_rng(RNG_SEED)
    signal = (rng.normal(size=(2, 512)) + 1j * rng.normal(size=(2, 512))).astype(np.complex64)
    spectrum = fft(signal)
    energy = (np.abs(signal) ** 2).sum(axis=1)
    np.testing.assert_allclose((np.abs(spectrum) ** 2).sum(axis=1) / 512, energy, rtol=ROUNDING * 10)
    np.testing.assert_allclose(ifft(spectrum), signal, atol=ROUNDING * 4)


@pytest.mark.parametrize("line", [1, 7, 100])
def test_a_tone_is_one_line(line: int) -> None:
    tone = np.cos(2 * np.pi * line / 256 * np.arange(256))[None].astype(np.float32)
    expected = np.zeros(129)
    expected[line] = 128
    np.testing.assert_allclose(np.abs(rfft(tone))[0], expected, atol=1e-3)


def test_zeros_behind_a_signal_refine_its_spectrum() -> None:
    signal = np.random.default_rng(RNG_SEED).normal(size=(1, 64)).astype(np.float32)
    np.testing.assert_allclose(rfft(signal, 128)[:, ::2], rfft(signal), atol=1e-4)
