"""Simulates the scans of a data set side by side; every worker process has the whole scene.

A scan is a function of the configuration and its number, so that the worker that made it cannot show in it.
"""

import multiprocessing
import os
import pickle
import signal
import traceback
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import cast

import numpy as np

from echoscape.sim.datasets.files.atomic_write import remove_temporaries, temporary_beside
from echoscape.sim.datasets.files.beat_npz import write_beat
from echoscape.sim.datasets.files.navtech_png import is_complete_png
from echoscape.sim.datasets.files.npz import ends_as_archive
from echoscape.sim.datasets.files.truth_npz import write_truth
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.setup import SceneSetup


class WorkerError(RuntimeError):
    """A worker died or failed; the message says which one, at which scan."""


@dataclass(frozen=True)
class _Failure:
    """What a worker sends when a scan failed."""

    traceback: str


def simulate_scans(
    out: Path,
    config: SimulationConfig,
    setup: SceneSetup,
    *,
    workers: int,
    threads: int | None,
    report: Callable[[int], None],
) -> None:
    """Simulate the scans that a data set lacks, and write them.

    Args:
        out: Folder of the data set.
        config: The configuration.
        setup: Scene, drive and traffic.
        workers: Processes; 1 simulates in this one.
        threads: Threads of each process; None shares out the processors.
        report: Called with the number of scans that exist.

    Raises:
        WorkerError: A worker died or failed.
    """
    report(0)
    if workers > 1:
        WorkerPool(out, config, setup, workers=workers, threads=threads).make(config.scans, report)
        return
    writer = ScanWriter(out, config, setup, threads=threads)
    # The files of a scan are compressed while the next one is simulated.
    with ThreadPoolExecutor(1) as background:
        writing: Future[None] | None = None
        for index in range(config.scans):
            scan = writer.simulated(index)
            if writing is not None:
                writing.result()
                report(index)
            writing = background.submit(writer.write, scan) if scan is not None else None
            if scan is None:
                report(index + 1)
        if writing is not None:
            writing.result()
    report(config.scans)


def scan_folders(config: SimulationConfig) -> tuple[str, ...]:
    """List the folders that hold a file of every scan, all of the same name.

    Args:
        config: The configuration.

    Returns:
        Names of the folders, that of the images first.
    """
    folders = (config.folder_layout.scans_folders[0], "truth")
    return (*folders, "beat") if config.keep_beat else folders


def complete_scans(out: Path, config: SimulationConfig) -> set[str]:
    """Find the scans that are complete.

    Args:
        out: Folder of the data set.
        config: The configuration.

    Returns:
        Names of the scans of which no file is missing or cut short.
    """
    stems = {path.stem for path in (out / scan_folders(config)[0]).glob("*.png")}
    return {stem for stem in stems if stem.isdecimal() and _is_complete(out, config, stem)}


def _is_complete(out: Path, config: SimulationConfig, stem: str) -> bool:
    """Whether all files of a scan are complete and its image is undamaged."""
    archives = [out / name / f"{stem}.npz" for name in scan_folders(config)[1:]]
    return is_complete_png(config.folder_layout.scan_path(out, stem)) and all(map(ends_as_archive, archives))


class ScanWriter:
    """Simulates scans of a data set and writes them with their truth."""

    def __init__(
        self, out: Path, config: SimulationConfig, setup: SceneSetup, *, threads: int | None
    ) -> None:
        """Load the ray tracer and the scene.

        Args:
            out: Folder of the data set.
            config: The configuration.
            setup: Scene, drive and traffic.
            threads: Threads of Dr.Jit in this process; None leaves their number as it is.
        """
        from echoscape.sim.generation.single_scan import simulator_of
        from echoscape.sim.numerics.malloc import keep_freed_memory
        from echoscape.sim.raytracing.mitsuba_backend import set_threads

        keep_freed_memory()

        if threads is not None:
            set_threads(threads)
        self._out, self._config = out, config
        self._simulator = simulator_of(setup, config)

    def simulated(self, index: int) -> PolarScan | None:
        """Simulate a scan.

        Args:
            index: Number of the scan.

        Returns:
            The scan with its truth, None where all of its files exist.

        Raises:
            WorkerError: The scan has no truth, or another name than expected.
        """
        layout, times_s = self._config.folder_layout, self._simulator.revolution(index).times_s
        epoch_us = self._config.sensor.epoch_us
        stem = layout.stem(epoch_us + np.rint(times_s * 1e6).astype(np.int64))
        if _is_complete(self._out, self._config, stem):
            return None
        scan = self._simulator.scan(index, keep_beat=self._config.keep_beat)
        if scan.truth is None or layout.stem(scan.timestamp_us) != stem:
            raise WorkerError(
                f"scan {index} has no truth, or is named {layout.stem(scan.timestamp_us)} instead of {stem}"
            )
        return scan

    def write(self, scan: PolarScan) -> None:
        """Write the files of a scan, its image last, so that an image stands for a complete scan.

        Args:
            scan: The scan with its truth.
        """
        layout = self._config.folder_layout
        stem = layout.stem(scan.timestamp_us)
        if scan.truth is not None:
            write_truth(self._out / "truth" / f"{stem}.npz", scan.truth)
        if scan.beat is not None:
            write_beat(self._out / "beat" / f"{stem}.npz", scan.beat)
        layout.write_scan(layout.scan_path(self._out, stem), scan)


