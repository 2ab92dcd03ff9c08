"""Small ablations: yards, a radar of 100 azimuths and 512 bins, few rays, phase correlation."""

from echoscape.eval.ablation.study.conditions import chosen_levels, conditions
from echoscape.eval.ablation.study.settings import AblationStudy, ablation_drive
from echoscape.eval.odometry.methods import method_choice
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.sensor.registry import SENSORS
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.sim.settings.tracing import TraceSettings

SENSOR = SENSORS["cts_small"]


def small_study(
    *words: str, seeds: tuple[int, ...] = (1,), scans: int = 2, keep_scans: bool = False
) -> AblationStudy:
    settings = SimulationConfig(scans=scans, sensor=SENSOR, trace=TraceSettings(rays=16))
    return AblationStudy(
        drives=tuple(ablation_drive(f"yard:{seed}", settings) for seed in seeds),
        conditions=conditions(chosen_levels(words, None), Artefacts(), SENSOR),
        methods=(method_choice("fourier"),),
        keep_scans=keep_scans,
    )
