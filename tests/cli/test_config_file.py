"""Options from a TOML file: the same as by hand, which win; unknown keys and wrong types are refused."""

import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import pytest
import tyro
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from echoscape.cli import odometry, simulate, train
from echoscape.cli.__main__ import main
from echoscape.cli.arguments import ArgumentsError, parse, with_config_file
from echoscape.cli.config_file import option_types
from echoscape.sim.generation.config import SimulationConfig


@dataclass(frozen=True, kw_only=True)
class Inner:
    """A group of dotted options."""

    rain_mm: float = 0.0
    """A number."""
    speeds: tuple[float, float] = (1.0, 2.0)
    """Two numbers."""
    table: tuple[tuple[float, float], ...] = ()
    """Pairs of numbers."""
    own: float | None = None
    """A number or nothing."""


@dataclass(frozen=True, kw_only=True)
class Merged:
    """Options at the top level."""

    scans: int = 40
    """A whole number."""
    inner_group: Inner = field(default_factory=Inner)
    """The group."""


@dataclass(frozen=True, kw_only=True)
class Options:
    """One option of each type."""

    out: Annotated[Path, tyro.conf.Positional] = Path("out")
    """Not an option."""
    merged: Annotated[Merged, tyro.conf.arg(name="")] = field(default_factory=Merged)
    """More options."""
    folders: tuple[Path, ...] = ()
    """Paths."""
    weights: Path | None = None
    """A path."""
    radar: str = "cts350x"
    """A text."""
    solver: Literal["keyframe", "paper"] = "keyframe"
    """A choice."""
    stride: Literal[1, 2] = 2
    """A choice of numbers."""
    resume: bool = False
    """A switch."""
    origin: Annotated[Path | None, tyro.conf.arg(name="from")] = None
    """An option of another name than its field."""
    config: Path | None = None
    """The file."""


def parsed(*words: str) -> Options:
    return parse(Options, prog="test", words=with_config_file(Options, words))


numbers = st.floats(-1e9, 1e9)
texts = st.text("abcxyz_ äß.-=", min_size=1).filter(lambda text: not text.startswith("-"))
contents = st.fixed_dictionaries(
    {},
    optional={
        "scans": st.integers(-(10**12), 10**12),
        "folders": st.lists(texts, min_size=1, max_size=3),
        "weights": texts,
        "radar": texts,
        "solver": st.sampled_from(["keyframe", "paper"]),
        "stride": st.sampled_from([1, 2]),
        "resume": st.booleans(),
        "from": texts,
        "inner_group": st.fixed_dictionaries(
            {},
            optional={
                "rain_mm": numbers | st.integers(-9, 9),
                "speeds": st.lists(numbers, min_size=2, max_size=2),
                "table": st.lists(st.lists(numbers, min_size=2, max_size=2), min_size=1, max_size=3),
                "own": numbers,
            },
        ),
    },
)


def toml(content: dict[str, Any], hyphens: bool) -> str:
    """The content as TOML; JSON's texts, numbers and arrays are those of TOML."""
    groups = {name: value for name, value in content.items() if isinstance(value, dict)}
    lines = [f"{_key(name, hyphens)} = {json.dumps(content[name])}" for name in content if name not in groups]
    for name, group in groups.items():
        lines += [f"[{_key(name, hyphens)}]"]
        lines += [f"{_key(inner, hyphens)} = {json.dumps(value)}" for inner, value in group.items()]
    return "\n".join(lines)


def by_hand(content: dict[str, Any], prefix: str = "") -> list[str]:
    """The content as a user types it."""
    words: list[str] = []
    for name, value in content.items():
        option = f"--{prefix}{name.replace('_', '-')}"
        if isinstance(value, dict):
            words += by_hand(value, f"{option.removeprefix('--')}.")
        elif isinstance(value, bool):
            words.append(option if value else option.replace("--", "--no-"))
        elif isinstance(value, list):
            flat = [each for item in value for each in (item if isinstance(item, list) else [item])]
            words += [option, *map(str, flat)]
        else:
            words += [f"{option}={value}"]
    return words


def _key(name: str, hyphens: bool) -> str:
    return name.replace("_", "-") if hyphens else name


@given(content=contents, hyphens=st.booleans())
@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_file_gives_what_the_same_options_by_hand_give(
    tmp_path: Path, content: dict[str, Any], hyphens: bool
) -> None:
    path = tmp_path / "options.toml"
    path.write_text(toml(content, hyphens), encoding="utf-8")
    from_file, typed = parsed("--config", str(path)), parsed(*by_hand(content))
    assert vars(from_file) | {"config": None} == vars(typed)


