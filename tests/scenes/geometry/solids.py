"""Meshes as trimesh sees them, which measures their volume."""

import numpy as np
import trimesh

from echoscape.scenes.core.scene import Mesh


def as_trimesh(part: Mesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(part.vertices.astype(np.float64), part.faces.astype(np.int64), process=True)
