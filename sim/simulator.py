"""One scan from a town, a drive and its movers: the door to the simulator.

simulator = Simulator(town, drive, movers, seed=7)
scan = simulator.scan(0)
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.scene import Mover, Scene
from echoscape.sim.datasets.polar_scan import EPOCH_US, PolarScan, ScanTruth
from echoscape.sim.echoes import Echoes, Origin
from echoscape.sim.effects.echo_filter import EchoFilter, selection
from echoscape.sim.effects.echo_scaling import changed, speckled_grid
from echoscape.sim.effects.interference import INTERFERER_REACH_M, other_radars
from echoscape.sim.effects.rain import rain_grid, rain_power_w
from echoscape.sim.ground_truth.cell_labels import CellLabeller, mover_boxes
from echoscape.sim.ground_truth.dominant_echo import DominantEchoIndex
from echoscape.sim.kinematics.rolling_scan import Revolution
from echoscape.sim.kinematics.timeline import HasTrajectory, Timeline
from echoscape.sim.raytracing.intersection import RayScene
from echoscape.sim.raytracing.mitsuba_scene import MitsubaScene, instance_classes
from echoscape.sim.raytracing.tracer import Tracer
from echoscape.sim.receiver.front_end import FrontEnd, NoiseRealisation
from echoscape.sim.receiver.quantiser import codes
from echoscape.sim.receiver.receiver import Received, received
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.sensor.sensor import Sensor
from echoscape.sim.settings.artefacts import Artefacts, Strengths
from echoscape.sim.settings.surfaces import SurfaceSettings
from echoscape.sim.settings.tracing import TraceSettings

_STAGES = {"noise": 302, "phase_noise": 303, "rain": 306}
"""Numbers of the stages that draw; 301 and 307 are of `sim.kinematics.timeline`, 304 and 305 of `sim.effects.interference`."""
_PATHS = ("motion_distortion", "movers")
"""Artefacts that change where rays go."""
_ECHOES = ("ghosts", "sidelobes", "doppler", "rain")
"""Artefacts that change traced echoes."""


@dataclass(frozen=True, kw_only=True)
class ReceiverInput:
    """What reaches the receiver in a scan.

    strongest: of its echoes; front_end: of echoes and rain; rain_w (A, fft_size / 2): mean power of rain on
    the grid [W], None without any.
    """

    strongest: DominantEchoIndex
    front_end: FrontEnd
    rain_w: NDArray[np.float32] | None = None


class Simulator:
    """Makes the scans of a drive through a town, any of them, in any order, with the same bytes."""

    def __init__(
        self,
        town: Scene,
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
        self._timeline = Timeline(drive, movers, sensor=sensor, seed=seed)
        self.instance_class = instance_classes(town, movers)
        self._scene = MitsubaScene(town, tuple(movers))
        self._tracer = Tracer(
            self._scene,
            sensor,
            settings or TraceSettings(),
            instance_class=self.instance_class,
            targets=town.targets,
            seed=seed,
            surfaces=surfaces,
        )
        self._labeller = CellLabeller(sensor, self.instance_class)

    def _rng(self, scan: int, stage: str) -> np.random.Generator:
        return np.random.default_rng(np.random.SeedSequence([self._seed, scan, _STAGES[stage]]))

    def revolution(self, index: int) -> Revolution:
        """Return the times of scan `index`.

        Raises:
            ValueError: `index` is negative.
        """
        return self._timeline.revolution(index)

    def echoes(self, index: int) -> Echoes:
        """Trace scan `index` and return its echoes as the artefacts leave them, before the receiver."""
        return changed(self._traced(index, self.artefacts), self.artefacts, self.sensor)

    def _traced(self, index: int, artefacts: Artefacts) -> Echoes:
        """Return the echoes of scan `index` as physics has them, of the paths that `artefacts` lets be."""
        poses, states = (
            self._timeline.poses(self.revolution(index), artefacts),
            self._timeline.movers(self.revolution(index), artefacts),
        )
        echoes = self._tracer.trace(poses, states, ghosts=artefacts.ghosts > 0)
        return replace(echoes, origin=Origin(scan=index, seed=self._seed))

    def scans(self, index: int, settings: Sequence[Artefacts], *, truth: bool = True) -> list[PolarScan]:
        """Make scan `index` under each of several artefact settings, tracing it once.

        Only settings that differ in motion distortion or movers, which change where rays go, are traced
        anew; those that differ in the receiver alone share its input. Each scan has the bytes that a
        simulator of its own would give it. Without `truth` they come without, in less time.
        """
        # What is as strong is the same scan: None may stand for a number, and settings may come twice.
        strengths = [each.strengths(self.sensor) for each in settings]
        different = dict(zip(strengths, settings, strict=True))
        draws = self._draws(index)
        found: dict[Strengths, PolarScan] = {}
        for alike in _alike(tuple(different.values()), _PATHS):
            ghosts = max(each.ghosts for each in alike)
            traced = self._traced(index, replace(alike[0], ghosts=ghosts))
            for same in _alike(alike, _ECHOES):
                strongest = self._labeller.strongest(changed(traced, same[0], self.sensor))
                for those in _alike(same, ("speckle",)):
                    arriving = self._arriving(index, strongest, those[0], draws)
                    for each in those:
                        scan = self._received(index, arriving, each, truth=truth)
                        found[each.strengths(self.sensor)] = scan
        return [found[each] for each in strengths]

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

        Raises:
            ValueError: `index` is negative, or `echoes` were traced for another scan or seed.
        """
        own = Origin(scan=index, seed=self._seed)
        if echoes is not None and echoes.origin not in (None, own):
            raise ValueError(f"echoes must be of {own}, got {echoes.origin}")
        chosen = selection(only, without)
        left = chosen.echoes(self.echoes(index) if echoes is None else echoes, self.instance_class)
        artefacts = chosen.artefacts(self.artefacts)
        arriving = self._arriving(index, self._labeller.strongest(left), artefacts, self._draws(index))
        return self._received(index, arriving, artefacts, keep_beat=keep_beat)

    def _draws(self, index: int) -> NoiseRealisation:
        """Return what the receiver draws in scan `index`."""
        noise_rng, phase_rng = self._rng(index, "noise"), self._rng(index, "phase_noise")
        return NoiseRealisation(self.sensor, noise_rng=noise_rng, phase_rng=phase_rng)

    def _arriving(
        self, index: int, strongest: DominantEchoIndex, artefacts: Artefacts, draws: NoiseRealisation
    ) -> ReceiverInput:
        """Return what reaches the receiver of echoes and rain."""
        grid = speckled_grid(strongest.echoes, self.sensor, speckle=artefacts.speckle)
        if not artefacts.rain:
            return ReceiverInput(strongest=strongest, front_end=FrontEnd(grid, self.sensor, draws))
        poses, states = (
            self._timeline.poses(self.revolution(index), artefacts),
            self._timeline.movers(self.revolution(index), artefacts),
        )
        edges_m = np.arange(self.sensor.fft_size // 2, dtype=np.float64) * self.sensor.bin_m
        clear = self._tracer.clear_share(poses, states, edges_m)
        rain_w = rain_power_w(self.sensor, self._tracer.antenna, rate_mm_h=artefacts.rain, clear=clear)
        grid += rain_grid(rain_w, rng=self._rng(index, "rain"))
        return ReceiverInput(strongest=strongest, front_end=FrontEnd(grid, self.sensor, draws), rain_w=rain_w)

    def _received(
        self,
        index: int,
        arriving: ReceiverInput,
        artefacts: Artefacts,
        *,
        keep_beat: bool = False,
        truth: bool = True,
    ) -> PolarScan:
        """Return what the receiver makes of what arrives."""
        turn, sensor = self.revolution(index), self.sensor
        made = received(
            arriving.front_end,
            sensor,
            artefacts,
            others=self._others(index, artefacts),
            keep_beat=keep_beat,
            parts=truth,
        )
        return PolarScan(
            codes=codes(made.power),
            timestamp_us=EPOCH_US + np.rint(turn.times_s * 1e6).astype(np.int64),
            encoder=_encoder(sensor),
            valid=np.ones(sensor.azimuths, np.bool_),
            bin_m=sensor.bin_m,
            truth=self._truth(index, arriving, made, artefacts) if truth else None,
            rising=sensor.rising if sensor.chirps == "alternating" else None,
            encoder_per_turn=sensor.encoder_per_turn,
            beat=made.beat,
        )

    def _truth(self, index: int, arriving: ReceiverInput, made: Received, artefacts: Artefacts) -> ScanTruth:
        """Return what is known of a scan because it was made."""
        turn = self.revolution(index)
        middle = turn.middle_s
        return ScanTruth(
            cells=self._labeller.label(arriving.strongest, made, artefacts, rain_w=arriving.rain_w),
            pose=self._track.pose(turn.times_s),
            middle_pose=self._track.pose(np.float64(middle)),
            middle_us=EPOCH_US + round(middle * 1e6),
            saturated=made.saturated,
            first_m=arriving.strongest.echoes.first_m,
            boxes=mover_boxes(self._timeline.movers(self.revolution(index), artefacts)),
        )

    def _others(self, index: int, artefacts: Artefacts) -> NDArray[np.float32] | None:
        """Return what other cars' radars add to the beat signals, None where they are silent."""
        if not artefacts.interference:
            return None
        states = self._timeline.movers(self.revolution(index), artefacts, reach_m=INTERFERER_REACH_M)
        return other_radars(
            RayScene(self._scene, states, self.sensor.azimuths),
            states,
            self._timeline.poses(self.revolution(index), artefacts),
            self.sensor,
            self._tracer.antenna,
            times_s=self.revolution(index).times_s,
            eirp_w=artefacts.interference,
            rain_mm_h=artefacts.rain,
            seed=self._seed,
            scan=index,
        )


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
