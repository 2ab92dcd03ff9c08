"""Writes a data set folder: scene, traffic, scans with their truth, and the motion of the car.

Its files are listed in docs/conventions.md. Its bytes depend on the configuration and on versions alone: not
on workers, threads, or how often the run was stopped and resumed.
"""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from echoscape.scenes.core.progress import Progress
from echoscape.scenes.io.gltf_export import is_complete_glb, scene_to_glb
from echoscape.sim.datasets.files.atomic_write import DatasetError, remove_temporaries, write_atomic
from echoscape.sim.datasets.files.metadata import FILE_NAME, manifest_text, read_manifest
from echoscape.sim.datasets.files.output_folder import (
    check_output_folder,
    make_output_folder,
    remove_output_folder,
)
from echoscape.sim.datasets.files.track_csv import ends_as_table, movers_csv, tracks_csv
from echoscape.sim.datasets.files.truth_npz import read_arrays
from echoscape.sim.datasets.layouts.layout import ScanRecord
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.manifest import difference, manifest
from echoscape.sim.generation.setup import SceneSetup, add_traffic, build_scene
from echoscape.sim.generation.workers import complete_scans, scan_folders, simulate_scans

TABLES = ("movers.csv", "tracks.csv")
"""Tables of the moving objects and of their poses."""


def write_dataset(
    out: Path,
    config: SimulationConfig,
    *,
    workers: int = 1,
    threads: int | None = None,
    resume: bool = False,
    progress: Progress | None = None,
) -> None:
    """Simulate a data set into a folder.

    Args:
        out: The folder, which must be new or empty, or with `resume` hold a part of the same data set.
        config: The configuration.
        workers: Processes that simulate scans side by side.
        threads: Threads of each process; None shares out the processors.
        resume: Continue a run that was stopped: only missing scans are simulated.
        progress: Called as the work proceeds; stages: town, traffic, scene, scans.

    Raises:
        ValueError: `workers` or `threads` is below 1.
        DatasetError: `out` is not empty, or holds another data set.
        SceneError: The mesh of a custom scene is broken, an object is in the path of the drive, or the drive
            is shorter than the scans.
        OSError: `out` cannot be written to.
        WorkerError: A worker died or failed; the scans that are done are kept and can be resumed.
    """
    out, report = Path(out), progress or (lambda stage, done, total: None)
    check_arguments(out, workers=workers, threads=threads, resume=resume)
    made = make_output_folder(out)
    try:
        _begin(out, config)
        missing = config.scans - len(complete_scans(out, config))
        tables = all(ends_as_table(out / name) for name in TABLES)
        complete = tables and is_complete_glb(out / "scene.glb")
        setup = _setup(config, report) if missing or not complete else None
        if setup is not None:
            _write_tables(out, config, setup)
    except BaseException:
        if not resume:
            remove_output_folder(out, made)
        raise
    if setup is not None:
        _write_scans(out, config, setup, workers=min(workers, missing), threads=threads, report=report)
    _write_motion(out, config)


def check_arguments(out: Path, *, workers: int, threads: int | None, resume: bool) -> None:
    """Refuse what `write_dataset` could not carry out, before anything is made.

    Args:
        out: As in `write_dataset`, as are the others.
        workers: Number of processes.
        threads: Threads of each process, or None.
        resume: Whether a run is continued.

    Raises:
        ValueError: `workers` or `threads` is below 1.
        DatasetError: `out` cannot be written, is not empty, or holds no data set to resume.
    """
    for name, value in (("workers", workers), ("threads", 1 if threads is None else threads)):
        if value < 1:
            raise ValueError(f"{name} must be 1 or more, got {value}")
    hint = "--resume continues a run that was stopped"
    check_output_folder(out, empty=not resume, hint=hint)
    if resume and out.is_dir() and any(out.iterdir()):
        read_manifest(out)


def _begin(out: Path, config: SimulationConfig) -> None:
    """Write the manifest, or check that the folder holds the same one; make its folders, tidy it."""
    content = manifest(config)
    if (out / FILE_NAME).exists():
        differing = difference(read_manifest(out), content)
        if differing is not None:
            raise DatasetError(f"OUT holds another data set, which --resume cannot continue: {differing}")
    remove_temporaries(out)
    for name in (*scan_folders(config), *config.folder_layout.other_folders):
        (out / name).mkdir(parents=True, exist_ok=True)
    write_atomic(out / FILE_NAME, manifest_text(content).encode())


def _setup(config: SimulationConfig, report: Progress) -> SceneSetup:
    """Build the scene and its drive, and plan the traffic."""
    report("town", 0, 1)
    setup = build_scene(config)
    report("town", 1, 1)
    report("traffic", 0, 1)
    setup = add_traffic(setup, config)
    report("traffic", 1, 1)
    return setup


def _write_tables(out: Path, config: SimulationConfig, setup: SceneSetup) -> None:
    """Write the moving objects and their tracks."""
    driven_s = min(config.duration_s, setup.drive.duration_s)
    times = np.arange(0.0, driven_s, 1 / config.sensor.rotation_hz)
    write_atomic(out / "movers.csv", movers_csv(setup.movers).encode())
    tracks = tracks_csv(
        setup.drive.trajectory,
        setup.movers,
        times,
        epoch_us=config.sensor.epoch_us,
        attitude=config.artefacts.attitude,
    )
    write_atomic(out / "tracks.csv", tracks.encode())


def _write_scans(
    out: Path,
    config: SimulationConfig,
    setup: SceneSetup,
    *,
    workers: int,
    threads: int | None,
    report: Progress,
) -> None:
    """Simulate the scans that are missing, and write the scene for viewers, unless a stopped run has.

    The scene is encoded while the ray tracer starts.
    """
    path = out / "scene.glb"
    with ThreadPoolExecutor(1) as background:
        encoded = None if is_complete_glb(path) else background.submit(scene_to_glb, setup.scene)
        if workers:
            simulate_scans(
                out,
                config,
                setup,
                workers=workers,
                threads=threads,
                report=lambda done: report("scans", done, config.scans),
            )
        report("scene", 0, 1)
        if encoded is not None:
            write_atomic(path, encoded.result())
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
    """Read from a scan's truth what the files that list scans need."""
    found = read_arrays(out / "truth" / f"{stem}.npz", ("middle_us", "middle_pose", "pose"))
    return ScanRecord(
        stem=stem, middle_us=int(found["middle_us"]), middle_pose=found["middle_pose"], pose=found["pose"]
    )
