"""Editable installs: link build/dev/echoscape/<part> to the top-level folder ./<part>.

A plain wheel maps the folders itself (`sources` in pyproject.toml); an editable install needs one
folder that holds them all under the import name, which type checkers can follow as well.
"""

import os
from pathlib import Path

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

PARTS = ("scenes", "sim", "learn", "eval", "cli")


class EditableLinks(BuildHookInterface):
    """Makes the links before hatchling writes the editable path entry."""

    def initialize(self, version: str, build_data: dict) -> None:
        """Link every part when the build is an editable one."""
        if version != "editable":
            return
        package = Path(self.root, "build/dev/echoscape")
        package.mkdir(parents=True, exist_ok=True)
        for part in PARTS:
            link = package / part
            link.unlink(missing_ok=True)
            link.symlink_to(os.path.relpath(Path(self.root, part), package), target_is_directory=True)
