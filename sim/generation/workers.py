"""Processes that make a dataset's scans side by side: each has the whole town and takes one scan at a time.

A scan is a function of the config and its number, so that who makes it and when cannot show in the result.
"""

import multiprocessing
import os
import pickle
import signal
import traceback
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import cast

import numpy as np

from echoscape.scenes.core.scene import Mover, Scene
from echoscape.scenes.driving.ego_drive import EgoDrive
from echoscape.scenes.io.user_drive import UserDrive
from echoscape.sim.datasets.files.atomic_write import remove_temporaries, temporary_beside
from echoscape.sim.datasets.files.beat_npz import write_beat
from echoscape.sim.datasets.files.navtech_png import is_whole_png
from echoscape.sim.datasets.files.npz import ends_as_archive
from echoscape.sim.datasets.files.truth_npz import write_truth
from echoscape.sim.datasets.polar_scan import EPOCH_US, PolarScan
from echoscape.sim.generation.config import SimulationConfig


class WorkerError(RuntimeError):
    """A worker died or failed; the message says which, at which scan."""


@dataclass(frozen=True, kw_only=True)
class SceneSetup:
    """The world that a dataset's scans see: a town, the car's drive, and everybody who moves."""

    town: Scene
    drive: EgoDrive | UserDrive
    movers: tuple[Mover, ...]


@dataclass(frozen=True)
class _Failure:
    """What a worker sends when a scan could not be made."""

    story: str


def make_scans(
    out: Path,
    config: SimulationConfig,
    scenery: SceneSetup,
    *,
    workers: int,
    threads: int | None,
    report: Callable[[int], None],
) -> None:
    """Make those of the config's scans that `out` lacks; `report` gets the number that are there.

    Raises:
        WorkerError: a worker died or failed.
    """
    report(0)
    if workers > 1:
        WorkerPool(out, config, scenery, workers=workers, threads=threads).make(config.scans, report)
        return
    maker = ScanWriter(out, config, scenery, threads=threads)
    # Packing the files of a scan leaves the processors to the next one.
    with ThreadPoolExecutor(1) as clerk:
        writing: Future[None] | None = None
        for index in range(config.scans):
            scan = maker.simulated(index)
            if writing is not None:
                writing.result()
                report(index)
            writing = clerk.submit(maker.write, scan) if scan is not None else None
            if scan is None:
                report(index + 1)
        if writing is not None:
            writing.result()
    report(config.scans)


def scan_folders(config: SimulationConfig) -> tuple[str, ...]:
    """Return the folders that hold a file of every scan, all of the same name; pictures come first."""
    folders = (config.folder_layout.scans_folders[0], "truth")
    return (*folders, "beat") if config.keep_beat else folders


def whole_scans(out: Path, config: SimulationConfig) -> set[str]:
    """Return the names of the scans in `out` of which no file is missing or cut short."""
    stems = {path.stem for path in (out / scan_folders(config)[0]).glob("*.png")}
    return {stem for stem in stems if stem.isdecimal() and _is_whole(out, config, stem)}


def _is_whole(out: Path, config: SimulationConfig, stem: str) -> bool:
    """Whether all files of a scan are there to their ends and its picture is undamaged."""
    archives = [out / name / f"{stem}.npz" for name in scan_folders(config)[1:]]
    return is_whole_png(config.folder_layout.scan_path(out, stem)) and all(map(ends_as_archive, archives))


class ScanWriter:
    """Makes scans of a configuration and writes them with their truth."""

    def __init__(
        self, out: Path, config: SimulationConfig, scenery: SceneSetup, *, threads: int | None
    ) -> None:
        """`threads` for Dr.Jit in this process; None leaves it as it is."""
        from echoscape.sim.numerics.malloc import keep_freed_memory
        from echoscape.sim.raytracing.mitsuba_backend import set_threads
        from echoscape.sim.simulator import Simulator

        keep_freed_memory()

        if threads is not None:
            set_threads(threads)
        self._out, self._config = out, config
        self._simulator = Simulator(
            scenery.town,
            scenery.drive,
            scenery.movers,
            seed=config.seed,
            sensor=config.sensor,
            settings=config.trace,
            artefacts=config.artefacts,
            surfaces=config.surfaces,
        )

    def make(self, index: int) -> None:
        """Make scan `index` with all its files, unless it is there."""
        scan = self.simulated(index)
        if scan is not None:
            self.write(scan)

    def simulated(self, index: int) -> PolarScan | None:
        """Return scan `index`, None where it is there already."""
        layout, times_s = self._config.folder_layout, self._simulator.revolution(index).times_s
        stem = layout.stem(EPOCH_US + np.rint(times_s * 1e6).astype(np.int64))
        if _is_whole(self._out, self._config, stem):
            return None
        scan = self._simulator.scan(index, keep_beat=self._config.keep_beat)
        if scan.truth is None or layout.stem(scan.timestamp_us) != stem:
            raise WorkerError(
                f"scan {index} has no truth, or is named {layout.stem(scan.timestamp_us)} instead of {stem}"
            )
        return scan

    def write(self, scan: PolarScan) -> None:
        """Write a scan's files; its picture is written last and so stands for all of it."""
        layout = self._config.folder_layout
        stem = layout.stem(scan.timestamp_us)
        if scan.truth is not None:
            write_truth(self._out / "truth" / f"{stem}.npz", scan.truth)
        if scan.beat is not None:
            write_beat(self._out / "beat" / f"{stem}.npz", scan.beat)
        layout.write_scan(layout.scan_path(self._out, stem), scan)


