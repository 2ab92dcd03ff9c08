"""Cost of ablations: one scan, several settings of artefacts over one trace, and a scan for each setting.

    python -m benchmarks.ablations [--scans 8]

One thread; medians over scans of the default town.
"""

import argparse
from dataclasses import replace

from benchmarks.machine import description
from benchmarks.stopwatch import Stopwatch
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.single_scan import build_simulator
from echoscape.sim.raytracing.mitsuba_backend import set_threads
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.sim.simulator import Simulator

SWITCHED_OFF = ("speckle", "ghosts", "sidelobes", "saturation", "phase_noise", "thermal_noise", "leakage")
SETTINGS = (Artefacts(), *(Artefacts().without(name) for name in SWITCHED_OFF))
"""All artefacts, and all but one of each."""


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scans", type=int, default=8)
    parser.add_argument("--seed", type=int, default=7)
    options = parser.parse_args()
    print(description(), "- one thread")
    set_threads(1)
    config = SimulationConfig(seed=options.seed, scans=options.scans + 2)
    simulators = [build_simulator(replace(config, artefacts=each)) for each in SETTINGS]
    medians_s = measure(simulators, options.scans).medians_s()
    for name, median_s in medians_s.items():
        print(f"{name:44s} {1e3 * median_s:9.1f} ms {median_s / medians_s['one scan']:6.2f} scans")


def measure(simulators: list[Simulator], scans: int) -> Stopwatch:
    """Time each way to simulate scans under all settings.

    Args:
        simulators: A simulator for each of `SETTINGS`.
        scans: Number of scans.

    Returns:
        The times.
    """
    first, count = simulators[0], len(SETTINGS)
    watch = Stopwatch()
    for index in range(scans + 2):
        watch.warm = index >= 2
        watch.time("one scan", first.scan, index)
        watch.time("its trace alone", first.echoes, index)
        watch.time(f"{count} settings over one trace", first.scans, index, SETTINGS)
        label = f"{count} settings over one trace, without truth"
        watch.time(label, first.scans, index, SETTINGS, truth=False)
        watch.time(f"{count} scans", lambda number: [each.scan(number) for each in simulators], index)
    return watch


if __name__ == "__main__":
    main()
