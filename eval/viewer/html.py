"""The viewer page: a template in assets/ filled with its style, its scripts and the data of a view.

The page is one file that requests nothing from the network; the same view gives the same bytes.
"""

import base64
import json
import re
from dataclasses import asdict
from importlib.resources import files
from typing import Any

import numpy as np

from echoscape.eval.figures import style
from echoscape.eval.viewer.data import View

_SCRIPTS = (
    "state.js",
    "scans.js",
    "image.js",
    "overlay_marks.js",
    "plan.js",
    "labels.js",
    "playback.js",
    "controls.js",
)
"""The scripts in the order in which they run; they share one scope."""


def page_bytes(view: View) -> bytes:
    """Render the page of a view.

    Args:
        view: What the page shows.

    Returns:
        A whole HTML page, UTF-8.
    """
    parts = {
        "title": _escaped(view.title),
        "style": _palette() + _asset("viewer.css"),
        "script": "\n".join(map(_asset, _SCRIPTS)),
        "data": _json(asdict(view) | _colours()),
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda place: parts[place[1]], _asset("viewer.html")).encode()


def _asset(name: str) -> str:
    """Return the text of a file in assets/."""
    return (files("echoscape.eval.viewer") / "assets" / name).read_text("utf-8")


def _palette() -> str:
    """Return the colours of eval/figures/style.py as variables for the style sheet."""
    colours = {
        "car": style.ACCENT,
        "mover": style.MOVER_COLOUR,
        "moving": style.MOVING_COLOUR,
        "screen": style.SCREEN,
        "outline": style.PAGE,
        "plan-ink": style.INK,
        "ground": style.GROUND_COLOUR,
    }
    return ":root { " + " ".join(f"--{name}: {colour};" for name, colour in colours.items()) + " }\n"


def _colours() -> dict[str, Any]:
    """Return the colours of eval/figures/style.py that the scripts use."""
    levels = np.rint(255 * style.ECHO_COLOURMAP(np.arange(256))[:, :3]).astype(np.uint8)
    return {
        "level_colours": levels.tobytes().hex(),
        "bounce_colours": style.BOUNCE_COLOURS,
        "moving_colour": style.MOVING_COLOUR,
        "full_scale_code": style.FULL_SCALE_CODE,
    }


def _json(content: dict[str, Any]) -> str:
    """Return JSON that is safe within a script element: no text in it can end the element."""
    text = json.dumps(content, default=_base64, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c")


def _base64(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")


def _escaped(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
