"""Scans per second in the default town, with all artefacts and truth files, after the start-up.

    python -m benchmarks.scan_rate [--scans 120] [--workers 1 2]

One data set for each number of workers; the rate is that of the second half of its scans.
"""

import argparse
import os
import tempfile
import time
from pathlib import Path

from benchmarks.machine import description
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.dataset import write_dataset


def rate(scans: int, workers: int, seed: int) -> float:
    """Measure the rate of a run.

    Args:
        scans: Number of scans.
        workers: Number of worker processes.
        seed: Seed of the data set.

    Returns:
        Scans per second over the second half of the scans.
    """
    times: list[tuple[int, float]] = []

    def clock(stage: str, done: int, total: int) -> None:
        if stage == "scans":
            times.append((done, time.perf_counter()))

    with tempfile.TemporaryDirectory() as folder:
        write_dataset(
            Path(folder) / "data",
            SimulationConfig(seed=seed, scans=scans),
            workers=workers,
            threads=max(1, (os.cpu_count() or 1) // workers),
            progress=clock,
        )
    first, begun = next((done, at) for done, at in times if done >= scans // 2)
    last, ended = times[-1]
    return (last - first) / (ended - begun)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scans", type=int, default=120)
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--seed", type=int, default=7)
    options = parser.parse_args()
    print(description())
    for workers in options.workers:
        found = rate(options.scans, workers, options.seed)
        print(f"{workers} worker(s): {found:.2f} scans/s over the second half of {options.scans} scans")


if __name__ == "__main__":
    main()
