"""Rays aimed at slender facets: the mean stays, it is left less to chance, and both kinds share it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from echoscape.scenes.core.scene import Mesh, Mover, Scene
from echoscape.sim.raytracing import aimed_rays, tracer
from echoscape.sim.raytracing.aimed_rays import LEVELS, WIDTHS_RAD, aimed_share
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.settings.tracing import TraceSettings
from echoscape.sim.simulator import Simulator
from tests.sim.worlds import box_prototype, decibel, mover, plate, standing, straight, world

STEADY = replace(CTS350X, rotation_jitter_s=1e-9, encoder_first=0)
HEIGHT_M = CTS350X.mount_height_m
RANGE_M = 60.0
POSTS = 30


def shares(width_m: float, range_m: float, cosine: float) -> float:
    return aimed_share(mi.Float(width_m), mi.Float(range_m), mi.Float(cosine))[0]


@given(st.floats(0, 0.5), st.floats(1.0, 300.0), st.floats(0.9, 1.0))
@settings(max_examples=100, deadline=None)
def test_share_is_between_none_and_all(width_m: float, range_m: float, cosine: float) -> None:
    assert 0 <= shares(width_m, range_m, cosine) <= 1


def test_share_is_all_of_what_is_narrow_and_faces_the_radar() -> None:
    narrow, wide = (angle * 50.0 for angle in WIDTHS_RAD)
    assert shares(narrow * 0.99, 50.0, 1.0) == 1
    assert shares((narrow + wide) / 2, 50.0, 1.0) == pytest.approx(0.5, abs=1e-5)
    assert shares(wide * 1.01, 50.0, 1.0) == 0
    assert shares(0.0, 50.0, 1.0) == 0  # a surface that no ray is aimed at
    assert shares(narrow / 2, 50.0, LEVELS[1] - 1e-4) == 0
    assert shares(narrow / 2, 50.0, sum(LEVELS) / 2) == pytest.approx(0.5, abs=1e-3)
    # Beyond the lobe of metal, some 2 deg wide, nothing that matters is left to rays at random.
    assert math.degrees(math.acos(LEVELS[0])) > 2 * 2


def posts(width_m: float = 0.05) -> list[tuple[str, str, Mesh]]:
    """Metal posts around the radar at 60 m, which face it within a few milliradians."""
    rng = np.random.default_rng(1)
    bearings = 2 * math.pi * (np.arange(POSTS) + rng.random(POSTS) / 2) / POSTS
    facing = bearings + math.pi + rng.normal(0, 0.004, POSTS)
    places = RANGE_M * np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
    return [
        ("metal", "fence", plate([x, y, HEIGHT_M], [math.cos(way), math.sin(way)], width_m, 0.6))
        for (x, y), way in zip(places, facing, strict=True)
    ]


def powers(town: Scene, movers: tuple[Mover, ...] = (), *, rays: int, draws: int = 4) -> NDArray[np.float64]:
    """Mean power of all posts by draw and instance (D, I), direct echoes [W]."""
    rows = []
    for draw in range(draws):
        traced = TraceSettings(rays=rays, max_bounces=1, floor_db=-60.0, draw=draw)
        echoes = Simulator(town, standing(), movers, seed=3, sensor=STEADY, settings=traced).echoes(0)
        rows.append(np.bincount(echoes.instance, echoes.mean_power, POSTS + 1)[1:])
    return np.array(rows)


def without_aimed_rays(patch: pytest.MonkeyPatch) -> None:
    def none(width_m: "mi.Float", range_m: "mi.Float", cosine: "mi.Float") -> "mi.Float":
        return dr.zeros(mi.Float, dr.width(width_m))

    for module in (aimed_rays, tracer):
        patch.setattr(module, "aimed_share", none)


@pytest.mark.parametrize("width_m", [0.05, 0.18])
def test_mean_power_stays_and_varies_less(width_m: float, monkeypatch: pytest.MonkeyPatch) -> None:
    # Of 0.05 m all is for aimed rays, of 0.18 m (3 mrad) half: both kinds of rays share each point.
    town = world(*posts(width_m))
    aimed = powers(town, rays=256)
    without_aimed_rays(monkeypatch)
    few, many = powers(town, rays=256), powers(town, rays=2048)
    # A thousand rays at random meet posts of 0.05 m in four draws: three standard errors.
    assert decibel(aimed.sum() / many.sum()) == pytest.approx(0, abs=0.15)
    spread = [np.sqrt(np.mean(np.square(each.std(axis=0) / many.mean(axis=0)))) for each in (aimed, few)]
    assert spread[0] < spread[1]
    if width_m < 0.1:
        assert spread[0] < 0.25 * spread[1]


def test_a_post_of_a_mover_returns_what_one_at_rest_does() -> None:
    # The same bars in the frames of objects that stand: their facets turn with them.
    bar = box_prototype("bar", (0.05, 0.05, 0.6), "metal", "fence")
    angles = 2 * math.pi * np.arange(POSTS) / POSTS
    places = [(40 * math.cos(each), 40 * math.sin(each)) for each in angles]
    movers = tuple(
        mover(k + 1, bar, straight([x, y], [0.0, 0.0], yaw=math.atan2(y, x), z=HEIGHT_M - 0.3))
        for k, (x, y) in enumerate(places)
    )
    fixed = world(
        *(
            (
                "metal",
                "fence",
                plate([x * (1 - 0.025 / 40), y * (1 - 0.025 / 40), HEIGHT_M], [-x, -y], 0.05, 0.6),
            )
            for x, y in places
        )
    )
    moving = powers(world(), movers, rays=256, draws=3)
    resting = powers(fixed, rays=256, draws=3)
    assert moving.mean() > 0
    # Points that rays are aimed at differ, yet each facet has a dozen: a few percent.
    assert decibel(moving.mean() / resting.mean()) == pytest.approx(0, abs=0.3)
    assert (moving.std(axis=0) / moving.mean(axis=0)).mean() < 0.15


def test_aimed_rays_stop_at_what_stands_before_their_facet() -> None:
    screen = ("soil", "wall", plate([30.0, 0, HEIGHT_M], [-1, 0], 60.0, 4.0))  # hides the posts ahead
    free, some = (powers(world(*posts(), *more), rays=256, draws=1)[0] for more in ((), (screen,)))
    off_deg = np.abs(np.degrees([math.atan2(*mesh.vertices.mean(axis=0)[1::-1]) for _, _, mesh in posts()]))
    assert free.min() > 0
    assert some[:POSTS][off_deg < 40].max() == 0
    np.testing.assert_allclose(some[:POSTS][off_deg > 50], free[off_deg > 50], rtol=1e-5)
