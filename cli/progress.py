"""Progress of a command on the terminal: one bar for each of its stages."""

import time

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn


class ProgressBars:
    """One progress bar a stage, each shown from the stage's first report on.

    After bad input, which raises a ValueError, they are removed, as nothing was made. After other errors they
    stay, to show how far the work came.
    """

    def __init__(self, console: Console) -> None:
        """Prepare the display.

        Args:
            console: The terminal to draw on.
        """
        self._bars = Progress(
            TextColumn("{task.description:8}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("{task.fields[rate]}"),
            console=console,
        )
        self._tasks: dict[str, tuple[int, float, int]] = {}

    def __enter__(self) -> "ProgressBars":
        return self

    def __exit__(self, kind: type[BaseException] | None, *error: object) -> None:
        if not self._bars.live.is_started:  # to stop it would print an empty line
            return
        if kind is not None and issubclass(kind, ValueError):
            self._bars.live.transient = True
            self._bars.live.stop()
        else:
            self._bars.stop()

    def report(self, stage: str, done: int, total: int) -> None:
        """Update the bar of a stage, that of "scans" with its rate; the first report starts the display.

        Args:
            stage: Name of the stage.
            done: Steps that are done.
            total: Steps that the stage has.
        """
        self._bars.start()
        if stage not in self._tasks:
            task = self._bars.add_task(stage, total=total, completed=done, rate="")
            self._tasks[stage] = (int(task), time.monotonic(), done)
        task, since, first = self._tasks[stage]
        made, seconds = done - first, time.monotonic() - since
        rate = f"{made / seconds:.2f}/s" if stage == "scans" and made > 0 and seconds > 0 else ""
        self._bars.update(task, completed=done, rate=rate)  # type: ignore[arg-type]
