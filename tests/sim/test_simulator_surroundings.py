"""Only what a drive can reach is loaded into the ray tracer; scans are nearly those of the whole scene.

Faces that lie in one plane may be met in another order there, which changes a few cells.
"""

import numpy as np
import pytest

from echoscape.scenes.core.scene import Scene
from echoscape.scenes.core.surroundings import Area
from echoscape.sim import simulator as stage
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.single_scan import build_simulator
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.sim.settings.tracing import TraceSettings
from echoscape.sim.simulator import Simulator

SETTINGS = [Artefacts(), Artefacts(interference=0.01)]


def _whole(scene: Scene, area: Area) -> Scene:
    return scene


def _pair(monkeypatch: pytest.MonkeyPatch, config: SimulationConfig) -> tuple[Simulator, Simulator]:
    """The simulator of a configuration, and one with its whole scene in the ray tracer."""
    cropped = build_simulator(config)
    assert cropped._interferer_scene is not cropped._scene
    monkeypatch.setattr(stage, "surroundings", _whole)
    whole = build_simulator(config)
    assert whole._interferer_scene is not whole._scene
    assert len(cropped._scene.face_material) < len(whole._scene.face_material)
    return cropped, whole


@pytest.mark.parametrize("preset", ["open", "motorway"])
def test_scans_are_those_of_the_whole_scene(monkeypatch: pytest.MonkeyPatch, preset: str) -> None:
    config = SimulationConfig(preset=preset, seed=7, scans=8, trace=TraceSettings(rays=64))
    cropped, whole = _pair(monkeypatch, config)
    for index in (0, 7):
        assert cropped.scans(index, SETTINGS) == whole.scans(index, SETTINGS)


@pytest.mark.slow
def test_echoes_are_those_of_the_whole_town(monkeypatch: pytest.MonkeyPatch) -> None:
    # Where two faces lie at the same place, the tree of boxes decides which one a ray meets.
    cropped, whole = _pair(monkeypatch, SimulationConfig(preset="town", seed=7, scans=8))
    first, second = (np.sort(each.echoes(0).range_m) for each in (cropped, whole))
    assert abs(len(first) - len(second)) < 1e-4 * len(second)
    common = np.intersect1d(first, second)
    assert len(common) > (1 - 1e-3) * len(np.unique(second))
