"""Tags as numbers: the units that mappers may write, and None for what is no number."""

import pytest

from echoscape.scenes.io.osm.elements.tag_values import count, length_m, speed_mps


@pytest.mark.parametrize(
    ("text", "metres"),
    [
        ("3.5", 3.5),
        ("3.5 m", 3.5),
        ("3,5", 3.5),
        ("10 ft", 3.048),
        ("6'", 1.8288),
        ("12'6\"", 3.81),
        (" 2 ", 2),
    ],
)
def test_lengths(text: str, metres: float) -> None:
    assert length_m({"height": text}, "height") == pytest.approx(metres, abs=1e-9)


@pytest.mark.parametrize("text", ["", "tall", "3;4", "-2", "~3", "1e3", "nan"])
def test_what_is_no_length_is_not_given(text: str) -> None:
    assert length_m({"height": text}, "height") is None


def test_the_first_key_with_a_length_counts() -> None:
    tags = {"height": "high", "building:height": "7", "est_height": "9"}
    assert length_m(tags, "height", "building:height", "est_height") == 7.0


@pytest.mark.parametrize(("text", "mps"), [("50", 50 / 3.6), ("30 mph", 13.4112), ("36 km/h", 10.0)])
def test_speeds(text: str, mps: float) -> None:
    assert speed_mps({"maxspeed": text}, "maxspeed") == pytest.approx(mps, rel=1e-9)


def test_speeds_without_a_number_are_not_given() -> None:
    assert speed_mps({"maxspeed": "signals"}, "maxspeed") is None


def test_counts() -> None:
    assert count({"lanes": "2"}, "lanes") == 2
    assert count({"building:levels": "1.5"}, "building:levels") == 1.5
    for text in ("", "two", "-1", "nan", "inf", "1e9"):
        assert count({"lanes": text}, "lanes") is None
