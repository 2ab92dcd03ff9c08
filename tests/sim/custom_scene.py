"""A custom scene of one wall, as files."""

from pathlib import Path

WALL = "v 20 -5 0\nv 20 5 0\nv 20 5 3\nv 20 -5 3\nf 1 2 3 4\n"
SCENE = """
file = "wall.obj"
[default]
material = "metal"
class = "wall"
[drive]
waypoints = [[0, 0], [12, 0]]
speed_mps = 10
"""


def user_scene_file(folder: Path, text: str = SCENE) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "wall.obj").write_text(WALL)
    (folder / "wall.toml").write_text(text)
    return folder / "wall.toml"
