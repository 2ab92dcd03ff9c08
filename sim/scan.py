"""One scan from a town, a drive and its movers: the door to the simulator.

simulator = Simulator(town, drive, movers, seed=7)
scan = simulator.scan(0)
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.trajectory import Trajectory
from echoscape.scenes.world import CLASSES, Mover, Town
from echoscape.sim.artefact_echoes import changed, speckled_grid
from echoscape.sim.artefacts import Artefacts
from echoscape.sim.cts350x import CTS350X
from echoscape.sim.echoes import Echoes
from echoscape.sim.filters import EchoFilter, selection
from echoscape.sim.interference import HEARD_M, other_radars
from echoscape.sim.intersection import World
from echoscape.sim.motion import MoverStates, RowPoses, Turn, mover_states, row_poses, turns
from echoscape.sim.polar_scan import EPOCH_US, PolarScan, ScanTruth
from echoscape.sim.quantiser import codes
from echoscape.sim.rain import rain_grid, rain_power_w
from echoscape.sim.receiver import Received, receive
from echoscape.sim.sensor import Sensor
from echoscape.sim.surface_settings import SurfaceSettings
from echoscape.sim.town_scene import TownScene
from echoscape.sim.trace import Tracer
from echoscape.sim.trace_settings import TraceSettings
from echoscape.sim.truth import Labeller, mover_boxes

_STAGES = {"turns": 301, "noise": 302, "phase_noise": 303, "rain": 306, "movers": 307}
"""Numbers of the stages that draw; 304 and 305 are those of `sim.interference`."""
_PATHS = ("motion_distortion", "movers")
"""Artefacts that change where rays go."""
_ECHOES = ("ghosts", "sidelobes", "doppler", "rain")
"""Artefacts that change traced echoes."""


@dataclass(frozen=True, kw_only=True)
class _Arriving:
    """What reaches the receiver in a scan.

    grid (A, fft_size / 2) complex64 [sqrt(W)], of `echoes` and of rain, whose mean power is rain_w, of the
    same shape [W], None without any.
    """

    echoes: Echoes
    grid: NDArray[np.complex64]
    rain_w: NDArray[np.float32] | None = None


class HasTrajectory(Protocol):
    """A drive, or anything else with a trajectory."""

    @property
    def trajectory(self) -> Trajectory:
        """The motion of the car that carries the radar."""
        ...


class Simulator:
    """Makes the scans of a drive through a town, any of them, in any order, with the same bytes."""

    def __init__(
        self,
        town: Town,
        drive: HasTrajectory,
        movers: Sequence[Mover] = (),
        *,
        seed: int,
        sensor: Sensor = CTS350X,
        settings: TraceSettings | None = None,
        artefacts: Artefacts | None = None,
        surfaces: SurfaceSettings | None = None,
    ) -> None:
        """`seed` decides rays, speckle and noise; town, drive and movers come with their own."""
        if seed < 0:
            raise ValueError(f"seed must be 0 or more, got {seed}")
        self.sensor = sensor
        self.artefacts = artefacts or Artefacts()
        self._seed = seed
        self._track = drive.trajectory
        self._movers = tuple(movers)
        self.instance_class = _instance_classes(town, movers)
        self._scene = TownScene(town, self._movers)
        self._tracer = Tracer(
            self._scene,
            sensor,
            settings or TraceSettings(),
            instance_class=self.instance_class,
            targets=town.targets,
            seed=seed,
            surfaces=surfaces,
        )
        self._labeller = Labeller(sensor, self.instance_class)
        self._turns: list[Turn] = []

    def _rng(self, scan: int, stage: str) -> np.random.Generator:
        return np.random.default_rng(np.random.SeedSequence([self._seed, scan, _STAGES[stage]]))

    def turn(self, index: int) -> Turn:
        """Return the times of scan `index`.

        Raises:
            ValueError: `index` is negative.
        """
        if index < 0:
            raise ValueError(f"index must be 0 or more, got {index}")
        if index >= len(self._turns):
            count = max(64, 2 * index)
            self._turns = turns(self.sensor, scans=count, rng=self._rng(0, "turns"))
        return self._turns[index]

    def echoes(self, index: int) -> Echoes:
        """Trace scan `index` and return its echoes as the artefacts leave them, before the receiver."""
        return changed(self._traced(index, self.artefacts), self.artefacts, self.sensor)

    def _traced(self, index: int, artefacts: Artefacts) -> Echoes:
        """Return the echoes of scan `index` as physics has them, of the paths that `artefacts` lets be."""
        states = self._states(self.turn(index), artefacts)
        return self._tracer.trace(self._poses(index, artefacts), states, ghosts=artefacts.ghosts > 0)

    def _poses(self, index: int, artefacts: Artefacts) -> RowPoses:
        """Return the antenna's motion through scan `index`."""
        return row_poses(
            self._track,
            self.turn(index),
            height_m=self.sensor.mount_height_m,
            distortion=artefacts.motion_distortion,
        )

    def scans(self, index: int, settings: Sequence[Artefacts], *, truth: bool = True) -> list[PolarScan]:
        """Make scan `index` under each of several artefact settings, tracing it once.

        Only settings that differ in motion distortion or movers, which change where rays go, are traced
        anew; those that differ in the receiver alone share its input. Each scan has the bytes that a
        simulator of its own would give it. Without `truth` they come without, in less time.
        """
        found: dict[Artefacts, PolarScan] = {}
        for alike in _alike(settings, _PATHS):
            ghosts = max(each.ghosts for each in alike)
            traced = self._traced(index, replace(alike[0], ghosts=ghosts))
            for same in _alike(alike, _ECHOES):
                echoes = changed(traced, same[0], self.sensor)
                for those in _alike(same, ("speckle",)):
                    arriving = self._arriving(index, echoes, those[0])
                    for each in those:
                        found[each] = self._received(index, arriving, each, truth=truth)
        return [found[each] for each in settings]

    def scan(
        self,
        index: int,
        *,
        echoes: Echoes | None = None,
        only: EchoFilter | None = None,
        without: EchoFilter | Sequence[EchoFilter] = (),
        keep_beat: bool = False,
    ) -> PolarScan:
        """Make scan `index` with its truth, and with its raw data where `keep_beat` asks for them.

        `only` and `without` leave out echoes by what made them; to ask much of one scan, trace its `echoes`
        once and hand them in. The receiver's draws are the same for all.
        """
        chosen = selection(only, without)
        left = chosen.echoes(self.echoes(index) if echoes is None else echoes, self.instance_class)
        artefacts = chosen.artefacts(self.artefacts)
        return self._received(index, self._arriving(index, left, artefacts), artefacts, keep_beat=keep_beat)

    def _arriving(self, index: int, echoes: Echoes, artefacts: Artefacts) -> _Arriving:
        """Return what reaches the receiver of echoes and rain."""
        grid = speckled_grid(echoes, self.sensor, speckle=artefacts.speckle)
        if not artefacts.rain:
            return _Arriving(echoes=echoes, grid=grid)
        states = self._states(self.turn(index), artefacts)
        edges_m = np.arange(self.sensor.fft_size // 2, dtype=np.float64) * self.sensor.bin_m
        clear = self._tracer.clear_share(self._poses(index, artefacts), states, edges_m)
        rain_w = rain_power_w(self.sensor, self._tracer.antenna, rate_mm_h=artefacts.rain, clear=clear)
        grid += rain_grid(rain_w, rng=self._rng(index, "rain"))
        return _Arriving(echoes=echoes, grid=grid, rain_w=rain_w)

    def _received(
        self,
        index: int,
        arriving: _Arriving,
        artefacts: Artefacts,
        *,
        keep_beat: bool = False,
        truth: bool = True,
    ) -> PolarScan:
        """Return what the receiver makes of what arrives."""
        turn, sensor = self.turn(index), self.sensor
        received = receive(
            arriving.grid,
            sensor,
            artefacts,
            noise_rng=self._rng(index, "noise"),
            phase_rng=self._rng(index, "phase_noise"),
            others=self._others(index, artefacts),
            keep_beat=keep_beat,
            parts=truth,
        )
        return PolarScan(
            codes=codes(received.power),
            timestamp_us=EPOCH_US + np.rint(turn.times_s * 1e6).astype(np.int64),
            encoder=_encoder(sensor),
            valid=np.ones(sensor.azimuths, np.bool_),
            bin_m=sensor.bin_m,
            truth=self._truth(turn, arriving, received, artefacts) if truth else None,
            rising=sensor.rising if sensor.chirps == "alternating" else None,
            encoder_per_turn=sensor.encoder_per_turn,
            beat=received.beat,
        )

    def _truth(self, turn: Turn, arriving: _Arriving, received: Received, artefacts: Artefacts) -> ScanTruth:
        """Return what is known of a scan because it was made."""
        middle = turn.middle_s
        return ScanTruth(
            cells=self._labeller.label(arriving.echoes, received, artefacts, rain_w=arriving.rain_w),
            pose=self._track.pose(turn.times_s),
            middle_pose=self._track.pose(np.float64(middle)),
            middle_us=EPOCH_US + round(middle * 1e6),
            saturated=received.saturated,
            first_m=arriving.echoes.first_m,
            boxes=mover_boxes(self._states(turn, artefacts)),
        )

    def _others(self, index: int, artefacts: Artefacts) -> NDArray[np.float32] | None:
        """Return what other cars' radars add to the beat signals, None where they are silent."""
        if not artefacts.interference:
            return None
        turn, poses = self.turn(index), self._poses(index, artefacts)
        states = self._states(turn, artefacts, reach_m=HEARD_M)
        return other_radars(
            World(self._scene, states, self.sensor.azimuths),
            states,
            poses,
            self.sensor,
            self._tracer.antenna,
            times_s=turn.times_s,
            eirp_w=artefacts.interference,
            rain_mm_h=artefacts.rain,
            seed=self._seed,
            scan=index,
        )

    def _states(self, turn: Turn, artefacts: Artefacts, *, reach_m: float | None = None) -> MoverStates:
        """Return the movers that are there within `reach_m`, or within the sensor's range."""
        near = self._track.pose(np.float64(turn.middle_s))
        return mover_states(
            [mover for mover in self._movers if self._is_there(mover, artefacts.movers)],
            turn,
            near=near,
            reach_m=self.sensor.range_m + 10.0 if reach_m is None else reach_m,
            distortion=artefacts.motion_distortion,
        )

    def _is_there(self, mover: Mover, share: float) -> bool:
        """Whether a mover is among the share of them that is there, in every scan alike."""
        if share in (0.0, 1.0):
            return share == 1.0
        draw = np.random.SeedSequence([self._seed, mover.instance, _STAGES["movers"]]).generate_state(1)[0]
        return bool(draw < share * 2**32)


def _alike(settings: Sequence[Artefacts], names: Sequence[str]) -> list[list[Artefacts]]:
    """Return the settings in groups that have the named artefacts in common."""
    groups: dict[tuple, list[Artefacts]] = {}
    for each in settings:
        groups.setdefault(tuple(getattr(each, name) for name in names), []).append(each)
    return list(groups.values())


def _encoder(sensor: Sensor) -> NDArray[np.uint16]:
    """Return the encoder count of each row."""
    step = sensor.encoder_per_turn // sensor.azimuths
    return (sensor.encoder_first + step * np.arange(sensor.azimuths)).astype(np.uint16)


def _instance_classes(town: Town, movers: Sequence[Mover]) -> NDArray[np.uint8]:
    """Return the class id of every instance id, standing or moving."""
    last = max([len(town.instance_class) - 1, *(mover.instance for mover in movers)])
    classes = np.zeros(last + 1, np.uint8)
    classes[: len(town.instance_class)] = town.instance_class
    for mover in movers:
        classes[mover.instance] = CLASSES.index(mover.prototype.class_name)
    return classes
