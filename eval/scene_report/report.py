"""Writes a scene without any radar: scene.glb, plan.png, and scene.json with its counts.

The files appear whole or not at all: they are made beside the folder and moved there at the end.
"""

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path

import numpy as np

from echoscape.eval.scene_report.figure import ScenePlan, scene_page
from echoscape.eval.scene_report.statistics import Inventory, inventory
from echoscape.scenes.core.progress import Progress
from echoscape.scenes.io.gltf_export import scene_to_glb
from echoscape.scenes.io.user_scene import UserScene
from echoscape.sim.datasets.files.atomic_write import temporary_beside
from echoscape.sim.datasets.files.output_folder import (
    check_output_folder,
    make_output_folder,
    remove_output_folder,
)
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.setup import SceneSetup, build_scene

_PATH_STEP_S = 0.1


def write_scene(out: Path, config: SimulationConfig, *, progress: Progress | None = None) -> Inventory:
    """Build the world of a configuration and write its files.

    A user's drive is shown whole, that of a preset or a map as far as the scans of the configuration go.

    Args:
        out: Folder to write to, new or empty.
        config: What `echoscape simulate` would make.
        progress: Called as the work proceeds; stages: world, glb, plan.

    Returns:
        The counts of the scene.

    Raises:
        DatasetError: `out` is a file, is not empty, or cannot be made.
        SceneError: A file of the scene is not valid, as in `sim.generation.setup.build_scene`.
        OSError: `out` cannot be written to.
    """
    report = progress or (lambda stage, done, total: None)
    check_output_folder(out, empty=True)
    report("world", 0, 1)
    setup = build_scene(config, whole_drive=isinstance(config.scene, UserScene))
    counts = inventory(setup.scene)
    report("world", 1, 1)
    with _new_folder(out) as folder:
        report("glb", 0, 1)
        (folder / "scene.glb").write_bytes(scene_to_glb(setup.scene))
        report("glb", 1, 1)
        report("plan", 0, 1)
        page = scene_page(_plan(folder / "scene.glb", config, setup, counts))
        (folder / "plan.png").write_bytes(page)
        (folder / "scene.json").write_text(_json(config, setup, counts))
        report("plan", 1, 1)
    return counts


def _world_name(config: SimulationConfig) -> str:
    """Return the name of the world: the file of its mesh, or its preset or map and seed."""
    if isinstance(config.scene, UserScene):
        return config.scene.file
    return f"{config.preset if config.scene is None else config.scene.file}, seed {config.seed}"


def _plan(scene_file: Path, config: SimulationConfig, setup: SceneSetup, counts: Inventory) -> ScenePlan:
    return ScenePlan(
        scene_file=scene_file,
        title=f"{_world_name(config)}  ·  north up, metres",
        inventory=counts,
        path=setup.drive.trajectory.pose(_path_times_s(config, setup))[:, :2],
        targets=setup.scene.targets,
        all_faces=isinstance(config.scene, UserScene),
    )


def _path_times_s(config: SimulationConfig, setup: SceneSetup) -> np.ndarray:
    """Return the times (P,) at which the drive on the plan is sampled [s]."""
    until_s = setup.drive.duration_s
    if not isinstance(config.scene, UserScene):
        until_s = min(until_s, config.scans * config.longest_revolution_s)
    return np.linspace(0.0, until_s, int(np.ceil(until_s / _PATH_STEP_S)) + 1)


def _json(config: SimulationConfig, setup: SceneSetup, counts: Inventory) -> str:
    origin = setup.scene.origin_deg
    content = {
        "world": _world_name(config),
        **({} if origin is None else {"origin_deg": origin}),
        **asdict(counts),
        "drive_s": round(setup.drive.duration_s, 3),
        "targets": [{"instance": placed.instance, **asdict(placed.target)} for placed in setup.scene.targets],
    }
    return json.dumps(content, indent=1, allow_nan=False) + "\n"


@contextmanager
def _new_folder(out: Path) -> Iterator[Path]:
    """Yield a folder beside `out` whose files are moved there at the end; on an error nothing stays."""
    out = out.absolute()
    made = make_output_folder(out)
    folder = temporary_beside(out / "scene")
    try:
        folder.mkdir()
        yield folder
        for path in sorted(folder.iterdir()):
            os.replace(path, out / path.name)
        folder.rmdir()
    except BaseException:
        remove_output_folder(out, made)
        raise
