"""The settings of an ablation: drives, conditions, methods, and the record that a resumed run must match."""

import secrets
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from echoscape.eval.ablation.study.conditions import Condition, runs
from echoscape.eval.odometry.methods import MethodChoice
from echoscape.scenes.io.scene_file import is_scene_file, read_scene_file
from echoscape.sim.generation.cache import code_digest
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.manifest import manifest

FORMAT = 1
"""Version of the folder's format."""
CODE = "code_sha256"
"""Entry of ablation.json with the digest of the code that decides its results."""
_CODE_PACKAGES = ("scenes", "sim", "learn", "eval")
_UNKNOWN_CODE = f"unknown: edited while process {secrets.token_hex(8)} ran"
"""Stands for code that is newer than this process: no other process can continue what it does."""


@dataclass(frozen=True, kw_only=True)
class AblationDrive:
    """One drive through one world.

    Attributes:
        name: Name of its folders, such as "town_7".
        config: Its data set under the default condition.
    """

    name: str
    config: SimulationConfig


@dataclass(frozen=True, kw_only=True)
class AblationStudy:
    """An ablation: every method on every drive under every condition.

    Attributes:
        drives: The drives, of one radar and one number of scans.
        conditions: The conditions, the default one first.
        methods: The methods.
        keep_scans: Whether the scans are kept, with their truth; else they go once the methods ran on them.
    """

    drives: tuple[AblationDrive, ...]
    conditions: tuple[Condition, ...]
    methods: tuple[MethodChoice, ...]
    keep_scans: bool = False

    def __post_init__(self) -> None:
        """Refuse what is no ablation."""
        for what, names in (
            ("worlds", [each.name for each in self.drives]),
            ("methods", [each.name for each in self.methods]),
        ):
            if not names:
                raise ValueError(f"{what} must name one or more")
            for name in names:
                if names.count(name) > 1:
                    shown = world_of(name) if what == "worlds" else name
                    raise ValueError(f"{what} must differ, got {shown} {names.count(name)} times")
        if self.scans < 2:
            raise ValueError(f"scans must be 2 or more, got {self.scans}: odometry needs pairs")

    @property
    def scans(self) -> int:
        """Scans of each drive."""
        return self.drives[0].config.scans

    @property
    def run_of(self) -> dict[str, Condition]:
        """By the name of each condition the first one that has the same scans, which is the one simulated."""
        return runs(self.conditions, self.drives[0].config.sensor)

    @property
    def runs(self) -> tuple[Condition, ...]:
        """The conditions that are simulated, the default one first."""
        return tuple({each.name: each for each in self.run_of.values()}.values())


def ablation_drive(word: str, settings: SimulationConfig) -> AblationDrive:
    """Make the drive that a word names.

    Args:
        word: PRESET:SEED, or SCENE.toml:SEED for a custom scene.
        settings: All other settings of the drive. Its folders have Oxford's layout, which gives the motion
            from file to file, whatever the clock of the radar says.

    Returns:
        The drive.

    Raises:
        ValueError: The word has another form, or its settings cannot be simulated.
        SceneError: The file of the custom scene is not valid.
    """
    world, colon, seed = word.rpartition(":")
    if not (colon and world and seed.isdecimal()):
        raise ValueError(
            f"a world must be PRESET:SEED, such as town:7, SCENE.toml:SEED or MAP.osm:SEED, got {word!r}"
        )
    custom = is_scene_file(world)
    scene = read_scene_file(Path(world)) if custom else None
    config = replace(settings, preset="" if custom else world, scene=scene, seed=int(seed), layout="oxford")
    return AblationDrive(name=f"{Path(world).stem}_{int(seed)}", config=config)


def world_of(name: str) -> str:
    """Write the name of a drive as its world is given.

    Args:
        name: Name of a drive, such as "town_7".

    Returns:
        The world with its seed, such as "town:7"; of a file without folder and suffix.
    """
    return ":".join(name.rsplit("_", 1))


def study_content(study: AblationStudy) -> dict[str, Any]:
    """Describe an ablation: all that decides its results.

    Args:
        study: The ablation.

    Returns:
        The content of ablation.json.

    Raises:
        DatasetError: The weights of a method cannot be read.
    """
    first = manifest(study.drives[0].config)
    return {
        "format": FORMAT,
        "scans": study.scans,
        "worlds": {each.name: manifest(each.config)["config"] for each in study.drives},
        "conditions": {each.name: _condition(each) for each in study.conditions},
        "methods": {each.name: _method(each) for each in study.methods},
        "keep_scans": study.keep_scans,
        "versions": {**first["versions"], **_torch(study.methods)},
        CODE: code_digest(_CODE_PACKAGES) or _UNKNOWN_CODE,
    }


def _condition(condition: Condition) -> dict[str, Any]:
    return {"artefacts": asdict(condition.artefacts), "faults": asdict(condition.faults)}


def _method(choice: MethodChoice) -> dict[str, Any]:
    return {"solver": choice.solver if choice.learned else None, "weights_sha256": choice.weights_sha256()}


def _torch(methods: Sequence[MethodChoice]) -> dict[str, str]:
    """Return the version of PyTorch where a method needs it."""
    return {"torch": version("torch")} if any(each.learned for each in methods) else {}
