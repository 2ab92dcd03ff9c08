"""The world of a configuration before anybody else is on the road: what stands in it, its targets, the car's drive.

Targets come in once the drive is known, since they may be placed as seen from its start; whatever of one's
own stands in the drive's way is refused.
"""

from dataclasses import dataclass

import numpy as np

from echoscape.scenes.core.scene import Scene
from echoscape.scenes.core.target_meshes import with_targets
from echoscape.scenes.driving.clearance import first_contact
from echoscape.scenes.driving.ego_drive import EgoDrive, plan_ego_drive
from echoscape.scenes.io.strict_toml import SceneError
from echoscape.scenes.io.target_toml import placed_targets
from echoscape.scenes.io.user_drive import UserDrive
from echoscape.scenes.io.user_scene import build_own_scene
from echoscape.scenes.town.build import build_town
from echoscape.sim.generation.config import SimulationConfig


@dataclass(frozen=True, kw_only=True)
class SceneSetup:
    """A town with its targets, and the drive through it."""

    town: Scene
    drive: EgoDrive | UserDrive


def build_scene(config: SimulationConfig, *, whole_drive: bool = False) -> SceneSetup:
    """Build the world of `config`; `whole_drive` stands for however many scans a drive of one's own has.

    Raises:
        SceneError: a mesh is broken or a rule is missing, the drive is shorter than the scans or meets
            something of one's own; the message names it.
    """
    if config.scene is None:
        town = build_town(config.preset, seed=config.seed)
        drive = plan_ego_drive(town, seed=config.seed, duration_s=config.duration_s, settings=config.drive)
        names = ["a thing of the town"] * len(town.instance_class)
        targets, since = config.targets, len(names)
    else:
        world = build_own_scene(config.scene)
        town, drive, names = world.town, world.drive, [f"object {name!r}" for name in world.names]
        targets, since = (*config.scene.targets, *config.targets), 1
        if not whole_drive:
            _check_length(config, drive)
    placed = placed_targets(targets, start=drive.trajectory.pose(np.float64(0.0)))
    town = with_targets(town, placed)
    names += [f"target {number} ({target.kind})" for number, target in enumerate(placed, 1)]
    until_s = drive.duration_s if whole_drive else config.scans * config.longest_turn_s
    contact = first_contact(
        town, drive.trajectory, until_s=until_s, height_m=config.sensor.mount_height_m, since=since
    )
    if contact is not None:
        x, y = contact.place_m
        raise SceneError(
            f"the drive passes through {names[contact.instance]} {contact.time_s:.1f} s after its start, "
            f"at x {x:.1f} m, y {y:.1f} m"
        )
    return SceneSetup(town=town, drive=drive)


def _check_length(config: SimulationConfig, drive: UserDrive) -> None:
    """Refuse scans that the drive is too short for."""
    fit = int(drive.duration_s / config.longest_turn_s + 1e-9)
    if config.scans > fit:
        most = f"scans must be {fit} or fewer" if fit else "the drive must last a scan"
        raise SceneError(
            f"{most}: the drive lasts {drive.duration_s:.2f} s, a scan up to {config.longest_turn_s:.4f} s; "
            f"got {config.scans}"
        )
