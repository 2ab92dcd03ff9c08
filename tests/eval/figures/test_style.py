"""Colours of figures: components differ for every kind of colour vision, legends list what occurs."""

from itertools import combinations

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from numpy.typing import NDArray

from echoscape.eval.figures.style import (
    CLASS_GROUPS,
    COMPONENT_COLOURS,
    FULL_SCALE_CODE,
    IN_PLACE,
    brightness,
    class_colour,
    class_legend,
    component_legend,
)
from echoscape.scenes.core.scene import CLASSES
from echoscape.sim.datasets.polar_scan import Component

VISION = {
    "normal": (1, 0, 0, 0, 1, 0, 0, 0, 1),
    "protan": (0.152286, 1.052583, -0.204868, 0.114503, 0.786281, 0.099216, -0.003882, -0.048116, 1.051998),
    "deutan": (0.367322, 0.860646, -0.227968, 0.280085, 0.672501, 0.047413, -0.01182, 0.04294, 0.968881),
    "tritan": (1.255528, -0.076749, -0.178779, -0.078411, 0.930809, 0.147602, 0.004733, 0.691367, 0.3039),
}
"""Matrices in linear sRGB of Machado et al., IEEE TVCG 2009, severity 1."""
SRGB_TO_XYZ = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
LEAST_DISTANCE = 18.0
"""CIE 1976 colour difference; 2.3 is just noticeable side by side."""


def _lab(colour: str, matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """The colour in CIE L*a*b* (D65) as it is seen."""
    srgb = np.array(to_rgb(colour))
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    xyz = np.array(SRGB_TO_XYZ) @ np.clip(matrix @ linear, 0, 1) / [0.9505, 1.0, 1.089]
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("vision", VISION)
def test_components_differ_for_every_kind_of_colour_vision(vision: str) -> None:
    matrix = np.array(VISION[vision]).reshape(3, 3)
    seen = {name: _lab(colour, matrix) for name, colour in COMPONENT_COLOURS.items()}
    near = {pair: float(np.linalg.norm(seen[pair[0]] - seen[pair[1]])) for pair in combinations(seen, 2)}
    assert min(near.values()) > LEAST_DISTANCE, min(near, key=lambda pair: near[pair])


def test_every_component_and_class_has_a_colour_of_the_legend() -> None:
    assert set(COMPONENT_COLOURS) == {component.name.lower() for component in Component} | {IN_PLACE}
    members = [name for _, names in CLASS_GROUPS.values() for name in names]
    assert sorted(members) == sorted(set(members))
    assert set(CLASSES) - set(members) == {"none"}
    assert class_colour("car") == class_colour("bus") == CLASS_GROUPS["vehicle"][0]


def test_legends_list_only_what_occurs() -> None:
    assert list(component_legend(["noise", "ghost"])) == ["ghost", "noise"]
    assert list(class_legend(["tree", "car", "ground"])) == ["road and ground", "vegetation", "vehicle"]
    assert class_legend([]) == component_legend([]) == {}


def test_brightness_ends_at_full_scale() -> None:
    codes = np.array([0, FULL_SCALE_CODE / 2, FULL_SCALE_CODE, 255])
    np.testing.assert_allclose(brightness(codes), [0, 0.5, 1, 1])
