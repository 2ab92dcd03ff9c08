"""Messages of bad command lines: each names the option, what is allowed and what was given."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import pytest
import tyro

from echoscape.cli.arguments import ArgumentsError, in_option_names, parse


@dataclass(frozen=True, kw_only=True)
class Group:
    """A group of options."""

    rain_mm: float = 0.0
    """Rain."""

    def __post_init__(self) -> None:
        if self.rain_mm < 0:
            raise ValueError(f"rain_mm must be 0 or more, got {self.rain_mm:g}")


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options of a command."""

    scans: int = 1
    """A number."""
    method: Literal["first", "second"] = "first"
    """A choice."""
    preview: bool = True
    """A switch."""
    wet_weather: Group = field(default_factory=Group)
    """A group."""


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--scans one", "--scans must be a whole number, got 'one'"),
        ("--scans 1.5", "--scans must be a whole number, got '1.5'"),
        ("--wet-weather.rain-mm much", "--wet-weather.rain-mm must be a number, got 'much'"),
        ("--wet-weather.rain-mm -1", "--wet-weather.rain-mm must be 0 or more, got -1"),
        ("--method third", "--method must be one of first, second, got 'third'"),
        ("--scans", "--scans needs a value"),
        ("--scan 3", "unknown option --scan; did you mean --scans?"),
        (
            "--wet-weather.rain_m=3",
            "unknown option --wet-weather.rain_m; did you mean --wet-weather.rain-mm?",
        ),
        ("--no-previw", "unknown option --no-previw; did you mean --no-preview?"),
        ("--xyzzy 3", "unknown option --xyzzy"),
        ("--rain-mm 3", "unknown option --rain-mm; did you mean --wet-weather.rain-mm?"),
        ("--sensor 3", "unknown option --sensor"),  # no more like --scans than --radar like --trace.draw
        ("OUT", "unknown argument 'OUT'"),
    ],
)
def test_message_names_the_option_and_what_is_allowed(words: str, message: str) -> None:
    with pytest.raises(ArgumentsError) as refused:
        parse(Options, prog="command", words=words.split())
    assert str(refused.value) == message


@dataclass(frozen=True, kw_only=True)
class Required:
    """Options of which three must be given."""

    data: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DATA")]
    """A folder."""
    out: Path
    """Folder to write to."""
    worlds: tuple[str, ...]
    """Worlds.

    With a second paragraph --so."""


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("", "DATA, --out and --worlds are required"),
        ("--out o", "DATA and --worlds are required"),
        ("DATA --worlds a b", "--out is required"),
    ],
)
def test_missing_arguments_are_named(words: str, message: str) -> None:
    with pytest.raises(ArgumentsError) as refused:
        parse(Required, prog="command", words=words.split())
    assert str(refused.value) == message


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        ("wet_weather.rain_mm must be 0 or more", "--wet-weather.rain-mm must be 0 or more"),
        ("scans must be 1 or more, got 0", "--scans must be 1 or more, got 0"),
        ("OUT must be empty or new", "OUT must be empty or new"),
        ("o.toml: scans must be a whole number", "o.toml: scans must be a whole number"),
        ("rain_mm is wet", "rain_mm is wet"),
    ],
)
def test_settings_that_are_options_are_named_as_such(message: str, expected: str) -> None:
    assert in_option_names(Options, message) == expected
