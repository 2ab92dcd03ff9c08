"""Editable installs: build/dev/echoscape holds a link to each top-level folder, and to the files of api/.

A plain wheel maps the folders itself (`sources` in pyproject.toml); an editable install needs one folder that
holds them all under the import name, which type checkers can follow as well.
"""

import os
from pathlib import Path

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

PACKAGES = ("scenes", "sim", "learn", "eval", "testing", "cli")
ROOT_FILES = ("__init__.py", "py.typed")
"""Files of api/, which are the root of the import name."""


class EditableLinks(BuildHookInterface):
    """Makes the links before hatchling writes the editable path entry."""

    def initialize(self, version: str, build_data: dict) -> None:
        """Link every package and root file when the build is an editable one."""
        if version != "editable":
            return
        package = Path(self.root, "build/dev/echoscape")
        package.mkdir(parents=True, exist_ok=True)
        for target in (*PACKAGES, *(f"api/{name}" for name in ROOT_FILES)):
            link = package / Path(target).name
            link.unlink(missing_ok=True)
            link.symlink_to(os.path.relpath(Path(self.root, target), package))
