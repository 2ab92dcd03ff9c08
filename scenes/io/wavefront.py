"""Rewrites Wavefront obj files for trimesh: one part per object, group and material, with positive indices.

Format: Wavefront, Advanced Visualizer Manual, Appendix B1 (Object Files). Only vertices, faces and names are
kept.
"""

from pathlib import Path

from echoscape.scenes.io.strict_toml import SceneError


def relabelled(path: Path, data: bytes) -> tuple[bytes, list[tuple[str, ...]]]:
    """Rewrite an obj file with one part per object, group and material.

    Readers merge parts of the same material, so each gets a name of its own here. Negative indices, which
    count back from the last vertex, become positive ones.

    Args:
        path: The file, for messages.
        data: Its content.

    Returns:
        The rewritten content, and the names (object, group, material) of each part.

    Raises:
        SceneError: It is not text, has no faces, or has an invalid vertex or index.
    """
    try:
        text = data.decode("utf-8").replace("\\\n", " ").replace("\\\r\n", " ")
    except UnicodeDecodeError as error:
        raise SceneError(f"{path}: not a text file") from error
    lines = [line.split() for line in text.splitlines()]
    total = sum(words[:1] == ["v"] for words in lines)
    state = {"o": "", "g": "", "usemtl": ""}
    parts: dict[tuple[str, ...], int] = {}
    out: list[str] = []
    seen, changed = 0, True
    for number, words in enumerate(lines, 1):
        key = words[0] if words else "#"
        if key == "v":
            seen += 1
            out.append(f"v {_numbers(f'{path}: line {number}', words[1:4])}")
        elif key in state:
            state[key], changed = " ".join(words[1:]), True
            if key == "o":  # groups belong to their object
                state["g"] = ""
        elif key == "f":
            if changed:
                names = (state["o"] or state["g"] or path.stem, state["g"], state["usemtl"])
                out.append(f"o part{parts.setdefault(names, len(parts))}")
                changed = False
            out.append(f"f {_corners(f'{path}: line {number}', words[1:], seen=seen, total=total)}")
    if not parts:
        raise SceneError(f"{path}: contains no faces")
    labels = [tuple(dict.fromkeys(name for name in names if name)) for names in parts]
    return "\n".join([*out, ""]).encode(), labels


def _numbers(where: str, words: list[str]) -> str:
    """Check that a vertex has three numbers and return them unchanged."""
    try:
        _, _, _ = map(float, words)
    except ValueError as error:
        raise SceneError(f"{where}: a vertex must be three numbers, got {' '.join(words)!r}") from error
    return " ".join(words)


def _corners(where: str, words: list[str], *, seen: int, total: int) -> str:
    """Return the vertex indices of a face, counted from 1 ("f v/vt/vn", -1 being the last of `seen`)."""
    if len(words) < 3:
        raise SceneError(f"{where}: a face must have 3 or more corners, got {len(words)}")
    corners = []
    for word in words:
        try:
            index = int(word.split("/", 1)[0])
        except ValueError as error:
            raise SceneError(f"{where}: {word!r} is not a vertex index") from error
        corner = index if index > 0 else seen + 1 + index
        if index == 0 or not 1 <= corner <= total:
            raise SceneError(f"{where}: a face refers to vertex {index}, but there are {total}")
        corners.append(str(corner))
    return " ".join(corners)
