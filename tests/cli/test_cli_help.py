"""The help of every subcommand: each option has a meaning, and defaults given in words are the code's."""

import re
from fractions import Fraction

import pytest

from echoscape.cli.__main__ import COMMANDS, main
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.settings.artefacts import Artefacts

_LEAST_OPTIONS = {"simulate": 90, "train": 35, "artefacts": 80}
"""Options that help has at least: less means that they were not found in it."""


def _options(
    command: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> dict[str, str]:
    """Return what help says of each option beside its default."""
    monkeypatch.setenv("COLUMNS", "100")  # too narrow for boxes side by side
    with pytest.raises(SystemExit) as left:
        main([command, "--help"])
    assert left.value.code == 0
    found: dict[str, str] = {}
    name, margin = "", 0
    for line in (line.strip("│").rstrip() for line in capsys.readouterr().out.splitlines()):
        indent, text = len(line) - len(line.lstrip()), line.strip()
        if re.match(r"(-h, )?--\w", text):
            flags, _, text = text.partition("  ")
            name, margin = flags.replace("-h, ", "").split(",")[0].split()[0], indent
            assert name not in found
            found[name] = text.strip()
        elif name and indent > margin:  # what is no deeper is the next group's title
            found[name] = f"{found[name]} {text}".strip()
        else:
            name = ""
    return {name: re.sub(r"\((default: .*|required)\)$", "", text).strip() for name, text in found.items()}


@pytest.mark.parametrize("command", COMMANDS)
def test_every_option_says_what_it_means(
    command: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    options = _options(command, monkeypatch, capsys)
    assert "--help" in options
    assert len(options) >= _LEAST_OPTIONS.get(command, 3)
    assert [name for name, meaning in options.items() if not re.search(r"\w", meaning)] == []


def test_help_names_the_default_strengths_of_the_default_sensor(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    options = _options("simulate", monkeypatch, capsys)
    strengths = Artefacts().strengths(CTS350X)
    own = ("phase_noise", "thermal_noise", "quantisation", "doppler")
    assert [name for name, value in vars(Artefacts()).items() if value is None] == list(own)
    for name in own:
        meaning = options[f"--artefacts.{name.replace('_', '-')}"]
        (given,) = re.findall(r"by default the sensor's own, ([\d./]+) .* for the CTS350-X", meaning)
        digits = len(given.split("/")[-1].replace(".", "").lstrip("0"))
        assert float(Fraction(given)) == pytest.approx(
            getattr(strengths, name), rel=0.5 * 10.0 ** (1 - digits)
        )
