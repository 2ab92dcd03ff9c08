"""What ablations cost: one scan, a list of settings over one trace, and a scan of its own for each.

    python -m benchmarks.ablations [--scans 8]

One thread; medians over scans of the default town.
"""

import argparse
import statistics

from benchmarks.machine import description
from benchmarks.stages import timed
from echoscape.scenes.driving.ego_drive import plan_ego_drive
from echoscape.scenes.town.build import build_town
from echoscape.scenes.traffic.plan import plan_traffic
from echoscape.sim.raytracing.mitsuba_backend import set_threads
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.sim.simulator import Simulator

WITHOUT = ("speckle", "ghosts", "sidelobes", "saturation", "phase_noise", "thermal_noise", "leakage")
SETTINGS = (Artefacts(), *(Artefacts().without(name) for name in WITHOUT))


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
    town = build_town("town", seed=options.seed)
    drive = plan_ego_drive(town, seed=options.seed, duration_s=options.scans / 2 + 5)
    movers = plan_traffic(town, drive, seed=options.seed)
    simulators = [
        Simulator(town, drive, movers, seed=options.seed, artefacts=setting) for setting in SETTINGS
    ]
    times = measure(simulators, options.scans)
    one = statistics.median(times["one scan"])
    for name, values in times.items():
        median = statistics.median(values)
        print(f"{name:44s} {1e3 * median:9.1f} ms {median / one:6.2f} scans")


def measure(simulators: list[Simulator], scans: int) -> dict[str, list[float]]:
    """Return the times [s] of each way to make a scan under all settings."""
    first, count = simulators[0], len(SETTINGS)
    times: dict[str, list[float]] = {}
    for index in range(scans + 2):
        warm = index >= 2
        into = lambda name: times.setdefault(name, []) if warm else []  # noqa: B023, E731
        timed(lambda: first.scan(index), into("one scan"))  # noqa: B023
        timed(lambda: first.echoes(index), into("its trace alone"))  # noqa: B023
        timed(lambda: first.scans(index, SETTINGS), into(f"{count} settings over one trace"))  # noqa: B023
        timed(
            lambda: first.scans(index, SETTINGS, truth=False),  # noqa: B023
            into(f"{count} settings over one trace, without truth"),
        )
        timed(lambda: [each.scan(index) for each in simulators], into(f"{count} scans"))  # noqa: B023
    return times


if __name__ == "__main__":
    main()
