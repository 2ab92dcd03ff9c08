"""Memory of a worker over many scans of the default town: it must not grow.

python -m benchmarks.memory [--scans 1000]
"""

import argparse
from pathlib import Path

from benchmarks.machine import description
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.single_scan import build_simulator


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
    simulator = build_simulator(SimulationConfig(seed=options.seed, scans=options.scans))
    for index in range(options.scans):
        simulator.scan(index)
        if (index + 1) % max(options.scans // 10, 1) == 0:
            print(f"after {index + 1:5d} scans: {resident_mb():7.0f} MB", flush=True)


if __name__ == "__main__":
    main()
