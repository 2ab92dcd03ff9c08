"""Small ablations: yards, a radar of 100 azimuths and 512 bins, few rays, phase correlation."""

import numpy as np

from echoscape.eval.ablation.study.conditions import chosen_levels, conditions
from echoscape.eval.ablation.study.settings import AblationStudy, ablation_drive
from echoscape.eval.ablation.study.tables import Results
from echoscape.eval.odometry.methods import method_choice
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.sensor.registry import SENSORS
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.sim.settings.tracing import TraceSettings

SENSOR = SENSORS["cts_small"]


def small_study(
    *words: str,
    seeds: tuple[int, ...] = (1,),
    scans: int = 2,
    keep_scans: bool = False,
    worlds: tuple[str, ...] = ("yard",),
) -> AblationStudy:
    settings = SimulationConfig(scans=scans, sensor=SENSOR, trace=TraceSettings(rays=16))
    return AblationStudy(
        drives=tuple(ablation_drive(f"{world}:{seed}", settings) for world in worlds for seed in seeds),
        conditions=conditions(chosen_levels(words, None), Artefacts(), SENSOR),
        methods=(method_choice("fourier"),),
        keep_scans=keep_scans,
    )


def made_up(
    study: AblationStudy,
    *,
    cost_m: dict[str, float],
    drift: bool = True,
    failed: dict[str, int] | None = None,
) -> Results:
    """Results in which a condition costs what is given on every drive, but for noise of drives.

    `failed` gives the failed pairs, of 3, by condition.
    """
    rng = np.random.default_rng(4)
    found = {}
    for number, drive in enumerate(study.drives):
        for condition in study.conditions:
            noise = 0.0 if condition.name == "default" else rng.normal(0, 1e-3)
            error = 0.02 + 0.01 * number + cost_m.get(condition.name, 0.0) + noise
            metrics = {
                "pairs": 3,
                "failed_pairs": (failed or {}).get(condition.name, 0),
                "translation_error_m_mean": error,
                "translation_error_m_median": error,
                "rotation_error_deg_mean": 2 * error,
                "rotation_error_deg_median": 2 * error,
                "kitti_drift": {
                    "translation_percent": error if drift else None,
                    "rotation_deg_per_m": error if drift else None,
                },
            }
            for method in study.methods:
                found[drive.name, condition.name, method.name] = {"metrics": metrics}
    return found
