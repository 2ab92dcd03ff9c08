"""The world that a command is told of: flags of a configuration, a scene of one's own, test targets.

Scenes and targets come as TOML files, whose contents go into the config.
"""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any, cast

import tyro

from echoscape.scenes.io.target_toml import AnyTarget, read_targets
from echoscape.scenes.io.user_scene import UserScene, read_user_scene
from echoscape.sim.datasets.layouts.registry import LAYOUTS, LayoutName, layout_named
from echoscape.sim.generation.config import DEFAULT_PRESET, SimulationConfig

Preset = Annotated[str, tyro.conf.arg(help_behavior_hint=f"(default: {DEFAULT_PRESET})")]
"""A preset as a flag, empty where nothing is said."""


def _layout(words: list[str]) -> LayoutName:
    """Return the layout of this name; tyro tells the ValueError."""
    (name,) = words
    return cast("LayoutName", layout_named(name).name)


_LAYOUT = tyro.constructors.PrimitiveConstructorSpec[LayoutName | None](
    nargs=1,
    metavar=f"{{{','.join(LAYOUTS)}}}",
    instance_from_str=_layout,
    is_instance=lambda value: value is None or value in LAYOUTS,
    str_from_instance=lambda value: [str(value)],
)
"""How a layout is read: tyro itself would offer "None", and list the choices in another order each time."""


@dataclass(frozen=True, kw_only=True)
class ConfigFlags(SimulationConfig):
    """A configuration as flags; what comes from files is no flag."""

    preset: Preset = ""
    """Kind of world: town, suburb, industrial, motorway, open or empty."""
    layout: Annotated[
        LayoutName | None, _LAYOUT, tyro.conf.arg(help_behavior_hint="(default: the radar's own)")
    ] = None
    """Layout of the folder; by default that in which the radar's real scans are published, or Oxford's."""
    scene: tyro.conf.Suppress[tyro.conf.Fixed[UserScene | None]] = None
    """Comes from a file."""
    targets: tyro.conf.Suppress[tyro.conf.Fixed[tuple[AnyTarget, ...]]] = ()
    """Come from a file."""
    randomized: tyro.conf.Suppress[tyro.conf.Fixed[bool]] = False
    """Set by --randomize."""

    def __post_init__(self) -> None:
        """Leave the checks to the configuration that is made of the flags and the files."""


@dataclass(frozen=True, kw_only=True)
class ScanFlags(ConfigFlags):
    """A configuration of which one scan is made and no folder is written."""

    scans: int = 40
    """Length of the drive in scans, four a second: which places it passes depends on it."""
    keep_beat: tyro.conf.Suppress[tyro.conf.Fixed[bool]] = False
    """Is for folders."""
    layout: tyro.conf.Suppress[tyro.conf.Fixed[LayoutName | None]] = None
    """Is for folders."""


def config_from_flags(
    flags: SimulationConfig, *, scene: Path | None, targets: Path | None
) -> SimulationConfig:
    """Return the configuration that flags and files make.

    Raises:
        ValueError: the settings make no dataset.
        SceneError: a file cannot be read, or describes no scene or no targets.
    """
    settings: dict[str, Any] = {each.name: getattr(flags, each.name) for each in fields(SimulationConfig)}
    settings["scene"] = None if scene is None else read_user_scene(scene)
    settings["targets"] = () if targets is None else read_targets(targets)
    return SimulationConfig(**settings)
