"""Command-line words to an options dataclass through tyro, whose boxed error messages become one line.

An options class with a field `config` also takes a TOML file of options, see `cli.config_file`.
"""

import difflib
import io
import os
import re
from collections.abc import Mapping, Sequence
from contextlib import redirect_stderr
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar, cast
from unittest.mock import patch

import tyro

from echoscape.cli.config_file import ConfigFileError, option_types, words_of_config

Options = TypeVar("Options")

_HELP = {"-h", "--help"}
_WIDE = {"COLUMNS": "4000"}
_FRAME = re.compile(r"^[│╭╰─╮╯ ]+|[│╭╰─╮╯ ]+$")
_RULE = re.compile(r"[│╭╰─╮╯ -]*")
_MISSING = re.compile(r"^[│ ] {5}(\S+)", re.MULTILINE)
"""Names in tyro's box of missing arguments, the help of each indented further."""
_LEAST_SIMILARITY = 0.7
"""Similarity from which an option is suggested in place of an unknown one, by difflib's measure."""
_REFUSED_SETTING = re.compile(r"^([\w.-]+)(?= must )")
_REPHRASED: Mapping[str, str] = {
    r"(--\S+): invalid literal for int\(\) with base 10: (.*)": r"\1 must be a whole number, got \2",
    r"(--\S+): could not convert string to float: (.*)": r"\1 must be a number, got \2",
    r"(--\S+): \w+ must (.*)": r"\1 must \2",
    r"Missing value for argument '(--\S+)'\..*": r"\1 needs a value",
}
"""Sentences of tyro and Python, and what is said instead."""
_CHOICE = re.compile(r"invalid choice (.*) for argument '(--\S+)'\. Expected one of \((.*)\)\.")
_WORD_IN_QUOTES = re.compile(r"'([^']*)'")


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
        raise ArgumentsError(_refusal(kind, messages.getvalue())) from leaving


def in_option_names(kind: type[Any], message: str) -> str:
    """Name a setting that is refused as on the command line.

    Args:
        kind: The options class.
        message: A message, such as "sensor.bandwidth_hz must be above 0, got -1".

    Returns:
        The message, such as "--sensor.bandwidth-hz must be above 0, got -1"; as it was where it begins with
        no option.
    """
    begins = _REFUSED_SETTING.match(message)
    option = "" if begins is None else f"--{begins[0].replace('_', '-')}"
    return f"{option}{message.removeprefix(begins[0])}" if begins and option in _options(kind) else message


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


def _options(kind: type[Any]) -> list[str]:
    """Return all options of a class, such as "--artefacts.ghosts"."""

    def flat(options: Mapping[str, Any], prefix: str) -> list[str]:
        return [
            option
            for name, value in options.items()
            for option in (
                flat(value, f"{prefix}{name}.")
                if isinstance(value, dict)
                else [f"{prefix}{name}", *([f"--no-{name}"] if value is bool and prefix == "--" else [])]
            )
        ]

    has_config = "config" in [field.name for field in fields(kind)]
    return [*flat(option_types(kind), "--"), *(["--config"] if has_config else [])]


def _refusal(kind: type[Any], box: str) -> str:
    """Return what tyro refused, and why, in the words of the other messages."""
    sentence = _first_sentence(box)
    if sentence.startswith("Missing from "):
        *others, last = re.findall(_MISSING, box.partition("For full helptext")[0])
        return f"{', '.join(others)} and {last} are required" if others else f"{last} is required"
    if sentence.startswith("Unrecognized options: "):
        return _unknown(kind, sentence.removeprefix("Unrecognized options: ").split(", "))
    for pattern, phrase in _REPHRASED.items():
        match = re.fullmatch(pattern, sentence)
        if match:
            return match.expand(phrase)
    choice = _CHOICE.fullmatch(sentence)
    if choice:
        given, option, choices = choice.groups()
        return f"{option} must be one of {', '.join(re.findall(_WORD_IN_QUOTES, choices))}, got {given}"
    return in_option_names(kind, sentence)


def _unknown(kind: type[Any], words: Sequence[str]) -> str:
    """Return what is said of words that are no options, with the most similar option."""
    options = [word.partition("=")[0] for word in words if word.startswith("-")]
    if not options:
        return f"unknown argument {words[0]!r}"
    name, known = options[0].replace("_", "-"), _options(kind)
    in_groups = [option for option in known if option.rpartition(".")[2] == name.lstrip("-")]
    similar = in_groups or difflib.get_close_matches(name, known, n=1, cutoff=_LEAST_SIMILARITY)
    return f"unknown option {options[0]}" + (f"; did you mean {similar[0]}?" if similar else "")


def _first_sentence(box: str) -> str:
    """Return the text between the title of tyro's box and its first rule, as one line.

    A setting that a class refused is named with its group: "sensor.bandwidth_hz must be ...".
    """
    lines = box.splitlines()[1:]
    while lines and _RULE.fullmatch(lines[0]):
        lines.pop(0)
    ends = [number for number, line in enumerate(lines) if _RULE.fullmatch(line)]
    sentence = " ".join(_FRAME.sub("", line) for line in (lines[: ends[0]] if ends else lines))
    sentence = re.sub(
        r"^Error parsing (?:(?:simulation|training)\.)?(\w[\w.-]*): (\w+ must )", r"\1.\2", sentence
    )
    return sentence.removeprefix("Error parsing ")