@given(first=contents, second=contents)
@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_options_by_hand_win_over_the_file(
    tmp_path: Path, first: dict[str, Any], second: dict[str, Any]
) -> None:
    path = tmp_path / "options.toml"
    path.write_text(toml(first, True), encoding="utf-8")
    typed = parsed(*by_hand(first), *by_hand(second))
    for words in ([f"--config={path}", *by_hand(second)], [*by_hand(second), "--config", str(path)]):
        assert vars(parsed(*words)) | {"config": None} == vars(typed)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            "sacns = 4",
            "o.toml: unknown key 'sacns'; did you mean scans? allowed: scans, inner-group, folders",
        ),
        ("[inner-group]\nrain = 1", "o.toml: inner-group: unknown key 'rain'"),
        ('out = "x"', "unknown key 'out'"),
        ('config = "x"', "unknown key 'config'"),
        ("inner-group = 3", "inner-group must be a table"),
        ("scans = 4.0", "o.toml: scans must be a whole number, got 4.0"),
        ('scans = "4"', "scans must be a whole number, got '4'"),
        ("scans = true", "scans must be a whole number, got True"),
        ("scans = [4]", "scans must be a whole number, got [4]"),
        ("[inner_group]\nrain_mm = true", "o.toml: inner-group: rain-mm must be a number, got True"),
        ("inner_group.own = 'x'", "inner-group: own must be a number, got 'x'"),
        ("inner_group.speeds = [1]", "inner-group: speeds must be an array of 2, got [1]"),
        ("inner_group.speeds = 1", "inner-group: speeds must be an array, got 1"),
        ("inner_group.table = [[1, 2], 3]", "inner-group: table must be an array, got 3"),
        ("resume = 1", "resume must be true or false, got 1"),
        ("radar = 5", "radar must be a non-empty string, got 5"),
        ("radar = ''", "radar must be a non-empty string, got ''"),
        ("weights = 5", "weights must be a path, got 5"),
        ("solver = 'magic'", "solver must be one of keyframe, paper, got 'magic'"),
        ("stride = true", "stride must be one of 1, 2, got True"),
        ("folders = ['--resume']", "folders must not hold a text that begins with --, got '--resume'"),
        ("inner-group.own = 1\n[inner_group]\nrain_mm = 2", "inner-group is given twice"),
        ("scans = ", "o.toml: not valid TOML"),
    ],
)
def test_what_is_not_an_option_of_its_type_is_refused_by_name(
    tmp_path: Path, content: str, message: str
) -> None:
    path = tmp_path / "o.toml"
    path.write_text(content)
    with pytest.raises(ArgumentsError) as refused:
        parsed("--config", str(path))
    assert message in str(refused.value)


def test_a_file_that_is_absent_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(ArgumentsError, match=r"none\.toml: cannot be read"):
        parsed("--config", str(tmp_path / "none.toml"))


@pytest.mark.parametrize("words", ["--config A --config B", "--config=A --config B", "--config A --config=A"])
@pytest.mark.parametrize(
    "command", ["simulate OUT", "odometry DATA --out OUT", "train --data DATA --out OUT"]
)
def test_a_second_file_is_refused(words: str, command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*command.split(), *words.split()]) == 2
    name = command.split()[0]
    assert capsys.readouterr().err == f"echoscape {name}: --config must be given once, got it 2 times\n"


def test_help_needs_no_file(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        parsed("--config", "none.toml", "--help")
    assert "--inner-group.rain-mm" in capsys.readouterr().out


@pytest.mark.parametrize("command", [simulate, train, odometry])
def test_every_option_of_the_commands_can_stand_in_a_file(command: Any) -> None:
    """Each type is one that a file's values are checked against."""
    names = {
        simulate: {"randomize", "from", "layout", "artefacts", "sensor", "backend"},
        train: {"data", "out", "init-weights", "lr-half-life", "augmentation", "device"},
        odometry: {"out", "solver", "loop-pairs", "threads", "device"},
    }
    types = option_types(command.Options)
    assert names[command] <= set(types)
    assert not {"config", "scene-file", "randomized"} & set(types)


def test_simulate_takes_its_options_from_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[SimulationConfig] = []
    monkeypatch.setattr(simulate, "_simulate", lambda options, config: made.append(config) or 0)
    path = tmp_path / "run.toml"
    path.write_text(
        'preset = "suburb"\nseed = 3\nscans = 5\nradar = "cir304"\nlayout = "oxford"\nkeep_beat = true\n'
        "[artefacts]\nghosts = 0.5\nphase-noise = 0.1\n"
        "[sensor]\nadc_bits = 9\nleakage-dbm = [[1.0, -50.0], [2.5, -60]]\n"
        "[drive.speed]\ntown-cruise-mps = [5, 6, 7.5]\n"
    )
    words = ["simulate", str(tmp_path / "set"), "--config", str(path)]
    typed = (
        "--preset suburb --seed 3 --scans 5 --radar cir304 --layout oxford --keep-beat "
        "--artefacts.ghosts 0.5 --artefacts.phase-noise 0.1 "
        "--sensor.adc-bits 9 --sensor.leakage-dbm 1 -50 2.5 -60 "
        "--drive.speed.town-cruise-mps 5 6 7.5"
    )
    assert main(words) == 0
    assert main(["simulate", str(tmp_path / "set"), *typed.split()]) == 0
    assert main([*words, "--scans", "6", "--artefacts.ghosts=1", "--no-keep-beat"]) == 0
    assert made[0] == made[1]
    assert made[0].sensor.name == "cir304"
    assert (made[2].scans, made[2].artefacts.ghosts, made[2].keep_beat) == (6, 1.0, False)
    assert math.isclose(made[2].artefacts.phase_noise or 0.0, 0.1)


@pytest.mark.parametrize(
    "command", ["simulate OUT", "odometry DATA --out OUT", "train --data DATA --out OUT"]
)
def test_a_wrong_key_is_refused_in_one_line(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "run.toml"
    path.write_text("sead = 3\n")
    assert main([*command.split(), "--config", str(path)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"echoscape {command.split()[0]}: run.toml: unknown key 'sead'; ")
