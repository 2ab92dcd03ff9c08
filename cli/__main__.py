"""The `echoscape` command: finds the subcommand and imports that one only, so that help comes at once."""

import os
import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.metadata import version

_UNREAD = 128 + 13
"""What shells say of a command that SIGPIPE ended."""

COMMANDS = {
    "simulate": "make a dataset: a town, a drive through it, its radar scans and their truth",
    "scene": "build a world without any radar: its plan, its numbers, a model for viewers",
    "view": "write a page to step through a data set in a browser, small enough to mail",
    "fidelity": "judge a folder of scans by the statistics of real ones: table, JSON, plots",
    "artefacts": "show which effect does what to one scan: a picture each, without it and with it",
    "train": "learn keypoint odometry from folders of scans that tell poses",
    "odometry": "estimate the motion between the scans of a folder, and judge it where truth is known",
    "drift": "judge one trajectory by another as the KITTI benchmark does",
}
"""Subcommands and what they do; each is a module of this package with `main(arguments) -> int`."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit code.

    0 done, 1 failed, 2 wrong arguments, 130 interrupted, 141 nobody reads the output any more.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        try:
            return _main(words)
        finally:
            sys.stdout.flush()  # while it can still be told that nobody reads it
    except BrokenPipeError:
        if not _unread():
            raise
    except SystemExit as leaving:
        if not isinstance(leaving.__context__, BrokenPipeError):  # as rich does, and `cli.arguments`
            raise
    _silence()
    return _UNREAD


def _main(words: list[str]) -> int:
    if words[:1] in (["--help"], ["-h"], []):
        print(_help())
        return 0 if words else 2
    if words[0] == "--version":
        print(f"echoscape {version('echoscape')}")
        return 0
    if words[0] not in COMMANDS:
        print(f"echoscape: no command {words[0]!r}; there is {', '.join(COMMANDS)}", file=sys.stderr)
        return 2
    return _run(words[0], words[1:])


def _unread() -> bool:
    """Whether it is the standard output that nobody reads: an empty line cannot be written to it either."""
    try:
        print(flush=True)
    except BrokenPipeError:
        return True
    return False


def _silence() -> None:
    """Lead the standard output nowhere, so that Python does not complain of what is left when it ends."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stdout.fileno())
    os.close(nowhere)


def _run(command: str, words: list[str]) -> int:
    try:
        return import_module(f"echoscape.cli.{command}").main(words)
    except KeyboardInterrupt:
        print(f"echoscape {command}: interrupted", file=sys.stderr)
        return 130
    except RuntimeError as error:
        if type(error).__name__ != "BackendError":  # its module is too heavy to import for its name
            raise
        print(f"echoscape {command}: {error}", file=sys.stderr)
        return 1


def _help() -> str:
    width = max(map(len, COMMANDS))
    lines = [f"  {name:{width}}  {purpose}" for name, purpose in COMMANDS.items()]
    return "\n".join(
        [
            "usage: echoscape COMMAND [OPTIONS]",
            "",
            "Ray-traced scans of a spinning FMCW radar in procedural towns, with exact truth.",
            "",
            *lines,
            "",
            "echoscape COMMAND --help lists a command's options; echoscape --version prints the version.",
        ]
    )


if __name__ == "__main__":
    sys.exit(main())
