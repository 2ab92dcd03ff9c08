"""The scene of a simulation: its static world with test targets, the drive of the car, and the traffic.

Targets are placed once the drive is known, since they may be given relative to its start. A custom object or
target in the path of the drive is refused.
"""

import hashlib
from dataclasses import asdict, dataclass, replace

import numpy as np

from echoscape.scenes.core.scene import Mover, Scene
from echoscape.scenes.core.target_meshes import with_targets
from echoscape.scenes.driving.clearance import first_collision
from echoscape.scenes.driving.ego_drive import EgoDrive, plan_ego_drive
from echoscape.scenes.io.osm.build import build_osm_scene
from echoscape.scenes.io.osm.extract import OsmExtract
from echoscape.scenes.io.strict_toml import SceneError
from echoscape.scenes.io.target_toml import placed_targets
from echoscape.scenes.io.user_drive import UserDrive
from echoscape.scenes.io.user_scene import UserScene, build_user_scene
from echoscape.scenes.town.build import build_town
from echoscape.scenes.traffic.plan import plan_traffic
from echoscape.sim.datasets.files.record_file import record_bytes
from echoscape.sim.generation.cache import cached
from echoscape.sim.generation.config import SimulationConfig


@dataclass(frozen=True, kw_only=True)
class SceneSetup:
    """What the scans of a simulation see.

    Attributes:
        scene: The static world with its targets.
        drive: The drive of the car that carries the radar.
        movers: The other road users.
    """

    scene: Scene
    drive: EgoDrive | UserDrive
    movers: tuple[Mover, ...] = ()


def build_scene(config: SimulationConfig, *, whole_drive: bool = False) -> SceneSetup:
    """Build the world of a simulation and plan the drive, without traffic.

    Args:
        config: The configuration.
        whole_drive: Whether a custom drive is taken to its end, however many scans that makes.

    Returns:
        The scene and the drive.

    Raises:
        SceneError: The mesh of a custom scene is broken or lacks a rule, the drive is shorter than the scans,
            or a custom object or target is in its path; the message names it.
    """
    if not isinstance(config.scene, UserScene):
        scene = _town(config)
        drive = _drive(scene, config)
        names = ["an object of the town"] * len(scene.instance_class)
        targets, first_instance = config.targets, len(names)
        whole_drive = False
    else:
        world = build_user_scene(config.scene, seed=config.seed)
        scene, drive, names = world.scene, world.drive, [f"object {name!r}" for name in world.names]
        targets, first_instance = (*config.scene.targets, *config.targets), 1
        if not whole_drive:
            _check_length(config, drive)
    placed = placed_targets(targets, start=drive.trajectory.pose(np.float64(0.0)))
    scene = with_targets(scene, placed)
    names += [f"target {number} ({target.kind})" for number, target in enumerate(placed, 1)]
    until_s = drive.duration_s if whole_drive else config.scans * config.longest_revolution_s
    collision = first_collision(
        scene,
        drive.trajectory,
        until_s=until_s,
        height_m=config.sensor.mount_height_m,
        first_instance=first_instance,
    )
    if collision is not None:
        x, y = collision.position_m
        raise SceneError(
            f"the drive passes through {names[collision.instance]} {collision.time_s:.1f} s after its start, "
            f"at x {x:.1f} m, y {y:.1f} m"
        )
    return SceneSetup(scene=scene, drive=drive)


def add_traffic(setup: SceneSetup, config: SimulationConfig) -> SceneSetup:
    """Plan the other road users.

    Args:
        setup: The scene and the drive.
        config: The configuration, which gives seed and traffic settings.

    Returns:
        The setup with its movers; a custom scene, which has no roads, stays without.
    """
    if not isinstance(setup.drive, EgoDrive):
        return setup
    return replace(setup, movers=_traffic(setup.scene, setup.drive, config))


def _town(config: SimulationConfig) -> Scene:
    """Return the town, from the cache where it was built before."""
    settings = {"preset": config.preset, "seed": config.seed, **_map_of(config)}
    return cached("town", Scene, settings, lambda: _built(config))


def _built(config: SimulationConfig) -> Scene:
    """Build the world of a map or of a preset."""
    if isinstance(config.scene, OsmExtract):
        return build_osm_scene(config.scene, seed=config.seed)
    return build_town(config.preset, seed=config.seed)


def _map_of(config: SimulationConfig) -> dict[str, str]:
    """Return what tells one map from another; nothing for a preset."""
    return {"map": config.scene.sha256} if isinstance(config.scene, OsmExtract) else {}


def _drive(scene: Scene, config: SimulationConfig) -> EgoDrive:
    """Return the drive through a town, from the cache where it was planned before."""
    settings = {
        "preset": config.preset,
        "seed": config.seed,
        **_map_of(config),
        "duration_s": config.duration_s,
        "drive": asdict(config.drive),
    }
    return cached(
        "drive",
        EgoDrive,
        settings,
        lambda: plan_ego_drive(scene, seed=config.seed, duration_s=config.duration_s, settings=config.drive),
    )


def _traffic(scene: Scene, drive: EgoDrive, config: SimulationConfig) -> tuple[Mover, ...]:
    """Return the movers, from the cache where they were planned before for the same town and drive."""
    settings = {
        "preset": scene.preset,
        "seeds": [scene.seed, config.seed],
        **_map_of(config),
        "targets": [asdict(target) for target in scene.targets],
        "drive": hashlib.sha256(record_bytes(drive, EgoDrive, key="")).hexdigest(),
        "traffic": asdict(config.traffic),
    }
    return cached(
        "traffic",
        tuple[Mover, ...],
        settings,
        lambda: plan_traffic(scene, drive, seed=config.seed, settings=config.traffic),
    )


def _check_length(config: SimulationConfig, drive: UserDrive) -> None:
    """Refuse scans that the drive is too short for."""
    fit = int(drive.duration_s / config.longest_revolution_s + 1e-9)
    if config.scans > fit:
        most = f"scans must be {fit} or fewer" if fit else "the drive must last a scan"
        raise SceneError(
            f"{most}: the drive lasts {drive.duration_s:.2f} s, a scan up to "
            f"{config.longest_revolution_s:.5g} s; got {config.scans}"
        )