class WorkerPool:
    """Worker processes and the pipes to them."""

    def __init__(
        self, out: Path, config: SimulationConfig, scenery: SceneSetup, *, workers: int, threads: int | None
    ) -> None:
        self._out, self._config, self._scenery = out, config, scenery
        self._threads = threads or max(1, (os.cpu_count() or 1) // workers)
        self._workers = workers
        self._hands: dict[Connection, BaseProcess] = {}
        self._busy: dict[Connection, int] = {}

    def make(self, scans: int, report: Callable[[int], None]) -> None:
        """Hand out the scans one by one until all are made; whatever happens, no process stays behind."""
        town_file = temporary_beside(self._out / "town")
        try:
            town_file.write_bytes(pickle.dumps(self._scenery, protocol=pickle.HIGHEST_PROTOCOL))
            self._start(town_file)
            done, to_do = 0, iter(range(scans))
            self._busy = {pipe: -1 for pipe in self._hands}
            while self._busy:
                for pipe in cast("list[Connection]", wait(list(self._busy))):
                    done += self._answer(pipe) >= 0
                    self._hand_out(pipe, to_do)
                report(done)
        finally:
            self._stop()
            remove_temporaries(self._out)

    def _start(self, town_file: Path) -> None:
        """Start the workers, each with its own Python, so that none inherits threads or compiled kernels."""
        context = multiprocessing.get_context("spawn")
        for number in range(self._workers):
            ours, theirs = context.Pipe()
            arguments = (theirs, town_file, self._out, self._config, self._threads)
            process = context.Process(target=_work, args=arguments, name=f"worker {number + 1}", daemon=True)
            process.start()
            theirs.close()
            self._hands[ours] = process

    def _hand_out(self, pipe: Connection, to_do: Iterator[int]) -> None:
        """Give a worker its next scan, or nothing more."""
        index = next(to_do, None)
        if index is None:
            del self._busy[pipe]
            return
        self._busy[pipe] = index
        try:
            pipe.send(index)
        except OSError as error:
            raise self._death(pipe) from error

    def _answer(self, pipe: Connection) -> int:
        """Return the scan that a worker reports as made, -1 when it reports that it is ready."""
        try:
            answer = pipe.recv()
        except (EOFError, OSError) as error:
            raise self._death(pipe) from error
        if isinstance(answer, _Failure):
            raise WorkerError(f"{self._hands[pipe].name} failed while {self._doing(pipe)}:\n{answer.story}")
        return self._busy[pipe]

    def _death(self, pipe: Connection) -> WorkerError:
        """Return the error that says how the worker behind a broken pipe ended, and at what."""
        process = self._hands[pipe]
        process.join(10)
        return WorkerError(f"{process.name} died while {self._doing(pipe)} ({_ending(process.exitcode)})")

    def _doing(self, pipe: Connection) -> str:
        index = self._busy[pipe]
        return f"making scan {index}" if index >= 0 else "starting"

    def _stop(self) -> None:
        for pipe, process in self._hands.items():
            pipe.close()
            process.terminate()
        for process in self._hands.values():
            process.join()


def _ending(code: int | None) -> str:
    if code is not None and code < 0:
        return f"signal {signal.Signals(-code).name}"
    return f"exit code {code}"


def _work(pipe: Connection, town_file: Path, out: Path, config: SimulationConfig, threads: int) -> None:
    """Make the scans that come through the pipe until it closes; Ctrl-C is the parent's business."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        scenery = pickle.loads(town_file.read_bytes())
        maker = ScanWriter(out, config, scenery, threads=threads)
        pipe.send(None)
        while True:
            maker.make(pipe.recv())
            pipe.send(None)
    except (EOFError, BrokenPipeError, ConnectionResetError):
        return
    except Exception:
        pipe.send(_Failure(traceback.format_exc()))
