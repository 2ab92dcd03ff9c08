"""Options of the commands that build a world: a simulation's settings, a scene file, a file of test targets.

A scene and targets are TOML files, a map is an OpenStreetMap extract. What they hold becomes part of the
simulation's configuration.
"""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any, cast

import tyro

from echoscape.scenes.io.osm.extract import read_osm
from echoscape.scenes.io.scene_file import AnyScene
from echoscape.scenes.io.target_toml import AnyTarget, read_targets
from echoscape.scenes.io.user_scene import read_user_scene
from echoscape.sim.datasets.layouts.registry import LAYOUTS, LayoutName, layout_named
from echoscape.sim.generation.config import DEFAULT_PRESET, SimulationConfig

Preset = Annotated[str, tyro.conf.arg(help_behavior_hint=f"(default: {DEFAULT_PRESET})")]
"""A preset as an option, empty where it is not given."""


def _layout(words: list[str]) -> LayoutName:
    """Return the layout of this name; tyro prints the ValueError."""
    (name,) = words
    return cast("LayoutName", layout_named(name).name)


_LAYOUT = tyro.constructors.PrimitiveConstructorSpec[LayoutName | None](
    nargs=1,
    metavar=f"{{{','.join(LAYOUTS)}}}",
    instance_from_str=_layout,
    is_instance=lambda value: value is None or value in LAYOUTS,
    str_from_instance=lambda value: [str(value)],
)
"""How a layout is parsed: tyro itself would offer "None", and list the choices in another order each time."""


@dataclass(frozen=True, kw_only=True)
class SimulationOptions(SimulationConfig):
    """A simulation's configuration as options; what comes from files is not an option of its own."""

    preset: Preset = ""
    """Kind of world: town, suburb, industrial, motorway, open, yard or empty (a road on a plane, with
    traffic)."""
    layout: Annotated[
        LayoutName | None, _LAYOUT, tyro.conf.arg(help_behavior_hint="(default: the radar's own)")
    ] = None
    """Layout of the folder; by default that of the published scans of this radar, or Oxford's."""
    scene: tyro.conf.Suppress[tyro.conf.Fixed[AnyScene | None]] = None
    """Read from a file."""
    targets: tyro.conf.Suppress[tyro.conf.Fixed[tuple[AnyTarget, ...]]] = ()
    """Read from a file."""
    randomized: tyro.conf.Suppress[tyro.conf.Fixed[bool]] = False
    """Set by --randomize."""

    def __post_init__(self) -> None:
        """Check nothing yet: the configuration made of options and files is checked."""


@dataclass(frozen=True, kw_only=True)
class ScanOptions(SimulationOptions):
    """A simulation's configuration for a single scan, of which no folder is written."""

    scans: int = 40
    """Length of the drive in scans, four a second: which places it passes depends on it."""
    keep_beat: tyro.conf.Suppress[tyro.conf.Fixed[bool]] = False
    """For folders only."""
    layout: tyro.conf.Suppress[tyro.conf.Fixed[LayoutName | None]] = None
    """For folders only."""


def simulation_config(
    options: SimulationConfig, *, scene: Path | None, targets: Path | None, osm: Path | None
) -> SimulationConfig:
    """Combine options and files into the configuration of a simulation.

    Args:
        options: The options; their scene and targets hold where no file is named.
        scene: TOML file of a custom scene.
        targets: TOML file of test targets.
        osm: An OpenStreetMap extract.

    Returns:
        The configuration, checked.

    Raises:
        ValueError: The settings do not make a data set, or both a scene and a map are given.
        SceneError: A file cannot be read, or does not describe a scene or targets.
    """
    settings: dict[str, Any] = {each.name: getattr(options, each.name) for each in fields(SimulationConfig)}
    if scene is not None and osm is not None:
        raise ValueError("osm must not be given beside a scene")
    if osm is not None:
        settings["scene"] = read_osm(osm)
    if scene is not None:
        settings["scene"] = read_user_scene(scene)
    if targets is not None:
        settings["targets"] = read_targets(targets)
    return SimulationConfig(**settings)
