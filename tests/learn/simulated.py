"""A small simulated folder with truth: four scans of the yard by the small radar."""

from pathlib import Path

from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.dataset import write_dataset
from echoscape.sim.sensor.cts_small import CTS_SMALL
from echoscape.sim.settings.tracing import TraceSettings


def write_simulated(folder: Path, *, seed: int = 3, scans: int = 4) -> Path:
    """Write a data set and return its folder."""
    config = SimulationConfig(
        preset="yard", seed=seed, scans=scans, sensor=CTS_SMALL, trace=TraceSettings(rays=16)
    )
    write_dataset(folder, config)
    return folder
