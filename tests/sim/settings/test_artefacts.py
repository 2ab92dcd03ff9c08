"""Artefacts: 0 is off, strengths go by their units, and each leaves alone what it does not cause."""

import math
from dataclasses import Field, fields, replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from echoscape.scenes.core.scene import Mover, Scene
from echoscape.sim.datasets.polar_scan import Component, PolarScan
from echoscape.sim.echoes import Echoes, point_echoes
from echoscape.sim.effects.echo_scaling import scaled_echoes, speckle_free_grid, speckled_grid
from echoscape.sim.kinematics.rolling_scan import Revolution, azimuth_poses, sweep_times
from echoscape.sim.receiver.if_signal import beat, echo_grid, spectrum
from echoscape.sim.receiver.phase_noise import phase_noise
from echoscape.sim.receiver.receiver import Received, receive
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.sim.settings.tracing import TraceSettings
from echoscape.sim.simulator import Simulator
from tests.sim.worlds import box_prototype, decibel, mover, plate, quad, straight, world

FLAT = replace(CTS350X, range_gain_db=((0.0, 0.0), (163.0, 0.0)), sweep_ripple_db=())
SMALL = replace(FLAT, azimuths=8)
RECEIVER = ("thermal_noise", "leakage", "phase_noise", "saturation", "quantisation")
SILENT = Artefacts().without(*RECEIVER)
EXPLICIT = Artefacts(
    speckle=1,
    ghosts=1,
    sidelobes=1,
    saturation=1,
    phase_noise=CTS350X.phase_noise_rad,
    thermal_noise=CTS350X.noise_temperature_k,
    leakage=1,
    quantisation=2.0**-11,  # 12 bits over -A to A
    motion_distortion=1,
    attitude=1,
    doppler=0.049,
    movers=1,
    rain=0,
    interference=0,
)


def tones(range_m: list[float], power_w: list[float], sensor=SMALL) -> Echoes:
    """The same echoes at every azimuth."""
    return point_echoes(
        azimuth=np.repeat(np.arange(sensor.azimuths), len(range_m)),
        range_m=np.tile(range_m, sensor.azimuths),
        amplitude=np.sqrt(np.tile(power_w, sensor.azimuths)),
        azimuths=sensor.azimuths,
    )


def received(echoes: Echoes, artefacts: Artefacts, sensor=SMALL, *, keep_beat: bool = False) -> Received:
    rngs = [np.random.default_rng(k) for k in (0, 1)]
    grid = echo_grid(echoes, sensor)
    return receive(grid, sensor, artefacts, noise_rng=rngs[0], phase_rng=rngs[1], keep_beat=keep_beat)


def signal(echoes: Echoes, artefacts: Artefacts, sensor=SMALL) -> NDArray[np.float32]:
    kept = received(echoes, artefacts, sensor, keep_beat=True).beat
    assert kept is not None
    return kept.amplitude()


@cache
def street() -> tuple[Scene, tuple[Mover, ...]]:
    """A road with a wall beside it and eight boxes that drive along it."""
    ground = quad([[-150, -150, 0], [150, -150, 0], [150, 150, 0], [-150, 150, 0]])
    wall = plate([10, 15, 4], [0, -1], 60, 8)
    town = world(("asphalt", "road", ground), ("concrete", "building", wall))
    car = box_prototype("box", (4.0, 1.8, 1.5), "metal")
    return town, tuple(mover(10 + k, car, straight([12.0 + 9 * k, -4.0], [6.0, 0.0])) for k in range(8))


def simulator(**artefacts: float | bool) -> Simulator:
    town, movers = street()
    return Simulator(
        town,
        straight([0.0, 0.0], [10.0, 0.0]),
        movers,
        seed=5,
        settings=TraceSettings(rays=64),
        artefacts=Artefacts(**artefacts),
    )


@cache
def scanned(**artefacts: float | bool) -> PolarScan:
    return simulator(**artefacts).scan(1)


# ---------------------------------------------------------------------- what a strength may be


@pytest.mark.parametrize("name", [each.name for each in fields(Artefacts)])
def test_false_is_nothing_and_what_is_no_strength_is_refused(name: str) -> None:
    off = replace(Artefacts(), **{name: False})
    assert off == Artefacts().without(name) == replace(Artefacts(), **{name: np.False_})
    assert getattr(off, name) == 0.0
    assert getattr(off.strengths(CTS350X), name) == 0.0
    for bad in (-0.1, math.nan, math.inf):
        with pytest.raises(ValueError, match=f"{name} must be .* got {bad}"):
            replace(Artefacts(), **{name: bad})


