"""One scan from a town, a drive and its movers: the door to the simulator.

simulator = Simulator(town, drive, movers, seed=7)
scan = simulator.scan(0)
"""

from collections.abc import Sequence
from dataclasses import replace
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
from echoscape.sim.interference import other_radars
from echoscape.sim.intersection import World
from echoscape.sim.motion import MoverStates, Turn, mover_states, row_poses, turns
from echoscape.sim.polar_scan import EPOCH_US, PolarScan, ScanTruth
from echoscape.sim.quantiser import codes
from echoscape.sim.rain import rain_grid
from echoscape.sim.receiver import receive
from echoscape.sim.sensor import Sensor
from echoscape.sim.surface_settings import SurfaceSettings
from echoscape.sim.town_scene import TownScene
from echoscape.sim.trace import Tracer
from echoscape.sim.trace_settings import TraceSettings
from echoscape.sim.truth import Labeller, mover_boxes

_STAGES = {"turns": 301, "noise": 302, "phase_noise": 303, "interference": 305, "rain": 306, "movers": 307}


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
        turn = self.turn(index)
        rolling = artefacts.motion_distortion
        poses = row_poses(self._track, turn, height_m=self.sensor.mount_height_m, distortion=rolling)
        return self._tracer.trace(poses, self._states(turn, artefacts), ghosts=artefacts.ghosts > 0)

    def scans(self, index: int, settings: Sequence[Artefacts]) -> list[PolarScan]:
        """Make scan `index` under each of several artefact settings, tracing it once.

        Only settings that differ in motion distortion or movers, which change where rays go, are traced
        anew.
        """
        traced: dict[tuple[float, float], Echoes] = {}
        scans = []
        for artefacts in settings:
            paths = (artefacts.motion_distortion, artefacts.movers)
            if paths not in traced:
                every = [each.ghosts for each in settings if (each.motion_distortion, each.movers) == paths]
                traced[paths] = self._traced(index, replace(artefacts, ghosts=max(every)))
            echoes = changed(traced[paths], artefacts, self.sensor)
            scans.append(self._received(index, echoes, artefacts, keep_beat=False))
        return scans

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
        return self._received(index, left, chosen.artefacts(self.artefacts), keep_beat=keep_beat)

    def _received(self, index: int, echoes: Echoes, artefacts: Artefacts, *, keep_beat: bool) -> PolarScan:
        """Return what the receiver makes of echoes."""
        turn, sensor = self.turn(index), self.sensor
        grid = speckled_grid(echoes, sensor, speckle=artefacts.speckle)
        if artefacts.rain:
            grid += rain_grid(
                sensor, self._tracer.antenna, rate_mm_h=artefacts.rain, rng=self._rng(index, "rain")
            )
        states = self._states(turn, artefacts)
        received = receive(
            grid,
            sensor,
            artefacts,
            noise_rng=self._rng(index, "noise"),
            phase_rng=self._rng(index, "phase_noise"),
            others=self._others(index, states, artefacts),
            keep_beat=keep_beat,
        )
        middle = turn.middle_s
        truth = ScanTruth(
            cells=self._labeller.label(echoes, received, artefacts),
            pose=self._track.pose(turn.times_s),
            middle_pose=self._track.pose(np.float64(middle)),
            middle_us=EPOCH_US + round(middle * 1e6),
            saturated=received.saturated,
            first_m=echoes.first_m,
            boxes=mover_boxes(states),
        )
        return PolarScan(
            codes=codes(received.power),
            timestamp_us=EPOCH_US + np.rint(turn.times_s * 1e6).astype(np.int64),
            encoder=_encoder(sensor),
            valid=np.ones(sensor.azimuths, np.bool_),
            bin_m=sensor.bin_m,
            truth=truth,
            rising=sensor.rising if sensor.chirps == "alternating" else None,
            encoder_per_turn=sensor.encoder_per_turn,
            beat=received.beat,
        )

    def _others(self, index: int, states: MoverStates, artefacts: Artefacts) -> NDArray[np.float32] | None:
        """Return what other cars' radars add to the beat signals, None where they are silent."""
        if not artefacts.interference:
            return None
        turn, rolling = self.turn(index), artefacts.motion_distortion
        poses = row_poses(self._track, turn, height_m=self.sensor.mount_height_m, distortion=rolling)
        return other_radars(
            World(self._scene, states, self.sensor.azimuths),
            states,
            poses,
            self.sensor,
            self._tracer.antenna,
            times_s=turn.times_s,
            eirp_w=artefacts.interference,
            seed=self._seed,
            rng=self._rng(index, "interference"),
        )

    def _states(self, turn: Turn, artefacts: Artefacts) -> MoverStates:
        near = self._track.pose(np.float64(turn.middle_s))
        return mover_states(
            [mover for mover in self._movers if self._is_there(mover, artefacts.movers)],
            turn,
            near=near,
            reach_m=self.sensor.range_m + 10.0,
            distortion=artefacts.motion_distortion,
        )

    def _is_there(self, mover: Mover, share: float) -> bool:
        """Whether a mover is among the share of them that is there, in every scan alike."""
        if share in (0.0, 1.0):
            return share == 1.0
        draw = np.random.SeedSequence([self._seed, mover.instance, _STAGES["movers"]]).generate_state(1)[0]
        return bool(draw < share * 2**32)


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
