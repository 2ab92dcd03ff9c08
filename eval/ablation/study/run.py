"""Runs an ablation: every world is built once, every scan traced once, every method run on what was written.

A run that was stopped goes on with what is missing. Scans and odometry are functions of the settings alone:
neither workers nor interruptions show in a result.
"""

import json
import os
import pickle
import shutil
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from itertools import chain, islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from echoscape.eval.ablation.study.conditions import Condition
from echoscape.eval.ablation.study.results import has_result, read_result, result_path
from echoscape.eval.ablation.study.scans import DriveFolders, DriveWriter
from echoscape.eval.ablation.study.settings import (
    CODE,
    AblationDrive,
    AblationStudy,
    study_content,
    world_of,
)
from echoscape.eval.ablation.study.workers import Task, carried_out, run_method, worker_pool, write_scan
from echoscape.eval.odometry.methods import MethodChoice
from echoscape.scenes.core.progress import Progress
from echoscape.sim.datasets.files.atomic_write import (
    DatasetError,
    remove_temporaries,
    temporary_beside,
    write_atomic,
)
from echoscape.sim.datasets.files.output_folder import check_output_folder
from echoscape.sim.generation.manifest import difference
from echoscape.sim.generation.setup import SceneSetup, add_traffic, build_scene

if TYPE_CHECKING:
    from echoscape.learn.model.device import Device

FILE_NAME = "ablation.json"
"""File with the settings of the ablation in a folder."""


def run_ablation(
    out: Path,
    study: AblationStudy,
    *,
    workers: int = 1,
    device: "Device" = "cpu",
    progress: Progress | None = None,
) -> None:
    """Run an ablation into a folder, or continue one.

    Args:
        out: The folder: new, empty, or one that holds a part of the same ablation.
        study: The ablation.
        workers: Processes side by side; no result depends on it.
        device: Where learned methods compute.
        progress: Called as the work proceeds; stages: worlds, scans, odometry.

    Raises:
        ValueError: `workers` is below 1, or the device is absent.
        DatasetError: `out` holds something else or another ablation, or weights cannot be read.
        SceneError: A custom scene is broken, or its drive too short or obstructed.
        OSError: `out` cannot be written to.
        WorkerError: A worker died; what is done is kept.
    """
    content = check_ablation(out, study, workers=workers)
    counts = _Counts(study, progress or (lambda stage, done, total: None))
    to_do = [each for each in study.drives if not _is_done(out, study, each)]
    setups = _setups(to_do, counts)
    first = [*islice(setups, 1)]  # a first world that cannot be built leaves nothing behind
    out.mkdir(parents=True, exist_ok=True)
    remove_temporaries(out)
    write_atomic(out / FILE_NAME, (json.dumps(content, indent=1) + "\n").encode())
    for drive in study.drives:
        if drive not in to_do:
            counts.skip(drive)
            _tidy(out, study, drive)
    with worker_pool(workers) as pool:
        for drive, setup in chain(first, setups):
            _run_drive(out, study, drive, setup, pool, counts, workers=workers, device=device)


def check_ablation(out: Path, study: AblationStudy, *, workers: int) -> dict[str, Any]:
    """Refuse what `run_ablation` could not carry out, before anything is made.

    Args:
        out: As in `run_ablation`, as are the others.
        study: The ablation.
        workers: Number of processes.

    Returns:
        The content of ablation.json.

    Raises:
        ValueError: `workers` is below 1.
        DatasetError: `out` holds something else or another ablation, or weights cannot be read.
    """
    if workers < 1:
        raise ValueError(f"workers must be 1 or more, got {workers}")
    content = json.loads(json.dumps(study_content(study)))
    path = out / FILE_NAME
    if not path.is_file():
        check_output_folder(out, empty=True, hint=f"it has no {FILE_NAME} to continue from")
        return content
    check_output_folder(out)
    try:
        found = json.loads(path.read_text())
        assert isinstance(found, dict)
    except (OSError, ValueError, AssertionError) as error:
        raise DatasetError(f"{path}: cannot be read ({error})") from error
    _check_same(found, content)
    return content


def _check_same(found: dict[str, Any], content: dict[str, Any]) -> None:
    """Refuse a folder whose ablation.json `found` has other settings than `content`, or is of other code."""
    differing = _other_names(found, content) or difference({**found, CODE: content[CODE]}, content)
    if differing is not None:
        raise DatasetError(f"OUT holds another ablation, which this one cannot continue: {differing}")
    if found.get(CODE) != content[CODE]:
        raise DatasetError(
            f"OUT holds an ablation by other code of echoscape ({CODE} {found.get(CODE)}, now "
            f"{content[CODE]}), which cannot be continued: take a new folder, or go back to that code"
        )


def _other_names(found: dict[str, Any], content: dict[str, Any]) -> str | None:
    """Name the first world, condition or method that only one of two ablations has."""
    for kind, shown in {"worlds": world_of, "conditions": str, "methods": str}.items():
        old, new = found.get(kind), content[kind]
        if isinstance(old, dict) and old.keys() != new.keys():
            lacking = next((name for name in new if name not in old), None)
            name = lacking or next(name for name in old if name not in new)
            return f"it {'lacks' if lacking else 'also has'} the {kind.removesuffix('s')} {shown(name)}"
    return None


