"""Where a scan's time goes, and the fast way beside the plain one that it is tested against.

    python -m benchmarks.stages [--scans 12]

One thread; medians over scans of the default town.
"""

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from benchmarks.machine import description
from echoscape.scenes.driving.ego_drive import plan_ego_drive
from echoscape.scenes.town.build import build_town
from echoscape.scenes.traffic.plan import plan_traffic
from echoscape.sim.datasets.files.navtech_png import write_png
from echoscape.sim.datasets.files.truth_npz import write_truth
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.echoes import Echoes
from echoscape.sim.ground_truth.cell_labels import CellLabeller
from echoscape.sim.raytracing.mitsuba_backend import set_threads
from echoscape.sim.receiver.if_signal import beat, beat_reference, echo_grid, spectrum
from echoscape.sim.receiver.quantiser import codes
from echoscape.sim.receiver.receiver import receive
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.simulator import Simulator

REFERENCE_ROWS = 4


Result = TypeVar("Result")


def timed(work: Callable[[], Result], times: list[float]) -> Result:
    """Do `work`, append how long it took [s], and return what it gave."""
    begun = time.perf_counter()
    result = work()
    times.append(time.perf_counter() - begun)
    return result


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scans", type=int, default=12)
    parser.add_argument("--seed", type=int, default=7)
    options = parser.parse_args()
    print(description(), "- one thread")
    set_threads(1)
    town = build_town("town", seed=options.seed)
    drive = plan_ego_drive(town, seed=options.seed, duration_s=options.scans / 2 + 5)
    movers = plan_traffic(town, drive, seed=options.seed)
    simulator = Simulator(town, drive, movers, seed=options.seed)
    times = measure(simulator, options.scans)
    for stage, values in times.items():
        print(f"{stage:44s} {1e3 * statistics.median(values):9.1f} ms")


def measure(simulator: Simulator, scans: int) -> dict[str, list[float]]:
    """Return the times [s] of each stage of some scans."""
    sensor, artefacts = simulator.sensor, simulator.artefacts
    labeller = CellLabeller(sensor, simulator.instance_class)
    times: dict[str, list[float]] = {}
    for index in range(2 * scans):
        warm = index >= scans // 2
        into = lambda stage: times.setdefault(stage, []) if warm else []  # noqa: B023, E731
        echoes = timed(lambda: simulator.echoes(index), into("trace: rays to echoes"))  # noqa: B023
        grid = timed(lambda: echo_grid(echoes, sensor), into("waveform: echoes to grid"))  # noqa: B023
        rngs = [np.random.default_rng([index, k]) for k in range(2)]
        received = timed(
            lambda: receive(grid, sensor, artefacts, noise_rng=rngs[0], phase_rng=rngs[1]),  # noqa: B023
            into("receiver: grid to power and its parts"),
        )
        timed(lambda: codes(received.power), into("quantiser"))  # noqa: B023
        timed(lambda: labeller.label(labeller.dominant_echoes(echoes), received, artefacts), into("truth"))  # noqa: B023
        if warm and index % 4 == 0:
            write(simulator.scan(index), into)
            compare(echoes, grid, times)
    return times


def write(scan: PolarScan, into: Callable[[str], list[float]]) -> None:
    """Time the writing of a scan's files."""
    truth = scan.truth
    if truth is None:
        raise RuntimeError("a simulated scan has its truth")
    with tempfile.TemporaryDirectory() as folder:
        timed(lambda: write_png(Path(folder) / "scan.png", scan), into("file: scan"))
        timed(lambda: write_truth(Path(folder) / "truth.npz", truth), into("file: truth"))


def compare(echoes: Echoes, grid: NDArray[np.complex64], times: dict[str, list[float]]) -> None:
    """Time the plain and the fast way from echoes to beat signals on a few rows."""
    few = echoes.select(echoes.azimuth < REFERENCE_ROWS)
    rows = f"({REFERENCE_ROWS} rows)"
    signal = timed(
        lambda: beat_reference(few, CTS350X)[:REFERENCE_ROWS],
        times.setdefault(f"plain: sum of tones {rows}", []),
    )
    timed(
        lambda: spectrum(signal.astype(np.float32), CTS350X), times.setdefault(f"window and FFT {rows}", [])
    )
    timed(lambda: beat(grid[:REFERENCE_ROWS], CTS350X), times.setdefault(f"fast: gridded beat {rows}", []))


if __name__ == "__main__":
    main()
