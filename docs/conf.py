"""Settings of the documentation site, which `make docs` builds from this folder into build/site.

Neither the build nor the pages fetch anything from elsewhere. The variables in lower case are Sphinx's.
"""

import os
import shutil
import sys
from importlib import metadata
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx

_DOCS = Path(__file__).parent
_ROOT = _DOCS.parent
_GENERATED = _DOCS / "generated"
_COLON = "\ue000"
"""What stands for a colon that Napoleon must not see."""
_PAGES = {
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "examples/first_scan.ipynb": "generated/first_scan.ipynb",
}
"""Pages of the site that lie elsewhere in the repository."""

os.environ["PATH"] = os.pathsep.join(
    [str(Path(sys.executable).parent), os.environ["PATH"]]
)  # for `echoscape`

project = "echoscape"
author = "the authors of echoscape"
version = release = metadata.version("echoscape")
html_title = f"echoscape {release}"

extensions = [
    "myst_nb",  # Markdown pages and the notebook, which it runs
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
    "sphinxcontrib.programoutput",  # the options of each command
]
exclude_patterns = ["_static"]

myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 3  # as in a repository browser: #results-on-real-scans
nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 120

autodoc_typehints = "signature"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True}
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
autosummary_generate = False  # tables of links within a page; no page of its own for every name
napoleon_google_docstring = True
napoleon_use_ivar = True
napoleon_numpy_docstring = False
maximum_signature_line_length = 88
python_use_unqualified_type_names = True
toc_object_entries_show_parents = "hide"

default_role = "code"  # of single backticks in docstrings

nitpicky = True
nitpick_ignore_regex = [
    # Other packages are not linked, because a build must not need the network.
    ("py:.*", r"(numpy|np|npt|torch|pathlib|collections|argparse|mitsuba|drjit|pytest|typing)\..*"),
    ("py:.*", r"(Path|Tensor|NDArray|ArrayLike|Callable|Iterable|Iterator|Sequence|Mapping|float32)"),
    # Internal names, which need no entry in the reference; public ones have at most one package before them.
    ("py:class", r"(.*~)?echoscape\.\w+\.\w+\..*"),
]

html_theme = "furo"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sourcelink = False
html_show_sphinx = False
copybutton_prompt_text = "$ "
copybutton_only_copy_prompt_lines = True
html_theme_options = {"navigation_with_keys": True, "source_edit_link": ""}


def _copy_notebook(app: Sphinx) -> None:
    """Copy the notebook beside the pages: Sphinx reads nothing outside its folder."""
    _GENERATED.mkdir(exist_ok=True)
    shutil.copy(_ROOT / "examples" / "first_scan.ipynb", _GENERATED / "first_scan.ipynb")


def _redirect_links(app: Sphinx, docname: str, content: list[str]) -> None:
    """Redirect links to files of the repository to their pages on the site (content: a list of one text)."""
    for file, page in _PAGES.items():
        content[0] = content[0].replace(f"../{file})", f"{page})")


def _redirect_root_links(app: Sphinx, path: Path, docname: str, content: list[str]) -> None:
    """Do the same for a page of the root, which the site has among those of docs/."""
    for file, page in _PAGES.items():
        content[0] = content[0].replace(f"]({file})", f"]({page})")
    content[0] = content[0].replace("](docs/", "](")


def _hide_colons(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Hide colons from Napoleon where it takes what precedes them for a type: signatures have the types."""
    attribute, section = what in ("attribute", "property", "data"), ""
    for index, line in enumerate(lines):
        if not line.startswith(" ") and line.endswith(":"):
            section = line
        if attribute or (section == "Returns:" and line != section):
            lines[index] = line.replace(":", _COLON)
    if what == "module":
        lines.clear()  # the pages have an introduction of their own


def _show_colons(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Undo `_hide_colons`."""
    lines[:] = [line.replace(_COLON, ":") for line in lines]


def setup(app: Sphinx) -> None:
    """Register what happens before pages are read, and before and after Napoleon (called by Sphinx)."""
    app.connect("builder-inited", _copy_notebook)
    app.connect("source-read", _redirect_links)
    app.connect("include-read", _redirect_root_links)
    app.connect("autodoc-process-docstring", _hide_colons, priority=400)
    app.connect("autodoc-process-docstring", _show_colons, priority=600)
