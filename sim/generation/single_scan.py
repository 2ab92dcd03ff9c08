"""One scan from a preset and a seed: the world, the drive and the traffic are built on the way.

A scan has the bytes that the same scan of a data set has, so that a test can start from a line of Python and
later read the folder that `echoscape simulate` writes.
"""

from collections.abc import Mapping
from functools import lru_cache

from echoscape.scenes.core.checks import check_kind, check_whole
from echoscape.scenes.io.scene_file import AnyScene
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.setup import SceneSetup, add_traffic, build_scene
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.sensor.registry import sensor_from
from echoscape.sim.sensor.sensor import Sensor
from echoscape.sim.settings.artefacts import Artefacts, artefacts_from
from echoscape.sim.simulator import Simulator

DEFAULT_SCANS = SimulationConfig(preset="empty").scans


def scan(
    preset: str = "",
    *,
    scene: AnyScene | None = None,
    seed: int = 0,
    index: int = 0,
    scans: int = DEFAULT_SCANS,
    sensor: Sensor | str = CTS350X,
    artefacts: Artefacts | Mapping[str, float | bool | None] | None = None,
) -> PolarScan:
    """Simulate one scan of a drive through a procedural world, with its truth.

    Building the world takes seconds; it is kept for the next call with the same arguments but `index`.

    Args:
        preset: Kind of world: town (the default), suburb, industrial, motorway, open, yard or empty (a road
            on a plane, with traffic).
        scene: A custom scene or a map in place of a preset, see `read_user_scene` and `read_osm` of
            `echoscape.scenes`.
        seed: Seed of the world, the drive, the traffic, rays, speckle and noise.
        index: Number of the scan, from 0.
        scans: Scans of the whole drive, as in `echoscape simulate --scans`.
        sensor: The radar, its name ("cts_small"), or the path of a TOML file.
        artefacts: Strengths of the artefacts, all or by name (`{"rain": 10}`); None is the sensor as it is,
            in dry weather.

    Returns:
        Scan `index` of the data set that `echoscape simulate` writes with these settings.

    Raises:
        ValueError: `index` is not below `scans`, there is no radar or artefact of a name, or another argument
            cannot be simulated.
        TypeError: `sensor` is neither a `Sensor` nor a name, or `artefacts` are neither `Artefacts` nor
            strengths by name.
        SceneError: The scene's file has changed or is broken, or its drive too short or obstructed.
    """
    check_kind(Sensor | str, sensor=sensor)
    check_whole(scans=scans, least=1)
    check_whole(index=index, least=None)
    if not 0 <= index < scans:
        raise ValueError(f"index must be from 0 to scans - 1 ({scans - 1}), got {index}")
    config = SimulationConfig(
        preset=preset,
        scene=scene,
        seed=seed,
        scans=scans,
        sensor=sensor_from(sensor) if isinstance(sensor, str) else sensor,
        artefacts=artefacts_from(artefacts),
    )
    return _simulator(config).scan(index)


def build_simulator(config: SimulationConfig) -> Simulator:
    """Build the world of a configuration and load it into the ray tracer.

    Args:
        config: The configuration.

    Returns:
        The simulator of its scans.

    Raises:
        SceneError: A custom scene is broken, or its drive too short or obstructed.
    """
    return simulator_of(add_traffic(build_scene(config), config), config)


def simulator_of(setup: SceneSetup, config: SimulationConfig) -> Simulator:
    """Load a world that is built into the ray tracer.

    Args:
        setup: Scene, drive and traffic.
        config: The configuration from which they were built.

    Returns:
        The simulator of its scans.
    """
    return Simulator(
        setup.scene,
        setup.drive,
        setup.movers,
        seed=config.seed,
        sensor=config.sensor,
        settings=config.trace,
        artefacts=config.artefacts,
        surfaces=config.surfaces,
    )


_simulator = lru_cache(maxsize=1)(build_simulator)
