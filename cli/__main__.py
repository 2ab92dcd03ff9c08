"""The `echoscape` command: imports one subcommand only, so that help is printed without delay."""

import os
import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.metadata import version

_SIGPIPE_EXIT = 128 + 13
"""The exit code that shells report for a command that SIGPIPE ended."""

COMMANDS = {
    "simulate": "make a data set: a town, a drive through it, its radar scans and their truth",
    "scene": "build a world without any radar: its plan, its numbers, a 3-D model",
    "view": "write a page to step through a data set in a browser, small enough to mail",
    "fidelity": "compare the statistics of a folder of scans with those of real ones: table, JSON, plots",
    "artefacts": "show what each artefact does to one scan: a figure each, without it and with it",
    "ablate": "measure what artefacts and sensor faults cost odometry, over worlds, strengths and methods",
    "train": "train keypoint odometry on folders of scans with poses",
    "odometry": "estimate the motion between the scans of a folder, and evaluate it against the truth",
    "detections": "judge detectors (CFAR, k strongest, learned keypoints) by the truth of every cell",
    "drift": "evaluate one trajectory against another as the KITTI benchmark does",
}
"""Subcommands and what they do; each is a module of this package with `main(arguments) -> int`."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Args:
        arguments: The words after `echoscape`; by default those of the process.

    Returns:
        The exit code: 0 done, 1 failed, 2 wrong arguments, 130 interrupted, 141 the reader of the output is
        gone.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        try:
            return _main(words)
        finally:
            sys.stdout.flush()  # here, where a broken pipe can still be handled
    except BrokenPipeError:
        if not _output_is_closed():
            raise
    except SystemExit as leaving:
        if not isinstance(leaving.__context__, BrokenPipeError):  # raised by rich and by `cli.arguments`
            raise
    _silence_output()
    return _SIGPIPE_EXIT


def _main(words: list[str]) -> int:
    if words[:1] in (["--help"], ["-h"], []):
        print(_help())
        return 0 if words else 2
    if words[0] == "--version":
        print(f"echoscape {version('echoscape')}")
        return 0
    if words[0] not in COMMANDS:
        print(f"echoscape: unknown command {words[0]!r}; commands: {', '.join(COMMANDS)}", file=sys.stderr)
        return 2
    return _run(words[0], words[1:])


def _output_is_closed() -> bool:
    """Whether the reader of the standard output is gone: an empty line cannot be written to it either."""
    try:
        print(flush=True)
    except BrokenPipeError:
        return True
    return False


def _silence_output() -> None:
    """Redirect the standard output to nowhere, so that Python does not report what is left at exit."""
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
        from echoscape.sim.raytracing.backend import BackendChoiceError, BackendError

        if not isinstance(error, BackendError):
            raise
        print(f"echoscape {command}: {error}", file=sys.stderr)
        return 2 if isinstance(error, BackendChoiceError) else 1


def _help() -> str:
    width = max(map(len, COMMANDS))
    lines = [f"  {name:{width}}  {purpose}" for name, purpose in COMMANDS.items()]
    return "\n".join(
        [
            "usage: echoscape COMMAND [OPTIONS]",
            "",
            "Ray-traced scans of a spinning FMCW radar in procedural towns, with exact ground truth.",
            "",
            *lines,
            "",
            "echoscape COMMAND --help lists a command's options; echoscape --version prints the version.",
        ]
    )


if __name__ == "__main__":
    sys.exit(main())
