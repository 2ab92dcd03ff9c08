"""The page itself: the template in assets/ with its style, its script and a view's data put into it.

One file that asks the network for nothing; the same view gives the same bytes.
"""

import base64
import json
import re
from dataclasses import asdict
from importlib.resources import files
from typing import Any

import numpy as np

from echoscape.eval.figures.style import BRIGHTEST, HEAT
from echoscape.eval.viewer.data import View

_SCRIPTS = (
    "state.js",
    "scans.js",
    "picture.js",
    "marks.js",
    "plan.js",
    "words.js",
    "playback.js",
    "controls.js",
)
"""In their order: they stand in one scope."""


def page_bytes(view: View) -> bytes:
    """Return the page that shows `view`, as UTF-8 HTML."""
    parts = {
        "title": _escaped(view.title),
        "style": _part("viewer.css"),
        "script": "\n".join(map(_part, _SCRIPTS)),
        "data": _json(asdict(view) | {"heat": _heat(), "brightest": BRIGHTEST}),
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda place: parts[place[1]], _part("viewer.html")).encode()


def _part(name: str) -> str:
    return (files("echoscape.eval.viewer") / "assets" / name).read_text("utf-8")


def _heat() -> str:
    """Return the 256 colours of echoes as hexadecimal digits, six each."""
    return np.rint(255 * HEAT(np.arange(256))[:, :3]).astype(np.uint8).tobytes().hex()


def _json(content: dict[str, Any]) -> str:
    """Return JSON that may stand within a script element: no text in it can end the element."""
    text = json.dumps(content, default=_base64, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c")


def _base64(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")


def _escaped(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
