"""Memory of a worker over many scans of the default town: it must stay flat.

python -m benchmarks.memory [--scans 1000]
"""

import argparse
from pathlib import Path

from benchmarks.machine import description
from echoscape.scenes.driving.ego_drive import plan_ego_drive
from echoscape.scenes.town.build import build_town
from echoscape.scenes.traffic.plan import plan_traffic
from echoscape.sim.simulator import Simulator


def resident_mb() -> float:
    """Return the resident memory of this process [MB] (Linux)."""
    status = Path("/proc/self/status").read_text().splitlines()
    return int(next(line for line in status if line.startswith("VmRSS")).split()[1]) / 1024


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scans", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=7)
    options = parser.parse_args()
    print(description())
    town = build_town("town", seed=options.seed)
    drive = plan_ego_drive(town, seed=options.seed, duration_s=options.scans / 4 * 1.02 + 1)
    movers = plan_traffic(town, drive, seed=options.seed)
    simulator = Simulator(town, drive, movers, seed=options.seed)
    for index in range(options.scans):
        simulator.scan(index)
        if (index + 1) % max(options.scans // 10, 1) == 0:
            print(f"after {index + 1:5d} scans: {resident_mb():7.0f} MB", flush=True)


if __name__ == "__main__":
    main()
