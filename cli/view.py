"""`echoscape view DATA`: write one HTML page to step through a data set."""

import sys
import webbrowser
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console

from echoscape.cli.arguments import in_option_names, parse
from echoscape.cli.progress import ProgressBars

_MAILABLE_MB = 20.0


@dataclass(frozen=True, kw_only=True)
class Options:
    """Write one HTML page to step or play through a data set: scans, truth, boxes, the drive on the plan.

    The page needs nothing but a browser, no network and no second file. 40 scans take some 4 MB, a tenth of a
    megabyte each: small enough to mail.
    """

    data: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DATA")]
    """Folder of scans: one of echoscape's, or real ones (Oxford, MulRan, Boreas), which have no truth."""
    out: Path | None = None
    """The page to write; by default DATA/view.html."""
    scans: int | None = None
    """Largest number of scans to show; by default all."""
    every: int = 1
    """Show every N-th scan only."""
    columns: int = 640
    """Maximum range cells drawn per azimuth; more gives a sharper and larger page."""
    open: bool = False
    """Open the page in a browser afterwards."""


def main(arguments: Sequence[str]) -> int:
    """Run the subcommand.

    Args:
        arguments: The words after `echoscape view`.

    Returns:
        The exit code: 0 done, 2 bad input.
    """
    try:
        options = parse(Options, prog="echoscape view", words=arguments)
        out = _written(options)
    except ValueError as error:  # errors of a data set among them
        return _refuse(in_option_names(Options, str(error)))
    except OSError as error:
        return _refuse(f"{error.filename}: {error.strerror}" if error.filename else str(error))
    _say(out)
    if options.open:
        webbrowser.open(out.resolve().as_uri())
    return 0


def _written(options: Options) -> Path:
    """Write the page and return its path."""
    from echoscape.eval.viewer.data import view_of
    from echoscape.eval.viewer.html import page_bytes
    from echoscape.sim.datasets.files.atomic_write import write_atomic

    out = options.out or options.data / "view.html"
    if out.is_dir() or not out.parent.is_dir():
        if options.data.is_dir() or options.out:
            raise ValueError(f"out must be a file in an existing folder, got {out}")
        raise ValueError(f"DATA {options.data}: no such folder")
    with ProgressBars(Console(stderr=True)) as bars:
        view = view_of(
            options.data,
            scans=options.scans,
            every=options.every,
            columns=options.columns,
            progress=bars.report,
        )
    write_atomic(out, page_bytes(view))
    return out


def _say(out: Path) -> None:
    size_mb = out.stat().st_size / 1e6
    hint = "; --every or --scans makes it smaller" if size_mb > _MAILABLE_MB else ""
    print(f"{out}  {size_mb:.1f} MB{hint}")


def _refuse(message: str) -> int:
    print(f"echoscape view: {message}", file=sys.stderr)
    return 2
