"""The work of an ablation in pieces, a scan or a run of a method each, and the processes that do it."""

import logging
import multiprocessing
import os
import pickle
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import lru_cache
from multiprocessing.connection import wait
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from echoscape.eval.ablation.study.results import result_text
from echoscape.eval.ablation.study.scans import DriveFolders, DriveWriter
from echoscape.eval.odometry.interface import OdometryMethod
from echoscape.eval.odometry.methods import MethodChoice, build_method
from echoscape.eval.odometry.run import run_odometry
from echoscape.sim.datasets.files.atomic_write import write_atomic
from echoscape.sim.datasets.scan_folder import open_folder
from echoscape.sim.generation.workers import WorkerError
from echoscape.sim.sensor.sensor import Sensor

if TYPE_CHECKING:
    from echoscape.learn.model.device import Device


class Task(NamedTuple):
    """A function and its arguments."""

    function: Callable[..., None]
    arguments: tuple[Any, ...]


_writers: dict[Path, DriveWriter] = {}
"""The drive that this process simulates."""


def write_scan(folders: DriveFolders, setup_file: Path, threads: int, index: int) -> None:
    """Simulate and write one scan under all conditions; the scene is loaded once for a drive.

    Args:
        folders: The folders to write.
        setup_file: File with scene, drive and traffic, pickled by the process that started this one.
        threads: Threads of Dr.Jit.
        index: Number of the scan.
    """
    if setup_file not in _writers:
        _writers.clear()
        setup = pickle.loads(setup_file.read_bytes())
        _writers[setup_file] = DriveWriter(folders, setup, threads=threads)
    _writers[setup_file].write(index)


def run_method(
    folder: Path, choice: MethodChoice, sensor: Sensor, path: Path, device: "Device" = "cpu"
) -> None:
    """Run a method on the scans of a condition and write its result.

    Args:
        folder: Folder of the scans.
        choice: The method.
        sensor: The radar.
        path: File of the result.
        device: Where a learned method computes.

    Raises:
        DatasetError: The folder cannot be read, or the weights are no model.
    """
    scans = open_folder(folder)
    result = run_odometry(scans, _method(choice, sensor, scans.range_offset_m, device))
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomic(path, result_text(result).encode())


@lru_cache(maxsize=8)
def _method(
    choice: MethodChoice, sensor: Sensor, range_offset_m: float, device: "Device"
) -> OdometryMethod[Any]:
    if choice.learned:
        import torch

        torch.set_num_threads(1)
    return build_method(choice, sensor, range_offset_m=range_offset_m, device=device)


@contextmanager
def worker_pool(workers: int) -> Iterator[ProcessPoolExecutor | None]:
    """Give worker processes, which have ended when the context is left.

    Args:
        workers: Number of processes; 1 works in this one.

    Yields:
        The processes, None where this one does all.
    """
    if workers == 1:
        yield None
        return
    context = multiprocessing.get_context("spawn")  # none inherits threads or compiled kernels
    pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_start_worker)
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)


def _start_worker() -> None:
    """Prepare a worker: the parent handles Ctrl-C, and a worker whose parent was killed ends."""
    from echoscape.sim.numerics.malloc import keep_freed_memory

    keep_freed_memory()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    logging.getLogger("echoscape").setLevel(logging.ERROR)  # failed pairs are counted in the results
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


def carried_out(tasks: Sequence[Task], pool: ProcessPoolExecutor | None) -> Iterator[None]:
    """Carry out tasks, in order or side by side.

    Args:
        tasks: The tasks.
        pool: The workers, None for this process.

    Yields:
        None for each task that is done.

    Raises:
        WorkerError: A worker died.
    """
    if pool is None:
        for task in tasks:
            yield task.function(*task.arguments)
        return
    futures: list[Future[None]] = []
    try:
        futures += [pool.submit(task.function, *task.arguments) for task in tasks]
        for future in as_completed(futures):
            yield future.result()
    except BrokenProcessPool as error:
        raise WorkerError(
            "a worker died (out of memory?); what is done is kept, and the same command continues"
        ) from error
    finally:
        for future in futures:
            future.cancel()
