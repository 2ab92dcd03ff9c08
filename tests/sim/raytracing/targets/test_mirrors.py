"""Images in plane mirrors, and the points at which they reflect."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from echoscape.sim.raytracing.targets.mirrors import Mirror, specular_points

coordinates = st.tuples(*[st.floats(-20.0, 20.0)] * 3)


@given(direction=coordinates, offset_m=st.floats(-20.0, 20.0), a=coordinates, b=coordinates)
def test_way_by_the_specular_point_is_as_long_as_from_the_image(
    direction: tuple[float, ...], offset_m: float, a: tuple[float, ...], b: tuple[float, ...]
) -> None:
    normal = np.array(direction)
    if np.linalg.norm(normal) < 0.1:
        return
    normal /= np.linalg.norm(normal)
    mirror = Mirror(normal=normal, offset_m=offset_m, material=0, instance=0)
    ends = [np.array(end) for end in (a, b)]
    # Both ends are put in front of the mirror.
    heights = [float(end @ normal) - offset_m for end in ends]
    ends = [end + (abs(h) + 0.1 - h) * normal for end, h in zip(ends, heights, strict=True)]
    point = specular_points(normal[None], np.array([offset_m]), ends[0][None], ends[1][None])[0]
    assert point @ normal == pytest.approx(offset_m, abs=1e-9)
    way = sum(float(np.linalg.norm(end - point)) for end in ends)
    assert way == pytest.approx(float(np.linalg.norm(mirror.image(ends[0]) - ends[1])), abs=1e-9)
    np.testing.assert_allclose(mirror.image(mirror.image(ends[0])), ends[0], atol=1e-9)