@pytest.mark.parametrize("each", fields(Artefacts), ids=lambda each: each.name)
def test_what_is_no_number_is_refused_by_name_and_none_is_the_sensors_own(each: Field) -> None:
    for bad in ("a", (1.0,), *([] if each.default is None else [None])):
        with pytest.raises(ValueError, match=f"^{each.name} must be a number or a bool, got "):
            replace(Artefacts(), **{each.name: bad})
    if each.default is None:
        assert replace(Artefacts(), **{each.name: None}) == Artefacts()
    assert replace(Artefacts(), **{each.name: np.float32(0.25)}) == replace(Artefacts(), **{each.name: 0.25})


def test_unknown_artefact_is_not_switched_off() -> None:
    with pytest.raises(ValueError, match=r"an artefact must be one of speckle, .*, got 'foo'"):
        Artefacts().without("ghosts", "foo")


@pytest.mark.parametrize("name", [each.name for each in fields(Artefacts)])
def test_true_is_the_default_where_that_is_something(name: str) -> None:
    if name in ("rain", "interference"):
        with pytest.raises(ValueError, match=f"{name} must be a number"):
            replace(Artefacts(), **{name: True})
    else:
        assert replace(Artefacts(), **{name: True}) == Artefacts()


@pytest.mark.parametrize(
    ("name", "most"),
    [
        ("speckle", 1),
        ("quantisation", 0.5),
        ("motion_distortion", 1),
        ("attitude", 5),
        ("movers", 1),
        ("rain", 150),
    ],
)
def test_strengths_end_where_they_mean_nothing(name: str, most: float) -> None:
    replace(Artefacts(), **{name: most})
    with pytest.raises(ValueError, match=f"{name} must be between 0 and {most}, got"):
        replace(Artefacts(), **{name: 1.01 * most})


def test_defaults_are_the_sensors_own_numbers() -> None:
    default, explicit = Artefacts().strengths(CTS350X), EXPLICIT.strengths(CTS350X)
    assert default == explicit
    given = {each.name: getattr(EXPLICIT, each.name) for each in fields(EXPLICIT)}
    np.testing.assert_array_equal(scanned().codes, scanned(**given).codes)


# ---------------------------------------------------------------------- units


@pytest.mark.parametrize("kelvin", [290.0, 9170.0, 30000.0])
def test_thermal_noise_has_the_power_of_its_temperature(kelvin: float) -> None:
    noise = signal(tones([], [], FLAT), replace(SILENT, thermal_noise=kelvin), FLAT)
    band_hz = FLAT.sample_hz / 2
    # 566 400 draws: the variance is known to 0.2 %.
    assert noise.var() == pytest.approx(1.380649e-23 * kelvin * band_hz, rel=0.01)


def test_own_phase_noise_is_what_is_drawn() -> None:
    drawn = phase_noise(FLAT, azimuths=400, count=2048, rng=np.random.default_rng(3))
    assert drawn.std() == pytest.approx(FLAT.phase_noise_rad, rel=0.01)


def test_skirt_goes_by_the_square_of_the_phase() -> None:
    echoes = tones([100.02], [1e-9])
    clean = signal(echoes, SILENT)
    rest = {rad: signal(echoes, replace(SILENT, phase_noise=rad)) - clean for rad in (0.02, 0.04)}
    ratio = rest[0.04].var() / rest[0.02].var()
    assert ratio == pytest.approx(4.0, rel=0.01)  # the same draws; second order is 1e-3


def test_saturation_lowers_the_clipping_level_by_its_decibels() -> None:
    echoes = tones([100.02], [1e-3])  # far above the compression point: beyond 1.3 the converter clips
    peak = {each: np.abs(signal(echoes, replace(SILENT, saturation=each))).max() for each in (2.0, 4.0, 20.0)}
    for each, found in peak.items():
        assert 20 * math.log10(peak[2.0] / found) == pytest.approx(20 * math.log10(each / 2), abs=0.01)


@pytest.mark.parametrize("step", [2.0**-7, 2.0**-5])
def test_quantisation_error_has_a_twelfth_of_its_step_squared(step: float) -> None:
    unit = 1e-9  # an amplitude of sqrt(2e-9), some hundred steps
    full = math.sqrt(2 * 10 ** (SMALL.full_scale_db / 10) / _units_per_watt())
    echoes = tones([20.0, 51.3, 77.7], [full**2 * unit / 1e-8] * 3)
    error = signal(echoes, replace(SILENT, quantisation=step)) - signal(echoes, SILENT)
    assert error.var() == pytest.approx((full * step) ** 2 / 12, rel=0.1)


