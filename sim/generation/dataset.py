"""Writes a dataset folder from a configuration: town, traffic, scans with their truth, and how the car moved.

The layout is that of the Oxford Radar RobotCar data set with our truth beside it (docs/conventions.md).
Its bytes depend on the config alone: not on workers, threads, or how often the run was stopped and resumed.
"""

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np

from echoscape.scenes.driving.ego_drive import EgoDrive
from echoscape.scenes.io.gltf_export import is_whole_glb, town_to_glb
from echoscape.scenes.traffic.plan import plan_traffic
from echoscape.sim.datasets.files.atomic_write import DatasetError, remove_temporaries, write_whole
from echoscape.sim.datasets.files.metadata import FILE_NAME, manifest_text, read_manifest
from echoscape.sim.datasets.files.track_csv import ends_as_table, movers_csv, tracks_csv
from echoscape.sim.datasets.files.truth_npz import read_arrays
from echoscape.sim.datasets.layouts.layout import ScanRecord
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.manifest import difference, manifest
from echoscape.sim.generation.setup import build_scene
from echoscape.sim.generation.workers import SceneSetup, make_scans, scan_folders, whole_scans

Progress = Callable[[str, int, int], None]
"""Called with a stage (town, traffic, scene, scans), how much of it is done, and how much there is to do."""

TABLES = ("movers.csv", "tracks.csv")
"""Tables of who moves and where."""


def write_dataset(
    out: Path,
    config: SimulationConfig,
    *,
    workers: int = 1,
    threads: int | None = None,
    resume: bool = False,
    progress: Progress | None = None,
) -> None:
    """Make the dataset of `config` in the folder `out`.

    Workers are processes that trace scans side by side, `threads` each (None: the processors shared out).
    With `resume`, a run that was stopped is continued: only the scans that are missing are made.

    Raises:
        ValueError: workers or threads is below 1.
        DatasetError: `out` is not empty, or holds another config's dataset.
        SceneError: the mesh of a scene of one's own is broken, something stands in the drive's way, or the
            drive is shorter than the scans.
        OSError: `out` cannot be written to.
        CrewError: a worker died or failed; what was made is kept and can be resumed.
    """
    out, report = Path(out), progress or (lambda stage, done, total: None)
    check_arguments(out, workers=workers, threads=threads, resume=resume)
    made = _make_folder(out)
    try:
        _claim(out, config)
        missing = config.scans - len(whole_scans(out, config))
        whole = is_whole_glb(out / "scene.glb") and all(map(ends_as_table, (out / name for name in TABLES)))
        scenery = _scenery(config, report) if missing or not whole else None
        if scenery is not None:
            _write_scenery(out, config, scenery, report)
    except BaseException:
        if not resume:
            _unmake(out, made)
        raise
    if scenery is not None and missing:
        make_scans(
            out,
            config,
            scenery,
            workers=min(workers, missing),
            threads=threads,
            report=lambda done: report("scans", done, config.scans),
        )
    _write_motion(out, config)


def check_arguments(out: Path, *, workers: int, threads: int | None, resume: bool) -> None:
    """Refuse what `write_dataset` could not carry out, before anything is made; for errors see there."""
    for name, value in (("workers", workers), ("threads", 1 if threads is None else threads)):
        if value < 1:
            raise ValueError(f"{name} must be 1 or more, got {value}")
    if out.exists() and not out.is_dir():
        raise DatasetError(f"OUT must be a folder, {out} is a file")
    if out.is_dir() and any(out.iterdir()):
        if not resume:
            raise DatasetError(
                f"OUT must be empty or new, {out} is not (--resume continues a run that was stopped)"
            )
        read_manifest(out)
    place = next(folder for folder in (out, *out.absolute().parents) if folder.exists())
    if not (place.is_dir() and os.access(place, os.W_OK | os.X_OK)):
        raise DatasetError(f"OUT cannot be made: {place} cannot be written to")


def _make_folder(out: Path) -> list[Path]:
    """Make `out` and return the folders that had to be made for it, innermost first."""
    made = [folder for folder in (out, *out.absolute().parents) if not folder.exists()]
    out.mkdir(parents=True, exist_ok=True)
    return made


def _unmake(out: Path, made: list[Path]) -> None:
    """Empty `out`, which was empty, and remove the folders made for it that nobody else uses by now."""
    for path in out.iterdir():
        shutil.rmtree(path) if path.is_dir() else path.unlink()
    for folder in made:
        try:
            folder.rmdir()
        except OSError:
            return


def _claim(out: Path, config: SimulationConfig) -> None:
    """Write the config into the folder, or see that it holds the same one; make its folders, tidy it."""
    content = manifest(config)
    if (out / FILE_NAME).exists():
        differing = difference(read_manifest(out), content)
        if differing is not None:
            raise DatasetError(f"OUT holds another dataset, which --resume cannot continue: {differing}")
    remove_temporaries(out)
    for name in (*scan_folders(config), *config.folder_layout.other_folders):
        (out / name).mkdir(parents=True, exist_ok=True)
    write_whole(out / FILE_NAME, manifest_text(content).encode())


def _scenery(config: SimulationConfig, report: Progress) -> SceneSetup:
    """Build the world and its drive, and plan the traffic where there are roads for it."""
    report("town", 0, 1)
    stage = build_scene(config)
    report("town", 1, 1)
    report("traffic", 0, 1)
    movers = ()
    if isinstance(stage.drive, EgoDrive):
        movers = plan_traffic(stage.town, stage.drive, seed=config.seed, settings=config.traffic)
    report("traffic", 1, 1)
    return SceneSetup(town=stage.town, drive=stage.drive, movers=movers)


def _write_scenery(out: Path, config: SimulationConfig, scenery: SceneSetup, report: Progress) -> None:
    """Write the movers' tracks, and the town for viewers unless a stopped run has."""
    report("scene", 0, 1)
    driven_s = min(config.duration_s, scenery.drive.duration_s)
    times = np.arange(0.0, driven_s, 1 / config.sensor.rotation_hz)
    if not is_whole_glb(out / "scene.glb"):
        write_whole(out / "scene.glb", town_to_glb(scenery.town))
    write_whole(out / "movers.csv", movers_csv(scenery.movers).encode())
    tracks = tracks_csv(scenery.drive.trajectory, scenery.movers, times)
    write_whole(out / "tracks.csv", tracks.encode())
    report("scene", 1, 1)


def _write_motion(out: Path, config: SimulationConfig) -> None:
    """Write the files that list scans, from the scans themselves."""
    layout = config.folder_layout
    stems = layout.stems(out)
    if len(stems) != config.scans:
        place = out / layout.scans_folders[0]
        raise DatasetError(f"{place}: {len(stems)} scans where {config.scans} should be")
    layout.write_motion(out, [_record(out, stem) for stem in stems], config.sensor)


def _record(out: Path, stem: str) -> ScanRecord:
    """Read from a scan's truth what the files that list scans need of it."""
    found = read_arrays(out / "truth" / f"{stem}.npz", ("middle_us", "middle_pose", "pose"))
    return ScanRecord(
        stem=stem, middle_us=int(found["middle_us"]), middle_pose=found["middle_pose"], pose=found["pose"]
    )
