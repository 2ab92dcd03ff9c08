"""Arguments to settings through tyro, with its boxed complaints turned into one line."""

import io
import os
import re
from collections.abc import Sequence
from contextlib import redirect_stderr
from typing import TypeVar
from unittest.mock import patch

import tyro

Settings = TypeVar("Settings")

_WIDE = {"COLUMNS": "4000"}
_FRAME = re.compile(r"^[│╭╰─╮╯ ]+|[│╭╰─╮╯ ]+$")
_RULE = re.compile(r"[│╭╰─╮╯ -]*")


class ArgumentsError(ValueError):
    """The arguments make no settings; the message is one line that names the argument."""


def parsed(kind: type[Settings], *, prog: str, arguments: Sequence[str]) -> Settings:
    """Return the settings that `arguments` describe; help is printed and leaves the program.

    Raises:
        ArgumentsError: an argument is unknown, unreadable or refused by the settings.
    """
    if {"-h", "--help"} & set(arguments):
        return tyro.cli(kind, prog=prog, args=list(arguments))
    told = io.StringIO()
    try:
        with redirect_stderr(told), patch.dict(os.environ, _WIDE):
            return tyro.cli(kind, prog=prog, args=list(arguments))
    except SystemExit as leaving:
        if not leaving.code:
            raise
        raise ArgumentsError(_first_sentence(told.getvalue())) from leaving


def _first_sentence(box: str) -> str:
    """Return what the box says between its title and its first rule, as one line.

    What settings refuse themselves is named as the command line does: "sensor.bandwidth_hz must be ...".
    """
    lines = box.splitlines()[1:]
    while lines and _RULE.fullmatch(lines[0]):
        lines.pop(0)
    ends = [number for number, line in enumerate(lines) if _RULE.fullmatch(line)]
    sentence = " ".join(_FRAME.sub("", line) for line in (lines[: ends[0]] if ends else lines))
    sentence = re.sub(r"^Error parsing (?:recipe\.)?(\w+(?:\.\w+)*): (\w+ must )", r"\1.\2", sentence)
    return sentence.removeprefix("Error parsing ")
