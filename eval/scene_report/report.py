"""Writes a scene to look at before any radar does: scene.glb, plan.png and scene.json with its numbers.

The folder appears whole or not at all: it is made beside its place and moved there when it is done.
"""

import json
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path

import numpy as np

from echoscape.eval.scene_report.figure import Picture, scene_page
from echoscape.eval.scene_report.statistics import Inventory, inventory
from echoscape.scenes.io.gltf_export import town_to_glb
from echoscape.sim.datasets.files.atomic_write import DatasetError, temporary_beside
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.setup import SceneSetup, build_scene

Progress = Callable[[str, int, int], None]
"""Called with a stage (world, glb, plan), how much of it is done, and how much there is to do."""

_WAY_STEP_S = 0.1


def write_scene(out: Path, config: SimulationConfig, *, progress: Progress | None = None) -> Inventory:
    """Build the world of `config` and write it to `out`, which must be new or empty; return its numbers.

    A drive of one's own is shown whole, that of a preset as far as the config's scans go.

    Raises:
        DatasetError: `out` is a file, is not empty, or cannot be made.
        SceneError: see `sim.generation.setup.staged`.
        OSError: `out` cannot be written to.
    """
    report = progress or (lambda stage, done, total: None)
    check_empty(out)
    report("world", 0, 1)
    stage = build_scene(config, whole_drive=config.scene is not None)
    numbers = inventory(stage.town)
    report("world", 1, 1)
    with _new_folder(out) as folder:
        report("glb", 0, 1)
        (folder / "scene.glb").write_bytes(town_to_glb(stage.town))
        report("glb", 1, 1)
        report("plan", 0, 1)
        page = scene_page(_picture(folder / "scene.glb", config, stage, numbers))
        (folder / "plan.png").write_bytes(page)
        (folder / "scene.json").write_text(_json(config, stage, numbers))
        report("plan", 1, 1)
    return numbers


def check_empty(out: Path) -> None:
    """Refuse a folder that cannot be written; for errors see `write_scene`."""
    if out.exists() and not out.is_dir():
        raise DatasetError(f"OUT must be a folder, {out} is a file")
    if out.is_dir() and any(out.iterdir()):
        raise DatasetError(f"OUT must be empty or new, {out} is not")
    place = next(folder for folder in (out, *out.absolute().parents) if folder.exists())
    if not (place.is_dir() and os.access(place, os.W_OK | os.X_OK)):
        raise DatasetError(f"OUT cannot be made: {place} cannot be written to")


def world_name(config: SimulationConfig) -> str:
    """Return what the world of a configuration is called: its mesh, or its preset and seed."""
    return f"{config.preset}, seed {config.seed}" if config.scene is None else config.scene.file


def _picture(scene_file: Path, config: SimulationConfig, stage: SceneSetup, numbers: Inventory) -> Picture:
    return Picture(
        scene_file=scene_file,
        title=f"{world_name(config)}  ·  north up, metres",
        numbers=numbers,
        way=stage.drive.trajectory.pose(_way_times(config, stage))[:, :2],
        targets=stage.town.targets,
        all_faces=config.scene is not None,
    )


def _way_times(config: SimulationConfig, stage: SceneSetup) -> np.ndarray:
    """Return the times at which the way that is shown is sampled [s]."""
    until_s = stage.drive.duration_s
    if config.scene is None:
        until_s = min(until_s, config.scans * config.longest_turn_s)
    return np.linspace(0.0, until_s, int(np.ceil(until_s / _WAY_STEP_S)) + 1)


def _json(config: SimulationConfig, stage: SceneSetup, numbers: Inventory) -> str:
    content = {
        "world": world_name(config),
        **asdict(numbers),
        "drive_s": round(stage.drive.duration_s, 3),
        "targets": [{"instance": placed.instance, **asdict(placed.target)} for placed in stage.town.targets],
    }
    return json.dumps(content, indent=1, allow_nan=False) + "\n"


@contextmanager
def _new_folder(out: Path) -> Iterator[Path]:
    """Yield a folder beside `out` whose files are moved there at the end; nothing of it stays on an error."""
    out = out.absolute()
    made = [folder for folder in (out, *out.parents) if not folder.exists()]
    out.mkdir(parents=True, exist_ok=True)
    folder = temporary_beside(out / "scene")
    try:
        folder.mkdir()
        yield folder
        for path in sorted(folder.iterdir()):
            os.replace(path, out / path.name)
        folder.rmdir()
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        for name in ("scene.glb", "plan.png", "scene.json"):
            (out / name).unlink(missing_ok=True)
        for empty in made:
            try:
                empty.rmdir()
            except OSError:
                break
        raise