def _units_per_watt() -> float:
    """Written power of a watt by hand: noise of k T0 F fs / 2 a sample has the stated mean, by Hann."""
    count = SMALL.samples
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(count) / count)
    noise_w = 1.380649e-23 * 290 * 10 ** (SMALL.noise_figure_db / 10) * SMALL.sample_hz / 2
    return SMALL.noise_units * window.sum() ** 2 / 2 / (noise_w * (window**2).sum())


def test_leakage_goes_by_its_power() -> None:
    power = {each: received(tones([], []), replace(SILENT, leakage=each)).power for each in (1.0, 4.0)}
    near = slice(5, 60)
    np.testing.assert_allclose(power[4.0][:, near], 4 * power[1.0][:, near], rtol=1e-3)


def test_doppler_shift_goes_by_its_factor() -> None:
    by = {beta: simulator(doppler=beta).echoes(1) for beta in (0.0, 0.049, 0.1)}
    still = by[0.0]
    for beta, echoes in by.items():
        np.testing.assert_allclose(echoes.range_m - still.range_m, -beta * still.closing_mps, atol=1e-5)
    assert np.abs(still.closing_mps).max() > 9.0


@pytest.mark.parametrize("name", ["ghosts", "sidelobes"])
def test_echoes_go_by_their_power(name: str) -> None:
    half, whole = (simulator(**{name: each}).echoes(1) for each in (0.5, 1.0))
    concerned = whole.bounces > 1 if name == "ghosts" else whole.sidelobe
    assert 100 < concerned.sum() < len(whole) - 100
    factor = np.where(concerned, 0.5, 1.0)
    np.testing.assert_allclose(half.mean_power, whole.mean_power * factor, rtol=1e-6)
    np.testing.assert_allclose(abs(half.amplitude) ** 2, abs(whole.amplitude) ** 2 * factor, rtol=1e-5)


def test_movers_that_are_there_at_a_share_are_there_at_every_larger_one() -> None:
    there = []
    for share in (0.0, 0.2, 0.4, 0.6, 0.8, 1.0):
        truth = scanned(movers=share).truth
        assert truth is not None
        there.append(set(truth.boxes.instance.tolist()))
    assert there[0] == set()
    assert there[-1] == set(range(10, 18))
    assert len({len(each) for each in there}) > 3
    assert all(fewer <= more for fewer, more in pairwise(there))


def test_half_the_motion_distortion_spreads_the_azimuths_over_half_the_path() -> None:
    revolution = Revolution(start_s=2.0, azimuth_period_s=0.001, azimuths=401)
    track = straight([0.0, 0.0], [10.0, 0.0]).trajectory
    for share in (0.0, 0.25, 0.5, 1.0):
        poses = azimuth_poses(track, revolution, height_m=2.0, distortion=share)
        assert np.ptp(poses.position[:, 0]) == pytest.approx(share * 4.0)
        assert poses.position[200, 0] == pytest.approx(22.0)
        assert poses.azimuth_period_s == pytest.approx(share * 0.001)
        np.testing.assert_allclose(poses.velocity[:, 0], 10.0)
        np.testing.assert_allclose(sweep_times(revolution, share).mean(), revolution.middle_s)


# ---------------------------------------------------------------------- speckle


def rough(echoes: Echoes) -> Echoes:
    returns = replace(echoes.returns, coherent=np.zeros(len(echoes.returns.coherent), np.bool_))
    return replace(echoes, returns=returns)


