"""Command-line words to an options dataclass through tyro, whose boxed error messages become one line.

An options class with a field `config` also takes a TOML file of options, see `cli.config_file`.
"""

import io
import os
import re
from collections.abc import Sequence
from contextlib import redirect_stderr
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar, cast
from unittest.mock import patch

import tyro

from echoscape.cli.config_file import ConfigFileError, words_of_config

Options = TypeVar("Options")

_HELP = {"-h", "--help"}
_WIDE = {"COLUMNS": "4000"}
_FRAME = re.compile(r"^[│╭╰─╮╯ ]+|[│╭╰─╮╯ ]+$")
_RULE = re.compile(r"[│╭╰─╮╯ -]*")


class ArgumentsError(ValueError):
    """The command line is not valid; the message is one line that names the argument."""


def with_config_file(kind: type[Any], words: Sequence[str]) -> list[str]:
    """Put the options of the file that `--config` names before the words given by hand, which override them.

    Args:
        kind: The options class; without a field `config` nothing is done.
        words: The words of the command line.

    Returns:
        All words, those of the file first.

    Raises:
        ArgumentsError: `--config` is given twice, the file cannot be read, or one of its keys or values is
            refused; the message names the file and the key.
    """
    given = [word for word in words if word == "--config" or word.startswith("--config=")]
    if len(given) > 1 and "config" in [field.name for field in fields(kind)]:
        raise ArgumentsError(f"--config must be given once, got it {len(given)} times")
    path = option_value("--config", words)
    if not path or _HELP & set(words) or "config" not in [field.name for field in fields(kind)]:
        return list(words)
    try:
        return [*words_of_config(kind, Path(path)), *words]
    except ConfigFileError as error:
        raise ArgumentsError(str(error)) from error


def parse(kind: type[Options], *, prog: str, words: Sequence[str], default: Options | None = None) -> Options:
    """Parse words into an options dataclass; `--help` prints the help and leaves the program.

    Args:
        kind: The options class.
        prog: What the help and messages call the command.
        words: The words of the command line, see `with_config_file`.
        default: Options where the words give none; by default those of the class.

    Returns:
        The options.

    Raises:
        ArgumentsError: An argument is empty, unknown, unreadable or refused by the options.
        SystemExit: The help was asked for.
    """
    if _HELP & set(words):
        try:
            return cast("Options", tyro.cli(kind, prog=prog, args=list(words), default=default))
        except BrokenPipeError as error:  # the reader of the help is gone: not an error of a file
            raise SystemExit(1) from error
    if "" in words:  # would otherwise mean the current folder
        number = list(words).index("")
        after = f" (after {words[number - 1]})" if number else ""
        raise ArgumentsError(f"argument {number + 1}{after} must not be empty, got ''")
    messages = io.StringIO()
    try:
        with redirect_stderr(messages), patch.dict(os.environ, _WIDE):
            return cast("Options", tyro.cli(kind, prog=prog, args=list(words), default=default))
    except SystemExit as leaving:
        if not leaving.code:
            raise
        raise ArgumentsError(_first_sentence(messages.getvalue())) from leaving


def option_value(option: str, words: Sequence[str]) -> str | None:
    """Look up the value of an option before the words are parsed.

    Args:
        option: The option, such as "--radar".
        words: The words of the command line.

    Returns:
        The value of the last `--option VALUE` or `--option=VALUE`, None where there is none.
    """
    value = None
    for word, following in zip(words, [*words, None][1:], strict=True):
        if word == option and following is not None:
            value = following
        elif word.startswith(f"{option}="):
            value = word.partition("=")[2]
    return value


def _first_sentence(box: str) -> str:
    """Return the text between the title of tyro's box and its first rule, as one line.

    A value that a settings class refused is named as on the command line: "sensor.bandwidth_hz must be ...".
    """
    lines = box.splitlines()[1:]
    while lines and _RULE.fullmatch(lines[0]):
        lines.pop(0)
    ends = [number for number, line in enumerate(lines) if _RULE.fullmatch(line)]
    sentence = " ".join(_FRAME.sub("", line) for line in (lines[: ends[0]] if ends else lines))
    sentence = re.sub(
        r"^Error parsing (?:(?:simulation|training)\.)?(\w+(?:\.\w+)*): (\w+ must )", r"\1.\2", sentence
    )
    return sentence.removeprefix("Error parsing ")
