"""Rays from the antenna into the scene and back: from a scene and its states to echoes."""
