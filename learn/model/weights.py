"""Weights in one file: safetensors, with the model's settings and the record of its training in the header.

Source: the safetensors format, tensors and a dictionary of strings; no code is executed when a file is read.
The bundled weights lie in `weights_files`, named for their pixel width.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from echoscape.learn.data.image_settings import ImageSettings
from echoscape.learn.model.fast_keypoint_model import FastKeypointModel
from echoscape.learn.model.keypoint_model import KeypointModel
from echoscape.learn.model.model_settings import ModelSettings
from echoscape.sim.datasets.files.atomic_write import DatasetError, write_atomic

FORMAT = "echoscape keypoints 1"
_KEY = "echoscape"
"""The one entry of the header: several would be written in an order that changes from run to run."""
_BUNDLED = Path(__file__).parent / "weights_files"
_PREFIX = "keypoints_"


def shipped_weights() -> dict[float, Path]:
    """List the bundled weights.

    Returns:
        Their files by pixel width [m], coarsest first.
    """
    files = _BUNDLED.glob(f"{_PREFIX}*.safetensors")
    found = {float(path.stem.removeprefix(_PREFIX)): path for path in files}
    return dict(sorted(found.items(), reverse=True))


def chosen_weights(resolution_m: float | None = None) -> Path:
    """Choose among the bundled weights.

    Args:
        resolution_m: Pixel width [m]; None takes the coarsest, the fastest.

    Returns:
        The file.

    Raises:
        DatasetError: None are bundled, or none for that width.
    """
    found = shipped_weights()
    if not found:
        raise DatasetError(
            "no weights are bundled with this package: name a file of weights (--weights), or take phase "
            "correlation (--method fourier)"
        )
    if resolution_m is None:
        return next(iter(found.values()))
    if resolution_m not in found:
        raise DatasetError(f"resolution must be one of {', '.join(map(str, found))}, got {resolution_m}")
    return found[resolution_m]


def settings_of(values: Mapping[str, Any]) -> ModelSettings:
    """Restore the settings of a model.

    Args:
        values: The settings as `dataclasses.asdict` returns them.

    Returns:
        The settings.

    Raises:
        ValueError: A setting is unknown or out of range.
    """
    try:
        return ModelSettings(**{**values, "image": ImageSettings(**values["image"])})
    except (KeyError, TypeError) as error:
        raise ValueError(f"settings must be those of this version: {error}") from error


def write_weights(path: Path, model: KeypointModel | FastKeypointModel, record: Mapping[str, Any]) -> None:
    """Write a model, whole or not at all.

    Args:
        path: The file.
        model: The model, on any device.
        record: Record of its training, anything that JSON can hold.
    """
    content = {"format": FORMAT, "settings": asdict(model.settings), "training": dict(record)}
    header = {_KEY: json.dumps(content)}
    tensors = {name: value.detach().cpu().contiguous() for name, value in model.state_dict().items()}
    write_atomic(path, save(tensors, header))


def load_weights(path: Path) -> tuple[KeypointModel, dict[str, Any]]:
    """Read a model.

    Args:
        path: File of weights.

    Returns:
        The model in evaluation mode, on the CPU, and the record of its training.

    Raises:
        DatasetError: The file is absent or damaged, not a model of this package, or one that does not fit its
            settings; the message names it.
    """
    try:
        with safe_open(path, "pt") as file:
            header = json.loads((file.metadata() or {}).get(_KEY, "{}"))
            if not isinstance(header, dict):
                raise DatasetError(f"{path}: its header is not a dictionary")
            if header.get("format") != FORMAT:
                raise DatasetError(f"{path}: its format is {header.get('format')!r}, expected {FORMAT!r}")
            model = KeypointModel(settings_of(header["settings"]))
            model.load_state_dict({name: file.get_tensor(name) for name in file.keys()})  # noqa: SIM118
            return model.eval(), header["training"]
    except DatasetError:
        raise
    except (OSError, SafetensorError, KeyError, ValueError, RuntimeError) as error:
        reason = str(error).splitlines()[0]
        raise DatasetError(f"{path}: cannot be read as a model ({reason})") from error