class _Counts:
    """Reports how much is done, over all drives."""

    def __init__(self, study: AblationStudy, report: Progress) -> None:
        self._report, self._study = report, study
        self._odometry = len(study.runs) * len(study.methods)
        drives = len(study.drives)
        self._total = {
            "worlds": drives,
            "scans": drives * study.scans,
            "odometry": drives * self._odometry,
        }
        self._done = dict.fromkeys(self._total, 0)

    def add(self, stage: str, count: int = 1) -> None:
        """Count steps as done."""
        self._done[stage] += count
        self._report(stage, self._done[stage], self._total[stage])

    def skip(self, drive: AblationDrive) -> None:
        """Count a drive that an earlier run has finished."""
        for stage, count in (("worlds", 1), ("scans", drive.config.scans), ("odometry", self._odometry)):
            self.add(stage, count)


def _setups(drives: Sequence[AblationDrive], counts: _Counts) -> Iterator[tuple[AblationDrive, SceneSetup]]:
    """Yield every drive with its world, each built while the one before is worked on."""
    with ThreadPoolExecutor(1) as builder:
        ahead = [builder.submit(_built, each, counts) for each in drives[:1]]
        for place, drive in enumerate(drives):
            setup = ahead.pop().result()
            ahead = [builder.submit(_built, each, counts) for each in drives[place + 1 : place + 2]]
            yield drive, setup


def _built(drive: AblationDrive, counts: _Counts) -> SceneSetup:
    """Build the world of a drive, with traffic."""
    counts.add("worlds", 0)
    setup = add_traffic(build_scene(drive.config), drive.config)
    counts.add("worlds")
    return setup


def _folders(out: Path, study: AblationStudy, drive: AblationDrive) -> DriveFolders:
    folder = out / "scans" / drive.name
    return DriveFolders(folder=folder, drive=drive, conditions=study.runs, keep_truth=study.keep_scans)


def _results(
    out: Path, study: AblationStudy, drive: AblationDrive
) -> Iterator[tuple[Condition, MethodChoice, Path]]:
    """Yield each condition and method with the file of its result."""
    for condition in study.runs:
        for method in study.methods:
            yield condition, method, result_path(out, drive, condition, method)


def _is_done(out: Path, study: AblationStudy, drive: AblationDrive) -> bool:
    """Tell whether all results of a drive can be read, and all of its scans are there if they are kept."""
    if study.keep_scans and not _folders(out, study, drive).complete:
        return False
    return all(has_result(path) for _, _, path in _results(out, study, drive))


def _tidy(out: Path, study: AblationStudy, drive: AblationDrive) -> None:
    """Remove the scans of a drive that is done, unless they are kept."""
    if not study.keep_scans:
        shutil.rmtree(out / "scans" / drive.name, ignore_errors=True)
        if (out / "scans").is_dir() and not any((out / "scans").iterdir()):
            (out / "scans").rmdir()


def _run_drive(
    out: Path,
    study: AblationStudy,
    drive: AblationDrive,
    setup: SceneSetup,
    pool: ProcessPoolExecutor | None,
    counts: _Counts,
    *,
    workers: int,
    device: "Device",
) -> None:
    """Simulate a drive under all conditions, then run all methods on it."""
    folders = _folders(out, study, drive)
    if folders.complete:
        counts.add("scans", drive.config.scans)
    else:
        _simulate(folders, setup, pool, counts, threads=max(1, (os.cpu_count() or 1) // workers))
    lacking = [each for each in _results(out, study, drive) if not has_result(each[2])]
    counts.add("odometry", len(study.runs) * len(study.methods) - len(lacking))
    tasks = [
        Task(run_method, (folders.of(condition), method, drive.config.sensor, path, device))
        for condition, method, path in lacking
    ]
    for _ in carried_out(tasks, pool):
        counts.add("odometry")
    _tidy(out, study, drive)


def _simulate(
    folders: DriveFolders,
    setup: SceneSetup,
    pool: ProcessPoolExecutor | None,
    counts: _Counts,
    *,
    threads: int,
) -> None:
    """Simulate the scans of a drive that are missing."""
    writer = DriveWriter(folders, setup)
    missing = writer.missing()
    counts.add("scans", folders.drive.config.scans - len(missing))
    folders.folder.mkdir(parents=True, exist_ok=True)
    setup_file = temporary_beside(folders.folder / "setup")
    try:
        if pool is None:
            tasks = [Task(writer.write, (index,)) for index in missing]
        else:
            setup_file.write_bytes(pickle.dumps(setup, protocol=pickle.HIGHEST_PROTOCOL))
            tasks = [Task(write_scan, (folders, setup_file, threads, index)) for index in missing]
        for _ in carried_out(tasks, pool):
            counts.add("scans")
    finally:
        setup_file.unlink(missing_ok=True)
    writer.finish()


def all_results(out: Path, study: AblationStudy) -> dict[tuple[str, str, str], dict[str, Any]]:
    """Read the results of an ablation that is done.

    Args:
        out: Folder of the ablation.
        study: The ablation.

    Returns:
        Contents by the names of drive, condition and method; conditions of the same scans share theirs.

    Raises:
        DatasetError: A result is missing or damaged.
    """
    run_of = study.run_of
    return {
        (drive.name, condition.name, method.name): read_result(
            result_path(out, drive, run_of[condition.name], method)
        )
        for drive in study.drives
        for condition in study.conditions
        for method in study.methods
    }
