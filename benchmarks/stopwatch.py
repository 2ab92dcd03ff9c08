"""Times of repeated work, by the name of its stage."""

import statistics
import time
from collections.abc import Callable
from typing import ParamSpec, TypeVar

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


class Stopwatch:
    """Times calls by stage.

    Attributes:
        times_s: Times of each stage, in the order of the first calls [s].
        warm: Whether calls are recorded; False while caches fill.
    """

    def __init__(self) -> None:
        """Start with no times, recording."""
        self.times_s: dict[str, list[float]] = {}
        self.warm = True

    def time(
        self,
        stage: str,
        function: Callable[Arguments, Result],
        *arguments: Arguments.args,
        **options: Arguments.kwargs,
    ) -> Result:
        """Time one call.

        Args:
            stage: Name of the stage.
            function: What to call.
            *arguments: Its arguments.
            **options: Its keyword arguments.

        Returns:
            The result of the call.
        """
        begun = time.perf_counter()
        result = function(*arguments, **options)
        if self.warm:
            self.times_s.setdefault(stage, []).append(time.perf_counter() - begun)
        return result

    def medians_s(self) -> dict[str, float]:
        """Return the median time of each stage [s]."""
        return {stage: statistics.median(times) for stage, times in self.times_s.items()}
