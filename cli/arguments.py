"""Arguments to settings through tyro, with its boxed complaints turned into one line."""

import io
import os
import re
from collections.abc import Sequence
from contextlib import redirect_stderr
from typing import TypeVar, cast
from unittest.mock import patch

import tyro

Settings = TypeVar("Settings")

_WIDE = {"COLUMNS": "4000"}
_FRAME = re.compile(r"^[│╭╰─╮╯ ]+|[│╭╰─╮╯ ]+$")
_RULE = re.compile(r"[│╭╰─╮╯ -]*")


class ArgumentsError(ValueError):
    """The arguments make no settings; the message is one line that names the argument."""


def parsed(
    kind: type[Settings], *, prog: str, arguments: Sequence[str], default: Settings | None = None
) -> Settings:
    """Return the settings that `arguments` describe; help is printed and leaves the program.

    What is not said is as in `default`, where that is given.

    Raises:
        ArgumentsError: an argument is empty, unknown, unreadable or refused by the settings.
    """
    if {"-h", "--help"} & set(arguments):
        try:
            return cast("Settings", tyro.cli(kind, prog=prog, args=list(arguments), default=default))
        except BrokenPipeError as error:  # nobody reads the help: no fault of a file that commands tell of
            raise SystemExit(1) from error
    if "" in arguments:  # would pass for the present folder
        number = list(arguments).index("")
        after = f" (after {arguments[number - 1]})" if number else ""
        raise ArgumentsError(f"argument {number + 1}{after} must not be empty, got ''")
    told = io.StringIO()
    try:
        with redirect_stderr(told), patch.dict(os.environ, _WIDE):
            return cast("Settings", tyro.cli(kind, prog=prog, args=list(arguments), default=default))
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
    sentence = re.sub(r"^Error parsing (?:simulation\.)?(\w+(?:\.\w+)*): (\w+ must )", r"\1.\2", sentence)
    return sentence.removeprefix("Error parsing ")


def said(option: str, arguments: Sequence[str]) -> str | None:
    """Return the value that `--option VALUE` or `--option=VALUE` has in `arguments`, the last one said."""
    value = None
    for word, following in zip(arguments, [*arguments, None][1:], strict=True):
        if word == option and following is not None:
            value = following
        elif word.startswith(f"{option}="):
            value = word.partition("=")[2]
    return value