def test_without_speckle_a_dense_azimuth_has_its_mean_power() -> None:
    rng = np.random.default_rng(0)
    count, power_w = 40_000, 1.0  # 17 echoes a bin
    echoes = rough(
        point_echoes(
            azimuth=np.zeros(count),
            range_m=rng.uniform(20, 120, count),
            amplitude=np.full(count, math.sqrt(power_w / count)),
            azimuths=SMALL.azimuths,
        )
    )
    sensor = replace(SMALL, sweep_ripple_db=CTS350X.sweep_ripple_db)
    profile = (
        np.abs(spectrum(beat(speckle_free_grid(echoes, sensor).astype(np.complex64), sensor), sensor)[0]) ** 2
    )
    inner = profile[int(25 / SMALL.bin_m) : int(115 / SMALL.bin_m)]
    # Per bin: power density x the sum of squares of window and ripple (Parseval), Hann's by hand.
    density = power_w / (100 / SMALL.bin_m)
    turns = 2 * math.pi * (np.arange(SMALL.samples) - SMALL.samples // 2) / SMALL.samples
    hann, ripple = 0.5 + 0.5 * np.cos(turns), np.ones(SMALL.samples)
    for periods, level_db in sensor.sweep_ripple_db:
        ripple += 2 * 10 ** (level_db / 20) * np.cos(periods * turns)
    ripple *= hann.sum() / (hann @ ripple)
    expected = density / 2 * np.sum((hann * ripple) ** 2) * SMALL.fft_size
    assert abs(decibel(inner.mean() / expected)) < 0.1
    # 17 echoes in each of some 4 bins that a point spreads over: fluctuations of 12 %.
    assert decibel(inner).std() < 0.6


def test_coherent_echoes_have_no_speckle_to_lose() -> None:
    echoes = tones([30.0, 70.0], [1e-9, 2e-9])
    np.testing.assert_array_equal(speckled_grid(echoes, SMALL, speckle=0.0), echo_grid(echoes, SMALL))


def test_speckle_is_a_share_of_the_power() -> None:
    echoes = simulator().echoes(1)
    grids = {each: speckled_grid(echoes, CTS350X, speckle=each) for each in (0.0, 0.3, 1.0)}
    mixed = np.sqrt(0.7) * grids[0.0] + np.sqrt(0.3) * grids[1.0]
    assert np.abs(grids[0.3] - mixed).max() < 1e-5 * np.abs(mixed).max()


def test_ground_without_speckle_is_even() -> None:
    """Intensity of a rough road: exponential with speckle, nearly constant along a ring without."""
    town = world(("asphalt", "road", quad([[-90, -90, 0], [90, -90, 0], [90, 90, 0], [-90, 90, 0]])))
    ride = straight([0.0, 0.0], [0.0, 0.0], yaw=0.0)
    echoes = Simulator(town, ride, seed=2, settings=TraceSettings(rays=256, floor_db=-40)).echoes(0)

    def contrast(speckle: float) -> float:
        values = spectrum(beat(speckled_grid(echoes, CTS350X, speckle=speckle), CTS350X), CTS350X)
        power = np.abs(values[:, 240:330]) ** 2  # 10 to 14 m
        return float((power.std(axis=0) / power.mean(axis=0)).mean())

    assert contrast(1.0) > 1.2  # speckle's 1, and the road's texture
    assert contrast(0.0) < 0.5  # what is left: how many rays of the set meet a cell


# ---------------------------------------------------------------------- only what it causes


@pytest.mark.parametrize("name", ["ghosts", "sidelobes", "doppler", "rain"])
def test_echoes_of_others_stay(name: str) -> None:
    traced = simulator().echoes(1)
    strength = 5.0 if name == "rain" else 0.0
    after = scaled_echoes(traced, replace(Artefacts(), **{name: strength}), CTS350X)
    left = {
        "ghosts": traced.bounces == 1,
        "sidelobes": ~traced.sidelobe,
        "doppler": np.full(len(traced), True),
        "rain": np.full(len(traced), True),
    }[name]
    np.testing.assert_array_equal(after.azimuth, traced.azimuth[left])
    np.testing.assert_array_equal(after.source, traced.source[left])
    if name != "rain":
        np.testing.assert_array_equal(after.amplitude, traced.amplitude[left])
    if name != "doppler":
        np.testing.assert_array_equal(after.range_m, traced.range_m[left])


def test_draws_of_noise_stay_whatever_else_is_off() -> None:
    """Beyond the street, where nothing but noise is, every setting writes the same."""
    plain = scanned(phase_noise=False, saturation=False, quantisation=False)
    far = plain.codes[:, 3600:]
    for name in ("speckle", "ghosts", "sidelobes", "leakage", "doppler", "movers"):
        without = scanned(phase_noise=False, saturation=False, quantisation=False, **{name: False})
        differing = np.mean(without.codes[:, 3600:] != far)
        assert differing < 0.01, name  # far sidelobes of the window are below a count
        assert np.any(without.codes != plain.codes), name


def test_ghosts_leave_the_cells_of_other_azimuths_alone() -> None:
    clean = {name: False for name in RECEIVER}
    with_ghosts, without = scanned(**clean), scanned(**clean, ghosts=False)
    assert with_ghosts.truth is not None
    changed_cells = np.abs(with_ghosts.codes.astype(int) - without.codes) > 2
    component = with_ghosts.truth.cells.component
    ghostly = component == Component.GHOST
    assert ghostly[changed_cells].any()
    rows = np.flatnonzero(~ghostly.any(axis=1))
    # Ghosts too faint to name a cell still move some of its power.
    assert changed_cells[rows].mean() < 0.01
