"""Simulates scans: rays through the scene, their echoes, the receiver, and the truth of every cell.

    simulator = Simulator(scene, drive, movers, seed=7)
    scan = simulator.scan(0)

Read `Simulator._simulate` first. Each of its steps depends on some artefacts only, so that several settings
of artefacts share the steps in which they agree; a single scan is the case of one setting.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.checks import check_whole
from echoscape.scenes.core.scene import Mover, Scene
from echoscape.scenes.core.surroundings import reached_area, surroundings
from echoscape.sim.datasets.polar_scan import PolarScan, ScanTruth
from echoscape.sim.echoes import Echoes, Origin
from echoscape.sim.effects.echo_filter import EchoFilter, Selection, selection
from echoscape.sim.effects.echo_scaling import scaled_echoes, speckled_grid
from echoscape.sim.effects.interference import INTERFERER_REACH_M, other_radars
from echoscape.sim.effects.rain import rain_grid, rain_power_w
from echoscape.sim.ground_truth.cell_labels import CellLabeller, mover_boxes
from echoscape.sim.ground_truth.dominant_echo import DominantEchoIndex
from echoscape.sim.kinematics.rolling_scan import Revolution
from echoscape.sim.kinematics.timeline import HasTrajectory, Timeline
from echoscape.sim.raytracing.mitsuba_scene import MitsubaScene, instance_classes
from echoscape.sim.raytracing.ray_sampling import PrimaryHits
from echoscape.sim.raytracing.scan_state import ScanState, scan_state
from echoscape.sim.raytracing.targets.mirror_faces import MirrorFaces, mirror_faces
from echoscape.sim.raytracing.tracer import Tracer
from echoscape.sim.receiver.front_end import FrontEnd, NoiseRealisation
from echoscape.sim.receiver.if_signal import BIN_CENTRE, CELL_BINS, grid_cells
from echoscape.sim.receiver.quantiser import codes
from echoscape.sim.receiver.receiver import Received, received
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.sensor.sensor import Sensor
from echoscape.sim.settings.artefacts import Artefacts, Strengths
from echoscape.sim.settings.surfaces import SurfaceSettings
from echoscape.sim.settings.tracing import TraceSettings

_STAGES = {"noise": 302, "phase_noise": 303, "rain": 306}
"""Numbers of the random stages; 301 and 307 belong to `sim.kinematics.timeline`, 304 and 305 to
`sim.effects.interference`."""
_SPARE_M = 20.0
"""Distance from the rays of the antenna within which what is beside them matters: Fresnel zones, beam [m]."""
_PATH_ARTEFACTS = ("motion_distortion", "attitude", "movers")
"""Artefacts that change the paths of rays."""
_ECHO_ARTEFACTS = ("ghosts", "sidelobes", "doppler", "rain")
"""Artefacts that change traced echoes."""
_GRID_ARTEFACTS = ("speckle",)
"""Artefacts that change how echoes add up."""


@dataclass(frozen=True, kw_only=True)
class Propagation:
    """What rays give of a scan, before any artefact of echoes or receiver.

    Attributes:
        state: Times, poses, moving objects and ray scene.
        echoes: The traced echoes, or those that were given instead.
        clear_share: Share of the two-way beam that reaches each cell of the grid (A, fft_size / 4) float32;
            None without rain.
        interferers: The same scan with all vehicles whose radars may interfere; None without interference.
    """

    state: ScanState
    echoes: Echoes
    clear_share: NDArray[np.float32] | None
    interferers: ScanState | None


@dataclass(frozen=True, kw_only=True)
class ReceiverInput:
    """What reaches the receiver in a scan.

    Attributes:
        dominant: The echoes, by the cells that they dominate.
        front_end: The receiver up to the converter, fed with echoes and rain.
        rain_w: Mean power of rain on the grid (A, fft_size / 4) float32 [W]; None without rain.
    """

    dominant: DominantEchoIndex
    front_end: FrontEnd
    rain_w: NDArray[np.float32] | None = None


class Simulator:
    """Simulates the scans of a drive through a scene, any of them in any order with the same bytes."""

    def __init__(
        self,
        scene: Scene,
        drive: HasTrajectory,
        movers: Sequence[Mover] = (),
        *,
        seed: int,
        sensor: Sensor = CTS350X,
        settings: TraceSettings | None = None,
        artefacts: Artefacts | None = None,
        surfaces: SurfaceSettings | None = None,
    ) -> None:
        """Load the scene into the ray tracer and draw the ray directions.

        Args:
            scene: All that is at rest.
            drive: The drive of the vehicle that carries the radar.
            movers: The moving objects.
            seed: Decides rays, speckle and noise; scene, drive and movers come with their own seeds.
            sensor: The radar.
            settings: Number of rays, bounces and the floor; None is the default.
            artefacts: Strengths of the artefacts; None is the sensor as it is, in dry weather.
            surfaces: Changes to the roughness of the materials; None is none.

        Raises:
            ValueError: `seed` is no whole number of 0 or more.
        """
        check_whole(seed=seed)
        self.sensor = sensor
        self.artefacts = artefacts or Artefacts()
        self.instance_class = instance_classes(scene, movers)
        self._seed = seed
        self._track = drive.trajectory
        self._timeline = Timeline(drive, movers, sensor=sensor, seed=seed)
        self._whole = scene, tuple(movers)
        self._scene = self._within(1.02 * sensor.range_m)
        self._tracer = Tracer(
            sensor,
            settings or TraceSettings(),
            instance_class=self.instance_class,
            targets=scene.targets,
            seed=seed,
            surfaces=surfaces,
            mirrors=_mirrors(scene),
            at_rest=self._scene.at_rest,
        )
        self._labeller = CellLabeller(sensor, self.instance_class)

    def revolution(self, index: int) -> Revolution:
        """Return the times of a scan.

        Args:
            index: Number of the scan, from 0.

        Returns:
            When each azimuth is measured.

        Raises:
            ValueError: `index` is no whole number of 0 or more.
        """
        return self._timeline.revolution(index)

    def echoes(self, index: int) -> Echoes:
        """Trace a scan.

        Args:
            index: Number of the scan, from 0.

        Returns:
            Its echoes under the artefacts of the simulator, before the receiver.

        Raises:
            ValueError: `index` is no whole number of 0 or more.
        """
        propagation = self._propagate(index, [self.artefacts], Selection())
        return scaled_echoes(propagation.echoes, self.artefacts, self.sensor)

    def scan(
        self,
        index: int,
        *,
        echoes: Echoes | None = None,
        only: EchoFilter | None = None,
        without: EchoFilter | Sequence[EchoFilter] = (),
        keep_beat: bool = False,
    ) -> PolarScan:
        """Simulate a scan and its truth.

        The random draws of the receiver are the same whatever is filtered.

        Args:
            index: Number of the scan, from 0.
            echoes: Echoes of this scan from `echoes`, so that several filters share one trace; None traces.
            only: Echoes to keep; None keeps all.
            without: Echoes to leave out, by one or several filters.
            keep_beat: Whether the raw data (beat signals) are kept.

        Returns:
            The scan with its truth.

        Raises:
            ValueError: `index` is no whole number of 0 or more, a filter is not an `EchoFilter`, or `echoes`
                were traced for another scan or seed.
        """
        origin = Origin(scan=index, seed=self._seed)
        if echoes is not None and echoes.origin not in (None, origin):
            raise ValueError(f"echoes must be of {origin}, got {echoes.origin}")
        filters = selection(only, without)
        scans = self._simulate(index, [self.artefacts], filters=filters, echoes=echoes, keep_beat=keep_beat)
        return scans[0]

    def scans(self, index: int, settings: Sequence[Artefacts], *, truth: bool = True) -> list[PolarScan]:
        """Simulate a scan under several settings of artefacts, each step once for all that agree in it.

        Rays are traced again only for settings that differ in motion distortion, attitude or moving objects.
        Each scan has the bytes that a simulator with this setting alone would give it.

        Args:
            index: Number of the scan, from 0.
            settings: Settings of artefacts.
            truth: Whether the scans get their truth; without it they take less time.

        Returns:
            One scan per setting, in order. Settings of the same strengths share one scan.

        Raises:
            ValueError: `index` is no whole number of 0 or more.
        """
        return self._simulate(index, settings, filters=Selection(), truth=truth)

    def _simulate(
        self,
        index: int,
        settings: Sequence[Artefacts],
        *,
        filters: Selection,
        echoes: Echoes | None = None,
        keep_beat: bool = False,
        truth: bool = True,
    ) -> list[PolarScan]:
        """Simulate a scan under each setting: rays, echoes, filters, receiver, truth.

        `echoes`, where given, stand for traced echoes under the artefacts of the only setting.
        """
        check_whole(index=index)
        # None may stand for a number, so settings are compared by their strengths.
        strengths = [each.strengths(self.sensor) for each in settings]
        noise = self._noise(index)
        simulated: dict[Strengths, PolarScan] = {}
        for same_paths in _grouped(dict(zip(strengths, settings, strict=True)).values(), _PATH_ARTEFACTS):
            propagation = self._propagate(index, same_paths, filters, given=echoes)
            for same_echoes in _grouped(same_paths, _ECHO_ARTEFACTS):
                present = propagation.echoes
                if echoes is None:
                    present = scaled_echoes(present, same_echoes[0], self.sensor)
                dominant = self._labeller.dominant_echoes(filters.echoes(present, self.instance_class))
                for same_grid in _grouped(same_echoes, _GRID_ARTEFACTS):
                    shared = filters.artefacts(same_grid[0])
                    incoming = self._receiver_input(propagation, dominant, shared, noise)
                    for setting in same_grid:
                        left = filters.artefacts(setting)
                        simulated[setting.strengths(self.sensor)] = self._polar_scan(
                            propagation, incoming, left, keep_beat=keep_beat, truth=truth
                        )
        return [simulated[each] for each in strengths]

    def _rng(self, index: int, stage: str) -> np.random.Generator:
        """Return the generator of a random stage of a scan."""
        return np.random.default_rng(np.random.SeedSequence([self._seed, index, _STAGES[stage]]))

    def _noise(self, index: int) -> NoiseRealisation:
        """Return the random draws of the receiver in a scan."""
        noise_rng, phase_rng = self._rng(index, "noise"), self._rng(index, "phase_noise")
        return NoiseRealisation(self.sensor, noise_rng=noise_rng, phase_rng=phase_rng)

    def _propagate(
        self, index: int, settings: Sequence[Artefacts], filters: Selection, given: Echoes | None = None
    ) -> Propagation:
        """Send the rays of a scan for settings that agree in their paths; `given` echoes are not traced."""
        revolution = self.revolution(index)
        poses = self._timeline.poses(revolution, settings[0])
        movers = self._timeline.movers(revolution, settings[0])
        state = scan_state(self._scene, index=index, revolution=revolution, poses=poses, movers=movers)
        left = [filters.artefacts(each) for each in settings]
        rain = any(each.rain for each in left)
        clear_share = None
        if given is None or rain:
            primary = self._tracer.launch(state)
            clear_share = self._tracer.clear_share(primary, self._grid_edges_m()) if rain else None
            echoes = self._traced(state, primary, settings) if given is None else given
        else:
            echoes = given
        interferers = None
        if any(each.interference for each in left):
            vehicles = self._timeline.movers(revolution, settings[0], reach_m=INTERFERER_REACH_M)
            interferers = state.with_movers(self._interferer_scene, vehicles)
        return Propagation(state=state, echoes=echoes, clear_share=clear_share, interferers=interferers)

    @cached_property
    def _interferer_scene(self) -> MitsubaScene:
        """All that may hide the radars of other vehicles, which are heard from farther than echoes."""
        return self._within(max(INTERFERER_REACH_M, 1.02 * self.sensor.range_m))

    def _within(self, reach_m: float) -> MitsubaScene:
        """Load what the rays of the drive can reach: a short drive sees a tenth of a town."""
        scene, movers = self._whole
        area = reached_area(self._track, reach_m=reach_m + _SPARE_M)
        return MitsubaScene(surroundings(scene, area), movers)

    def _grid_edges_m(self) -> NDArray[np.float64]:
        """Return the near edges of the cells of the grid (fft_size / 4,) [m]."""
        first = BIN_CENTRE - CELL_BINS / 2
        cells = np.arange(grid_cells(self.sensor), dtype=np.float64)
        return np.maximum((cells * CELL_BINS + first) * self.sensor.bin_m, 0)

    def _traced(self, state: ScanState, primary: PrimaryHits, settings: Sequence[Artefacts]) -> Echoes:
        """Trace a scan, ghosts included where a setting has them."""
        echoes = self._tracer.trace(state, primary, ghosts=any(each.ghosts for each in settings))
        return replace(echoes, origin=Origin(scan=state.index, seed=self._seed))

    def _receiver_input(
        self,
        propagation: Propagation,
        dominant: DominantEchoIndex,
        artefacts: Artefacts,
        noise: NoiseRealisation,
    ) -> ReceiverInput:
        """Add up echoes and rain on the grid of the receiver."""
        grid = speckled_grid(dominant.echoes, self.sensor, speckle=artefacts.speckle)
        rain_w = None
        if propagation.clear_share is not None and artefacts.rain:
            rain_w = rain_power_w(
                self.sensor,
                self._tracer.antenna,
                rate_mm_h=artefacts.rain,
                clear=propagation.clear_share,
            )
            grid += rain_grid(rain_w, rng=self._rng(propagation.state.index, "rain"))
        front_end = FrontEnd(grid, self.sensor, noise)
        return ReceiverInput(dominant=dominant, front_end=front_end, rain_w=rain_w)

    def _polar_scan(
        self,
        propagation: Propagation,
        incoming: ReceiverInput,
        artefacts: Artefacts,
        *,
        keep_beat: bool,
        truth: bool,
    ) -> PolarScan:
        """Return the scan that the receiver makes of what reaches it, with its truth."""
        state, sensor = propagation.state, self.sensor
        output = received(
            incoming.front_end,
            sensor,
            artefacts,
            others=self._interference(propagation, artefacts),
            keep_beat=keep_beat,
            parts=truth,
        )
        return PolarScan(
            codes=codes(output.power),
            timestamp_us=sensor.epoch_us + np.rint(state.revolution.times_s * 1e6).astype(np.int64),
            encoder=sensor.encoder,
            valid=np.ones(sensor.azimuths, np.bool_),
            bin_m=sensor.bin_m,
            truth=self._truth(state, incoming, output, artefacts) if truth else None,
            rising=sensor.rising if sensor.chirps == "alternating" else None,
            encoder_per_turn=sensor.encoder_per_turn,
            beat=output.beat,
        )

    def _interference(self, propagation: Propagation, artefacts: Artefacts) -> NDArray[np.float32] | None:
        """Return what the radars of other vehicles add to the beat signals, None without interference."""
        if propagation.interferers is None or not artefacts.interference:
            return None
        return other_radars(
            propagation.interferers,
            self.sensor,
            self._tracer.antenna,
            eirp_w=artefacts.interference,
            rain_mm_h=artefacts.rain,
            seed=self._seed,
        )

    def _truth(
        self, state: ScanState, incoming: ReceiverInput, output: Received, artefacts: Artefacts
    ) -> ScanTruth:
        """Return what is known of a scan because it was simulated."""
        middle_s = state.revolution.middle_s
        return ScanTruth(
            cells=self._labeller.label(incoming.dominant, output, artefacts, rain_w=incoming.rain_w),
            pose=self._track.pose(state.revolution.times_s),
            middle_pose=self._track.pose(np.float64(middle_s)),
            middle_us=self.sensor.epoch_us + round(middle_s * 1e6),
            saturated=output.saturated,
            first_obstacle_m=incoming.dominant.echoes.first_obstacle_m,
            boxes=mover_boxes(state.movers, state.poses, self.sensor),
            attitude=artefacts.attitude * self._track.tilt(state.revolution.times_s),
        )


def _mirrors(scene: Scene) -> MirrorFaces | None:
    """Return the faces in which coherent targets may be seen, None in a scene without such targets."""
    return mirror_faces(scene) if any(each.target.coherent for each in scene.targets) else None


def _grouped(settings: Iterable[Artefacts], names: Sequence[str]) -> list[list[Artefacts]]:
    """Return the settings in groups that agree in the named artefacts."""
    groups: dict[tuple, list[Artefacts]] = {}
    for each in settings:
        groups.setdefault(tuple(getattr(each, name) for name in names), []).append(each)
    return list(groups.values())
