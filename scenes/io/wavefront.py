"""Wavefront obj files made plain for readers: a part for every object, group and material, simple indices.

Format: Wavefront, Advanced Visualizer Manual, Appendix B1 (Object Files). Only what makes a shape is kept:
vertices, faces, and the names they stand under.
"""

from pathlib import Path

from echoscape.scenes.io.strict_toml import SceneError


def relabelled(path: Path, data: bytes) -> tuple[bytes, list[tuple[str, ...]]]:
    """Return an obj file with a part for every object, group and material, and the names of each part.

    Names are told apart here since readers merge what has one material. Indices that count back from the last
    vertex become plain ones; those that point nowhere are refused.
    """
    try:
        text = data.decode("utf-8").replace("\\\n", " ").replace("\\\r\n", " ")
    except UnicodeDecodeError as error:
        raise SceneError(f"{path}: no text, as obj files are") from error
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
        raise SceneError(f"{path}: no faces in it")
    labels = [tuple(dict.fromkeys(name for name in names if name)) for names in parts]
    return "\n".join([*out, ""]).encode(), labels


def _numbers(where: str, words: list[str]) -> str:
    """Return x, y, z of a vertex as they stand, once they are seen to be three numbers."""
    try:
        _, _, _ = map(float, words)
    except ValueError as error:
        raise SceneError(f"{where}: a vertex must be three numbers, got {' '.join(words)!r}") from error
    return " ".join(words)


def _corners(where: str, words: list[str], *, seen: int, total: int) -> str:
    """Return the vertices of a face counted from 1 (Wavefront obj, "f v/vt/vn", -1 being the last `seen`)."""
    if len(words) < 3:
        raise SceneError(f"{where}: a face must have 3 or more corners, got {len(words)}")
    corners = []
    for word in words:
        try:
            index = int(word.split("/", 1)[0])
        except ValueError as error:
            raise SceneError(f"{where}: {word!r} names no vertex") from error
        corner = index if index > 0 else seen + 1 + index
        if index == 0 or not 1 <= corner <= total:
            raise SceneError(f"{where}: a face names vertex {index} where there are {total}")
        corners.append(str(corner))
    return " ".join(corners)
