"""The built-in sensors against what was measured on real scans; sensors from files: read, or refused."""

from dataclasses import fields, replace
from pathlib import Path

import pytest

from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.sensor.registry import SENSORS, read_sensor, sensor_from
from echoscape.sim.sensor.sensor import Sensor
from tests.paths import ROOT

DOC = ROOT / "docs" / "sensors.md"


@pytest.mark.parametrize(
    ("name", "columns", "width_bins", "reach_m"),
    [
        ("cts350x", 11 + 3768, 8.3, 162.8),
        ("cir204", 11 + 3360, 8.0, 200.3),
        ("cir304", 11 + 3360, 8.3, 200.3),
        ("cir304_rt", 11 + 6848, 8.7, 300.0),
        ("cts_small", 11 + 512, 8.3, 88.5),
    ],
)
def test_sizes_and_point_spreads_are_as_measured_or_scaled(
    name: str, columns: int, width_bins: float, reach_m: float
) -> None:
    sensor = SENSORS[name]
    assert 11 + sensor.bins == columns
    assert sensor.range_m == pytest.approx(reach_m, abs=0.1)
    # A Hann window is 1.44 cells of c / 2B wide at -3 dB (Harris 1978), the rippled sweep 6 % wider.
    width_m = 1.06 * 1.44 * 299792458 / (2 * sensor.bandwidth_hz)
    assert width_m / sensor.bin_m == pytest.approx(width_bins, abs=0.4)


@pytest.mark.parametrize("sensor", SENSORS.values(), ids=str)
def test_a_sweep_fits_into_its_azimuth(sensor: Sensor) -> None:
    least = 0.0 if sensor.name == "cts_small" else 0.25  # which pauses for a sweep as short as its bandwidth
    assert least * sensor.azimuth_period_s < sensor.sweep_s < sensor.azimuth_period_s


def test_alternating_sweeps_begin_with_a_falling_one() -> None:
    assert SENSORS["cir304_rt"].rising[:4].tolist() == [False, True, False, True]
    assert CTS350X.rising.all()
    assert not replace(CTS350X, chirps="falling").rising.any()


def test_sensors_are_found_by_name_and_others_are_refused() -> None:
    assert sensor_from("cir204") is SENSORS["cir204"]
    with pytest.raises(
        ValueError, match=r"one of cts350x, cir204, cir304, cir304_rt, cts_small.* got 'moon'"
    ):
        sensor_from("moon")


def test_fields_of_a_file_replace_those_of_its_base(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(
        'base = "cir204"\nname = "mine"\nrotation_hz = 2\nwindow = "blackman"\n'
        "leakage_dbm = [[0.1, -90], [0.5, -95.5]]\n"
    )
    expected = replace(
        SENSORS["cir204"],
        name="mine",
        rotation_hz=2.0,
        window="blackman",
        leakage_dbm=((0.1, -90.0), (0.5, -95.5)),
    )
    assert read_sensor(path) == expected
    assert sensor_from(str(path)) == expected


def _described(sensor: Sensor) -> dict[str, str]:
    """Every field of a sensor as TOML."""
    values = {each.name: getattr(sensor, each.name) for each in fields(Sensor)}
    return {
        name: str([list(row) for row in value]) if isinstance(value, tuple) else repr(value).replace("'", '"')
        for name, value in values.items()
    }


def test_full_description_needs_no_base(tmp_path: Path) -> None:
    path = tmp_path / "full.toml"
    path.write_text("\n".join(f"{name} = {value}" for name, value in _described(CTS350X).items()))
    assert read_sensor(path) == CTS350X


def test_description_without_a_base_that_lacks_a_field_is_refused_by_its_name(tmp_path: Path) -> None:
    path = tmp_path / "short.toml"
    described = {name: value for name, value in _described(CTS350X).items() if name != "adc_bits"}
    path.write_text("\n".join(f"{name} = {value}" for name, value in described.items()))
    with pytest.raises(ValueError, match=r"short\.toml: adc_bits is missing"):
        read_sensor(path)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("colour = 1", "colour is not a field"),
        ("bin_m = '0.05'", "bin_m must be a number, got '0.05'"),
        ("bin_m = true", "bin_m must be a number, got True"),
        ("bin_m = nan", "bin_m must be finite"),
        ("bins = 3360.5", "bins must be a whole number, got 3360.5"),
        ("bins = true", "bins must be a whole number"),
        ("bins = 9999", "fft_size must be a power of two of 19998 or more"),
        ("window = 3", "window must be a word"),
        ("window = 'square'", "window must be one of hann, hamming, blackman, boxcar, got 'square'"),
        ("chirps = 'sideways'", "chirps must be one of rising, falling, alternating"),
        ("leakage_dbm = 3", "leakage_dbm must be a list of"),
        ("leakage_dbm = [[1, 2, 3]]", "leakage_dbm must be a list of"),
        ("leakage_dbm = [[1, 'x'], [2, 3]]", "leakage_dbm must be a number, got 'x'"),
        ("leakage_dbm = [[2, 1], [1, 1]]", "leakage_dbm must have increasing"),
        ("bins = ", "not valid TOML"),
    ],
)
def test_invalid_file_is_refused_by_its_name_and_the_field(tmp_path: Path, line: str, message: str) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(f'base = "cir204"\n{line}\n')
    with pytest.raises(ValueError, match=rf"bad\.toml: {message}".replace("[", r"\[")) as found:
        read_sensor(path)
    assert "\n" not in str(found.value)


@pytest.mark.parametrize("base", ['"moon"', "3"])
def test_unknown_base_is_refused(tmp_path: Path, base: str) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(f"base = {base}\n")
    with pytest.raises(ValueError, match=r"bad\.toml: base must be one of cts350x"):
        read_sensor(path)


def test_absent_file_and_binary_file_are_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"nowhere\.toml: cannot be read"):
        read_sensor(tmp_path / "nowhere.toml")
    (tmp_path / "noise.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ValueError, match=r"noise\.toml: not valid TOML"):
        read_sensor(tmp_path / "noise.toml")


def test_page_on_sensors_has_every_field_and_every_number() -> None:
    rows = [line.split("|")[1:-1] for line in DOC.read_text().splitlines() if line.startswith("| `")]
    found = {cells[0].strip().strip("`"): [cell.strip() for cell in cells[1:]] for cells in rows}
    for each in fields(Sensor):
        assert each.name in found
        values = [getattr(sensor, each.name) for sensor in SENSORS.values()]
        if isinstance(values[0], (int, float)):
            assert [float(cell) for cell in found[each.name][2:7]] == values, each.name


def test_example_of_the_page_is_a_sensor(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(DOC.read_text().split("```toml\n")[1].split("```")[0])
    assert read_sensor(path).range_m == pytest.approx(175.4)
