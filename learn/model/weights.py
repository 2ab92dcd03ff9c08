"""Weights in one file: safetensors, with the model's settings and the record of its training in the header.

Source: the safetensors format, tensors and a dictionary of strings, which runs no code when it is read.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from echoscape.learn.data.image_settings import ImageSettings
from echoscape.learn.model.keypoint_model import KeypointModel, ModelSettings
from echoscape.sim.datasets.files.atomic_write import DatasetError, write_whole

FORMAT = "echoscape keypoints 1"
_KEY = "echoscape"
"""The one entry of the header: several would be written in an order that changes from run to run."""


def settings_of(told: Mapping[str, Any]) -> ModelSettings:
    """Return the settings that `dataclasses.asdict` told.

    Raises:
        ValueError: a setting is unknown or out of range.
    """
    try:
        return ModelSettings(**{**told, "image": ImageSettings(**told["image"])})
    except (KeyError, TypeError) as error:
        raise ValueError(f"settings must be those of this version: {error}") from error


def write_weights(path: Path, model: KeypointModel, record: Mapping[str, Any]) -> None:
    """Write a model to `path`, whole or not at all; record: of its training, anything that JSON holds."""
    told = {"format": FORMAT, "settings": asdict(model.settings), "training": dict(record)}
    header = {_KEY: json.dumps(told)}
    tensors = {name: value.detach().cpu().contiguous() for name, value in model.state_dict().items()}
    write_whole(path, save(tensors, header))


def read_weights(path: Path) -> tuple[KeypointModel, dict[str, Any]]:
    """Read a model, ready for inference, and the record of its training.

    Raises:
        DatasetError: the file is absent, damaged, no model of ours, or does not fit; the message names it.
    """
    try:
        with safe_open(path, "pt") as file:
            header = json.loads((file.metadata() or {}).get(_KEY, "{}"))
            if not isinstance(header, dict):
                raise DatasetError(f"{path}: its header is no dictionary")
            if header.get("format") != FORMAT:
                raise DatasetError(f"{path}: its format is {header.get('format')!r}, wanted {FORMAT!r}")
            model = KeypointModel(settings_of(header["settings"]))
            model.load_state_dict({name: file.get_tensor(name) for name in file.keys()})  # noqa: SIM118
            return model.eval(), header["training"]
    except DatasetError:
        raise
    except (OSError, SafetensorError, KeyError, ValueError, RuntimeError) as error:
        raise DatasetError(f"{path}: is no model that can be read ({str(error).splitlines()[0]})") from error
