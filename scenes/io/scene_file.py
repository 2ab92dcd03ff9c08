"""Custom worlds by their file: a mesh described by a TOML file, or an OpenStreetMap extract."""

from pathlib import Path

from echoscape.scenes.io.osm.elements.reading import is_osm_file
from echoscape.scenes.io.osm.extract import OsmExtract, read_osm
from echoscape.scenes.io.user_scene import UserScene, read_user_scene

AnyScene = UserScene | OsmExtract
"""A world in place of a preset."""


def is_scene_file(name: str) -> bool:
    """Check by its name whether a file describes a world.

    Args:
        name: Name of the file, or of a preset.

    Returns:
        Whether it is a TOML file or an extract.
    """
    return name.endswith(".toml") or is_osm_file(name)


def read_scene_file(path: str | Path) -> AnyScene:
    """Read the description of a world.

    Args:
        path: The TOML file of a custom scene, or an OpenStreetMap extract.

    Returns:
        The description.

    Raises:
        SceneError: The file is not valid; the message names it.
    """
    return read_osm(path) if is_osm_file(path) else read_user_scene(path)
