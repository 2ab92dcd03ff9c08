"""Domain randomisation: drawn by the seed, within what is stated, valid, recorded, and resumed."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from echoscape.cli.__main__ import main
from echoscape.sim.generation import domain_randomization as variation
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.domain_randomization import randomized
from echoscape.sim.sensor.registry import SENSORS
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.sim.settings.surfaces import SurfaceSettings

SEEDS = range(200)


def within(value: float, limits: tuple[float, float]) -> bool:
    return limits[0] - 1e-9 <= value <= limits[1] + 1e-9


def width_deg(pattern: tuple[tuple[float, float], ...], level_db: float) -> float:
    """Where the upper side of a pattern falls to a level."""
    angle, level = np.array([row for row in pattern if row[0] >= 0]).T
    return float(np.interp(-level_db, -level, angle))


def test_same_seed_same_draw() -> None:
    assert randomized(SimulationConfig(seed=3)) == randomized(SimulationConfig(seed=3))
    assert randomized(SimulationConfig(seed=3)).sensor != randomized(SimulationConfig(seed=4)).sensor
    assert randomized(SimulationConfig(seed=3, scans=7)).sensor == randomized(SimulationConfig(seed=3)).sensor


def test_second_time_is_refused() -> None:
    with pytest.raises(ValueError, match="randomized must be False"):
        randomized(randomized(SimulationConfig(seed=3)))


@pytest.mark.parametrize("name", SENSORS)
def test_draws_stay_within_their_ranges(name: str) -> None:
    old = SENSORS[name]
    losses = []
    for seed in SEEDS:
        made = randomized(SimulationConfig(seed=seed, sensor=old))  # a sensor that is none is refused here
        new, surfaces, artefacts = made.sensor, made.surfaces, made.artefacts
        noise_db = new.noise_figure_db - old.noise_figure_db
        losses.append(new.system_loss_db - old.system_loss_db)
        assert within(losses[-1], variation.LOSS_DB)
        assert within(noise_db, variation.NOISE_DB)
        assert 10 * math.log10(new.noise_units / old.noise_units) == pytest.approx(noise_db)
        assert within(new.bandwidth_hz / old.bandwidth_hz, variation.BANDWIDTH)
        assert within(new.full_scale_db - old.full_scale_db, variation.CLIPPING_DB)
        assert within(new.phase_noise_dbc_hz - old.phase_noise_dbc_hz, variation.PHASE_NOISE_DB)
        assert within(new.mount_height_m - old.mount_height_m, variation.HEIGHT_M)
        assert within(new.mount_tilt_deg - old.mount_tilt_deg, variation.TILT_DEG)
        assert within(
            width_deg(new.azimuth_pattern_db, -3) / width_deg(old.azimuth_pattern_db, -3), variation.BEAM
        )
        elevation = width_deg(new.elevation_pattern_db, -6) / width_deg(old.elevation_pattern_db, -6)
        assert within(elevation, variation.ELEVATION)
        assert new.range_gain_db[0][1] <= 0.3 * old.range_gain_db[0][1]  # below or at 0
        assert within(surfaces.rms_height, variation.ROUGHNESS)
        assert within(surfaces.rms_slope, variation.ROUGHNESS)
        assert within(surfaces.scattering, variation.SCATTERING)
        for strength, limits in (
            (artefacts.leakage, variation.LEAKAGE_DB),
            (artefacts.ghosts, variation.GHOSTS_DB),
            (artefacts.sidelobes, variation.SIDELOBES_DB),
        ):
            assert within(10 * math.log10(strength), limits)
    # Evenly drawn: the ends are nearly reached.
    low, high = variation.LOSS_DB
    assert min(losses) < low + 0.05 * (high - low)
    assert max(losses) > high - 0.05 * (high - low)


def test_something_stands_on_some_roofs() -> None:
    blocked = [randomized(SimulationConfig(seed=seed)).sensor for seed in SEEDS]
    losses = [each.azimuth_loss_db for each in blocked if each.azimuth_loss_db.any()]
    # 200 draws: 0.4 to three standard errors of 0.035.
    assert len(losses) / len(blocked) == pytest.approx(variation.BLOCKED_CHANCE, abs=0.11)
    for loss in losses:
        assert within(loss.max(), (0.0, variation.BLOCKED_LOSS_DB[1]))
        assert 1 <= np.count_nonzero(loss) * 0.9 <= 1.2 * variation.BLOCKED_WIDTH_DEG[1] + 0.9
        assert not loss[:30].any()  # ahead the view is free


def test_what_stood_on_the_roof_before_stays() -> None:
    mast = ((0.0, 0.0), (179.0, 0.0), (179.5, 30.0), (180.5, 30.0), (181.0, 0.0), (360.0, 0.0))
    for seed in range(40):
        sensor = randomized(
            SimulationConfig(seed=seed, sensor=replace(SENSORS["cts350x"], blocking_db=mast))
        ).sensor
        assert sensor.azimuth_loss_db[np.abs(sensor.azimuth_rad - np.pi).argmin()] >= 30.0
        assert sensor.azimuth_loss_db[:60].max() == 0.0


def test_what_is_off_stays_off_and_the_rest_as_given() -> None:
    given = Artefacts(rain=3.0, leakage=False, thermal_noise=500.0).without("ghosts", "sidelobes")
    made = randomized(SimulationConfig(seed=5, artefacts=given)).artefacts
    assert made == given


def test_rough_settings_stay_settings() -> None:
    rough = SurfaceSettings(rms_height=9.5, rms_slope=9.5, scattering=9.5)
    for seed in range(20):
        randomized(SimulationConfig(seed=seed, surfaces=rough))


def run(out: Path, *more: str) -> int:
    words = ["--preset", "empty", "--seed", "3", "--scans", "2", "--trace.rays", "16", "--no-preview"]
    return main(["simulate", str(out), *words, *more])


def test_command_records_what_was_drawn_and_resumes(tmp_path: Path) -> None:
    whole, stopped = tmp_path / "whole", tmp_path / "stopped"
    assert run(whole, "--randomize") == 0
    config = json.loads((whole / "echoscape.json").read_text())["config"]
    drawn = randomized(SimulationConfig(preset="empty", seed=3))
    assert config["randomized"] is True
    assert (
        config["sensor"]["system_loss_db"] == drawn.sensor.system_loss_db != SENSORS["cts350x"].system_loss_db
    )
    assert config["artefacts"]["leakage"] == drawn.artefacts.leakage
    assert config["surfaces"]["rms_height"] == drawn.surfaces.rms_height
    assert run(stopped, "--randomize") == 0
    last = sorted((stopped / "radar").iterdir())[-1]
    for path in (last, *stopped.glob(f"truth/{last.stem}.npz")):
        path.unlink()
    assert run(stopped) == 2  # without --resume the folder must be empty
    assert run(stopped, "--resume") == 2  # without --randomize it is another dataset
    assert run(stopped, "--resume", "--randomize") == 0
    for path in (each for each in whole.rglob("*") if each.is_file()):
        assert (stopped / path.relative_to(whole)).read_bytes() == path.read_bytes(), path.name


def test_sensor_refuses_what_amplifies() -> None:
    with pytest.raises(ValueError, match="blocking_db must be losses of 0 or more"):
        replace(SENSORS["cts350x"], blocking_db=((0.0, 0.0), (360.0, -3.0)))
