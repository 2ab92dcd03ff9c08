"""A plan of a town, drawn from its scene.glb: faces that look up, the highest ones last."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import trimesh
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from numpy.typing import NDArray

from echoscape.eval.figures.style import GROUND_COLOUR, MATERIAL_COLOURS, OTHER_COLOUR
from echoscape.sim.datasets.files.atomic_write import DatasetError

_LIGHT = np.array([-0.5, 0.5, 0.7]) / np.linalg.norm([-0.5, 0.5, 0.7])
_MIN_UP = 0.25
"""Upward part of the normal below which a face counts as upright and is not drawn."""
_OVERSAMPLING = 2
_LINE_PIXELS = 1.5
"""Width of upright faces where they are drawn [px]."""
_REACH_M = 50.0
"""Largest distance of any part of a placed object from its middle [m]."""

Window = tuple[float, float, float, float]
"""x0, y0, x1, y1 [m] in the world."""


def drive_window(path: NDArray[np.float64]) -> Window:
    """Return the square around a drive, with a margin.

    Args:
        path: Poses (P, 2 or more) of the car: x, y [m].

    Returns:
        A window at least 260 m wide.
    """
    low, high = path[:, :2].min(axis=0), path[:, :2].max(axis=0)
    (x, y), half = ((low + high) / 2).tolist(), max(130.0, float((high - low).max()) / 2 + 40.0)
    return x - half, y - half, x + half, y + half


def plan_image(
    scene_file: Path, window: Window, *, pixels: int, all_faces: bool = False
) -> NDArray[np.float32]:
    """Draw the part of a town that lies within a window.

    Args:
        scene_file: The town, scene.glb of a data set.
        window: The part to draw.
        pixels: Width of the image.
        all_faces: Whether to draw faces that look down as well, and upright ones as lines: for user meshes,
            whose faces may be turned either way.

    Returns:
        Colours (height, pixels, 3) from 0 to 1, north up.

    Raises:
        DatasetError: The scene file is absent or no scene; the message names it.
    """
    triangles, colours, upright = _visible(_scene(scene_file), window, all_faces=all_faces)
    order = np.argsort(triangles[:, :, 2].mean(axis=1), kind="stable")
    height = round(pixels * (window[3] - window[1]) / (window[2] - window[0]))
    figure = Figure(figsize=(1, height / pixels), dpi=pixels * _OVERSAMPLING, facecolor=GROUND_COLOUR)
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_axis_off()
    axes.set(xlim=(window[0], window[2]), ylim=(window[1], window[3]))
    # Antialiased edges of neighbouring triangles leave seams: shrink a larger image instead.
    axes.add_collection(
        PolyCollection(
            list(triangles[order, :, :2]),
            facecolors=colours[order],
            edgecolors=colours[order],
            antialiased=False,
            lw=np.where(upright[order], _LINE_PIXELS * _OVERSAMPLING * 72 / figure.dpi, 0.0),
        )
    )
    canvas.draw()
    fine = np.asarray(canvas.buffer_rgba())[..., :3].astype(np.float32) / 255
    return fine.reshape(height, _OVERSAMPLING, pixels, _OVERSAMPLING, 3).mean(axis=(1, 3))


def _scene(scene_file: Path) -> trimesh.Scene:
    if not scene_file.is_file():
        raise DatasetError(f"{scene_file}: no such scene")
    try:
        return trimesh.load_scene(scene_file, process=False)
    except (ValueError, KeyError, IndexError) as error:
        raise DatasetError(f"{scene_file}: not a whole glTF scene ({error})") from error


def _visible(
    scene: trimesh.Scene, window: Window, *, all_faces: bool
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Return the triangles (T, 3, 3) [m] to draw, their shaded colours (T, 3), and which are upright (T,)."""
    triangles, colours, upright = [np.empty((0, 3, 3))], [np.empty((0, 3))], [np.empty(0, np.bool_)]
    for material, corners in _parts(scene, window):
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.linalg.norm(normal, axis=1)
        middle = corners[:, :, :2].mean(axis=1)
        inside = ((middle > np.array(window[:2]) - 20) & (middle < np.array(window[2:]) + 20)).all(axis=1)
        large = np.ptp(corners[:, :, :2], axis=1).max(axis=1) > 20
        if all_faces:
            normal *= np.where(normal[:, 2:] < 0, -1, 1)
        up = normal[:, 2] > _MIN_UP * length
        kept = (inside | large) & (up | all_faces) & (length > 0)
        light = 0.35 + 0.85 * np.clip(normal[kept] @ _LIGHT / length[kept], 0, None)
        height = 0.92 + 0.012 * np.clip(corners[kept, :, 2].mean(axis=1), 0, 12)
        triangles.append(corners[kept])
        shade = np.array(to_rgb(MATERIAL_COLOURS.get(material, OTHER_COLOUR)))
        colours.append(np.clip(shade * (light * height)[:, None], 0, 1))
        upright.append(~up[kept])
    return np.concatenate(triangles), np.concatenate(colours), np.concatenate(upright)


def _parts(scene: trimesh.Scene, window: Window) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """Yield material and triangles (T, 3, 3) [m] in the world of every part that may be in the window."""
    for node in scene.graph.nodes_geometry:
        matrix, geometry = scene.graph[node]
        matrix, name = _Z_UP @ matrix, str(geometry)
        place = matrix[:2, 3]
        static = name.startswith("static/")
        low, high = np.array(window[:2]) - _REACH_M, np.array(window[2:]) + _REACH_M
        if not static and ((place < low) | (place > high)).any():
            continue
        corners = scene.geometry[name].triangles
        yield name.rsplit("/", 1)[1], corners @ matrix[:3, :3].T + matrix[:3, 3]


_Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
"""From the axes of glTF (y up) to those of the world (z up)."""
