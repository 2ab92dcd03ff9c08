"""Times of the stages of a scan, and the fast beat signal beside the plain one that it is tested against.

    python -m benchmarks.stages [--scans 12]

One thread; medians over scans of the default town.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.machine import description
from benchmarks.stopwatch import Stopwatch
from echoscape.sim.datasets.files.navtech_png import write_png
from echoscape.sim.datasets.files.truth_npz import write_truth
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.echoes import Echoes
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.single_scan import build_simulator
from echoscape.sim.ground_truth.cell_labels import CellLabeller
from echoscape.sim.raytracing.mitsuba_backend import set_threads
from echoscape.sim.receiver.if_signal import beat, beat_reference, echo_grid, spectrum
from echoscape.sim.receiver.quantiser import codes
from echoscape.sim.receiver.receiver import receive
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.simulator import Simulator

REFERENCE_AZIMUTHS = 4
"""Azimuths of which the plain beat signal is computed; it is slow."""


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
    simulator = build_simulator(SimulationConfig(seed=options.seed, scans=2 * options.scans))
    for stage, median_s in measure(simulator, options.scans).medians_s().items():
        print(f"{stage:44s} {1e3 * median_s:9.1f} ms")


def measure(simulator: Simulator, scans: int) -> Stopwatch:
    """Time each stage of some scans.

    Args:
        simulator: The simulator, with twice as many scans.
        scans: Number of scans; half as many more come first, until all is warm.

    Returns:
        The times.
    """
    sensor, artefacts = simulator.sensor, simulator.artefacts
    labeller = CellLabeller(sensor, simulator.instance_class)
    watch = Stopwatch()
    for index in range(2 * scans):
        watch.warm = index >= scans // 2
        echoes = watch.time("trace: rays to echoes", simulator.echoes, index)
        grid = watch.time("waveform: echoes to grid", echo_grid, echoes, sensor)
        noise_rng, phase_rng = (np.random.default_rng([index, k]) for k in range(2))
        received = watch.time(
            "receiver: grid to power and its parts",
            receive, grid, sensor, artefacts, noise_rng=noise_rng, phase_rng=phase_rng,
        )  # fmt: skip
        watch.time("quantiser", codes, received.power)
        dominant = labeller.dominant_echoes(echoes)  # sums the echoes on first use, when cells are labelled
        watch.time("truth of the cells", labeller.label, dominant, received, artefacts)
        if watch.warm and index % 4 == 0:
            write(simulator.scan(index), watch)
            compare(echoes, grid, watch)
    return watch


def write(scan: PolarScan, watch: Stopwatch) -> None:
    """Time the writing of a scan's files.

    Args:
        scan: The scan with its truth.
        watch: Records the times.

    Raises:
        RuntimeError: The scan has no truth.
    """
    if scan.truth is None:
        raise RuntimeError("a simulated scan has its truth")
    with tempfile.TemporaryDirectory() as folder:
        watch.time("file: scan", write_png, Path(folder) / "scan.png", scan)
        watch.time("file: truth", write_truth, Path(folder) / "truth.npz", scan.truth)


def compare(echoes: Echoes, grid: NDArray[np.complex64], watch: Stopwatch) -> None:
    """Time the plain and the fast computation of beat signals, on a few azimuths.

    Args:
        echoes: Echoes of a scan.
        grid: The same on the grid of range bins (azimuths, bins).
        watch: Records the times.
    """
    few = echoes.select(echoes.azimuth < REFERENCE_AZIMUTHS)
    label = f"({REFERENCE_AZIMUTHS} azimuths)"
    signal = watch.time(f"plain: sum of tones {label}", beat_reference, few, CTS350X)[:REFERENCE_AZIMUTHS]
    watch.time(f"window and FFT {label}", spectrum, signal.astype(np.float32), CTS350X)
    watch.time(f"fast: gridded beat {label}", beat, grid[:REFERENCE_AZIMUTHS], CTS350X)


if __name__ == "__main__":
    main()
