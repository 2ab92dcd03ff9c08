"""The bundled weights: their choice by resolution, and that a file holds what its name says."""

from pathlib import Path

import pytest

from echoscape.learn.model.weights import chosen_weights, load_weights, shipped_weights
from echoscape.sim.datasets.files.atomic_write import DatasetError


def test_weights_are_chosen_by_resolution_the_coarsest_by_default(monkeypatch: pytest.MonkeyPatch) -> None:
    files = {0.6912: Path("coarse"), 0.3456: Path("fine")}
    monkeypatch.setattr("echoscape.learn.model.weights.shipped_weights", lambda: files)
    assert chosen_weights() == Path("coarse")
    assert chosen_weights(0.3456) == Path("fine")
    with pytest.raises(DatasetError, match=r"resolution must be one of 0\.6912, 0\.3456, got 1\.0"):
        chosen_weights(1.0)


def test_weights_that_came_along_are_of_the_resolution_that_they_are_named_for() -> None:
    for pixel_m, path in shipped_weights().items():
        model, record = load_weights(path)
        assert model.settings.image.pixel_m == pixel_m
        assert record["data"]