class WorkerPool:
    """Worker processes that simulate scans, and the pipes to them."""

    def __init__(
        self, out: Path, config: SimulationConfig, setup: SceneSetup, *, workers: int, threads: int | None
    ) -> None:
        """Prepare without starting a process.

        Args:
            out: Folder of the data set.
            config: The configuration.
            setup: Scene, drive and traffic.
            workers: Number of processes.
            threads: Threads of each process; None shares out the processors.
        """
        self._out, self._config, self._setup = out, config, setup
        self._threads = threads or max(1, (os.cpu_count() or 1) // workers)
        self._workers = workers
        self._processes: dict[Connection, BaseProcess] = {}
        self._busy: dict[Connection, deque[int]] = {}
        self._to_do: deque[int] = deque()

    def make(self, scans: int, report: Callable[[int], None]) -> None:
        """Hand out the scans one by one until all exist; no process is left running, whatever happens.

        Args:
            scans: Number of scans.
            report: Called with the number of scans that exist.

        Raises:
            WorkerError: A worker died or failed.
        """
        setup_file = temporary_beside(self._out / "setup")
        try:
            setup_file.write_bytes(pickle.dumps(self._setup, protocol=pickle.HIGHEST_PROTOCOL))
            self._start(setup_file)
            done, self._to_do = 0, deque(range(scans))
            self._busy = {pipe: deque([-1]) for pipe in self._processes}
            while self._busy:
                for pipe in cast("list[Connection]", wait(list(self._busy))):
                    done += self._answer(pipe) >= 0
                    self._hand_out(pipe)
                report(done)
        finally:
            self._stop()
            remove_temporaries(self._out)

    def _start(self, setup_file: Path) -> None:
        """Start the workers, each with its own Python, so that none inherits threads or compiled kernels."""
        context = multiprocessing.get_context("spawn")
        for number in range(self._workers):
            ours, theirs = context.Pipe()
            arguments = (theirs, setup_file, self._out, self._config, self._threads)
            process = context.Process(target=_work, args=arguments, name=f"worker {number + 1}", daemon=True)
            process.start()
            theirs.close()
            self._processes[ours] = process

    def _hand_out(self, pipe: Connection) -> None:
        """Give a worker its next scan, and one to simulate while that is written, if enough are left."""
        given = self._busy[pipe]
        while self._to_do and (not given or (len(given) == 1 and len(self._to_do) >= self._workers)):
            given.append(self._to_do.popleft())
            try:
                pipe.send(given[-1])
            except OSError as error:
                raise self._death(pipe) from error
        if not given:
            del self._busy[pipe]

    def _answer(self, pipe: Connection) -> int:
        """Return the number of the scan that a worker finished, -1 where it reports that it has started."""
        try:
            answer = pipe.recv()
        except (EOFError, OSError) as error:
            raise self._death(pipe) from error
        if isinstance(answer, _Failure):
            raise WorkerError(
                f"{self._processes[pipe].name} failed while {self._doing(pipe)}:\n{answer.traceback}"
            )
        return self._busy[pipe].popleft()

    def _death(self, pipe: Connection) -> WorkerError:
        """Return the error that says how the worker behind a broken pipe ended, and at which scan."""
        process = self._processes[pipe]
        process.join(10)
        return WorkerError(f"{process.name} died while {self._doing(pipe)} ({_ending(process.exitcode)})")

    def _doing(self, pipe: Connection) -> str:
        index = self._busy[pipe][0]
        return f"making scan {index}" if index >= 0 else "starting"

    def _stop(self) -> None:
        for pipe, process in self._processes.items():
            pipe.close()
            process.terminate()
        for process in self._processes.values():
            process.join()


def _ending(code: int | None) -> str:
    if code is not None and code < 0:
        return f"signal {signal.Signals(-code).name}"
    return f"exit code {code}"


def _work(pipe: Connection, setup_file: Path, out: Path, config: SimulationConfig, threads: int) -> None:
    """Simulate the scans whose numbers arrive in the pipe until it closes; the parent handles Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        setup = pickle.loads(setup_file.read_bytes())
        writer = ScanWriter(out, config, setup, threads=threads)
        pipe.send(None)
        with ThreadPoolExecutor(1) as background:
            _work_off(pipe, writer, background)
    except (EOFError, BrokenPipeError, ConnectionResetError):
        return
    except Exception:
        pipe.send(_Failure(traceback.format_exc()))


def _work_off(pipe: Connection, writer: ScanWriter, background: ThreadPoolExecutor) -> None:
    """Simulate scans until the pipe closes; each is written while the next is simulated, then reported."""
    writing: Future[None] | None = None
    while True:
        if writing is not None and not pipe.poll():
            _report_written(pipe, writing)
            writing = None
        index = pipe.recv()
        try:
            scan = writer.simulated(index)
        finally:
            if writing is not None:
                _report_written(pipe, writing)
        writing = background.submit(writer.write, scan) if scan is not None else None
        if scan is None:
            pipe.send(None)


def _report_written(pipe: Connection, writing: Future[None]) -> None:
    """Wait until a scan is written, and report it."""
    writing.result()
    pipe.send(None)
