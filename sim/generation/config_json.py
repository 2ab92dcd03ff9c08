"""A simulation's configuration as JSON, and back: starts a run again from the echoscape.json of another.

A custom scene is recorded without its folder, so that bytes do not depend on where its files lie. To start
again, its mesh or map must lie beside echoscape.json, or its TOML file must be given.
"""

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from echoscape.scenes.io.mesh_import import mesh_sha256
from echoscape.scenes.io.osm.extract import OsmExtract, file_sha256
from echoscape.scenes.io.scene_file import AnyScene
from echoscape.scenes.io.strict_toml import SceneError
from echoscape.scenes.io.user_scene import UserScene
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.files.metadata import manifest_text, read_manifest
from echoscape.sim.datasets.files.typed_json import from_json
from echoscape.sim.generation.config import SimulationConfig


def config_content(config: SimulationConfig) -> dict[str, Any]:
    """Convert a configuration to the entry `config` of echoscape.json.

    Args:
        config: The configuration.

    Returns:
        Every setting, with lists for tuples, and a custom scene without the folder of its files.
    """
    content = asdict(config)
    if config.scene is not None:
        del content["scene"]["folder"]
    return json.loads(manifest_text(content))


def read_config(path: Path, *, scene: AnyScene | None = None) -> SimulationConfig:
    """Read the configuration of a data set.

    Args:
        path: An echoscape.json, or the folder that holds it.
        scene: A custom scene in place of the recorded world. A data set of a custom scene needs it unless
            the mesh lies beside echoscape.json.

    Returns:
        The configuration. It gives the same bytes with the same versions of the packages.

    Raises:
        DatasetError: The file cannot be read, has an unknown, missing or wrong entry, or the mesh of its
            custom scene is missing or another one; the message names the file and the entry.
    """
    path = Path(path)
    content = read_manifest(path)
    try:
        return config_of(content, scene=scene, folder=path if path.is_dir() else path.parent)
    except DatasetError as error:
        raise DatasetError(f"{path}: {error}") from error


def config_of(
    content: dict[str, Any], *, scene: AnyScene | None = None, folder: Path | None = None
) -> SimulationConfig:
    """Convert the content of echoscape.json to the configuration of its data set.

    Args:
        content: Content of echoscape.json.
        scene: A custom scene in place of the recorded world.
        folder: Where the mesh of a recorded custom scene lies, None where that is unknown.

    Returns:
        The configuration.

    Raises:
        DatasetError: An entry is unknown, missing or wrong, the scans have sensor faults, or the mesh of the
            custom scene is missing or another one; the message names it.
    """
    settings = content.get("config")
    if not isinstance(settings, dict):
        raise DatasetError("config is missing")
    if "faults" in content:
        raise DatasetError("faults: scans with sensor faults are made by echoscape ablate")
    if scene is None and settings.get("scene") is not None:
        scene = _recorded_scene(settings["scene"], folder)
    world = {} if scene is None else {"preset": "", "scene": None}
    config = from_json(SimulationConfig, settings | world, "config")
    try:
        return config if scene is None else replace(config, preset="", scene=scene)
    except ValueError as error:
        raise DatasetError(f"config: {error}") from error


def _recorded_scene(content: Any, folder: Path | None) -> AnyScene:
    """Return a recorded scene with the folder in which its mesh or map lies unchanged."""
    if not isinstance(content, dict) or "folder" in content:
        raise DatasetError("config.scene must be a table without folder")
    if "origin_deg" in content:
        return _recorded_map(content, folder)
    scene = from_json(UserScene, content | {"folder": folder or Path()}, "config.scene")
    hint = "give the TOML file of the scene, or put the mesh beside echoscape.json"
    if folder is None or not scene.mesh_path.is_file():
        raise DatasetError(f"config.scene: the mesh {scene.file} is recorded without its folder; {hint}")
    try:
        found = mesh_sha256(scene.mesh_path)
    except SceneError as error:
        raise DatasetError(f"config.scene: {error}") from error
    if found != scene.sha256:
        raise DatasetError(f"config.scene: {scene.mesh_path} is not the mesh of the data set; {hint}")
    return replace(scene, folder=folder.absolute())


def _recorded_map(content: dict[str, Any], folder: Path | None) -> OsmExtract:
    """Return a recorded extract with the folder in which its file lies unchanged."""
    extract = from_json(OsmExtract, content | {"folder": folder or Path()}, "config.scene")
    hint = "give it by --osm, or put it beside echoscape.json"
    if folder is None or not extract.path.is_file():
        raise DatasetError(f"config.scene: the map {extract.file} is recorded without its folder; {hint}")
    try:
        found = file_sha256(extract.path)
    except SceneError as error:
        raise DatasetError(f"config.scene: {error}") from error
    if found != extract.sha256:
        raise DatasetError(f"config.scene: {extract.path} is not the map of the data set; {hint}")
    return replace(extract, folder=folder.absolute())
