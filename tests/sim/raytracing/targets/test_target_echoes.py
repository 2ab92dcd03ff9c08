"""Coherent targets in mirrors: which are found, what of them is seen, and that ghosts follow from both."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from echoscape.scenes.core.scene import Mesh, Scene
from echoscape.scenes.core.target_meshes import with_targets
from echoscape.scenes.core.targets import Target
from echoscape.sim.echoes import Echoes
from echoscape.sim.raytracing.mitsuba_backend import set_threads
from echoscape.sim.raytracing.targets.mirror_faces import LEAST_AREA_M2, mirror_faces
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.settings.tracing import TraceSettings
from echoscape.sim.simulator import Simulator
from tests.sim.worlds import plate, quad, standing, world

HEIGHT_M = CTS350X.mount_height_m
STEADY = replace(CTS350X, rotation_jitter_s=1e-9)
WAVELENGTH_M = 299_792_458 / 76.5e9
POINT = Target(kind="point", position_m=(20.0, 8.0, HEIGHT_M))
"""Its image in a wall at x = 30 m is at x = 40 m, seen through y = 6 m."""
SPECULAR_Y_M = 6.0
GROUND = ("concrete", "road", quad([[-80, -80, 0], [80, -80, 0], [80, 80, 0], [-80, 80, 0]]))


def wall(from_y_m: float, to_y_m: float, *, height_m: float = 8.0, material: str = "metal") -> tuple:
    middle = [30.0, (from_y_m + to_y_m) / 2, HEIGHT_M]
    return (material, "wall", plate(middle, [-1, 0], to_y_m - from_y_m, height_m))


def ghosts(town: Scene, target: Target = POINT) -> Echoes:
    """Echoes of the target of three bounces."""
    settings = TraceSettings(rays=16, floor_db=-60.0)
    echoes = Simulator(
        with_targets(town, [target]), standing(), seed=1, sensor=STEADY, settings=settings
    ).echoes(0)
    return echoes.select((echoes.bounces == 3) & echoes.returns.coherent[echoes.source])


def amplitude(town: Scene, target: Target = POINT) -> float:
    """Amplitude of the ghost in the azimuth that sees it best, 0 where there is none."""
    total = np.zeros(400, np.complex128)
    echoes = ghosts(town, target)
    np.add.at(total, echoes.azimuth, echoes.amplitude)
    return float(np.abs(total).max())


WHOLE = amplitude(world(wall(-30.0, 30.0)))


def test_wall_that_ends_at_the_specular_point_halves_the_amplitude_of_each_leg() -> None:
    half = amplitude(world(wall(SPECULAR_Y_M, 30.0)))
    assert half / WHOLE == pytest.approx(0.25, rel=0.1)
    assert amplitude(world(wall(SPECULAR_Y_M + 1.0, 30.0))) == 0
    assert amplitude(world(wall(SPECULAR_Y_M - 1.0, 30.0))) == pytest.approx(WHOLE, rel=1e-6)


def test_narrow_mirror_reflects_by_its_share_of_the_fresnel_zone() -> None:
    out_m, back_m = math.hypot(30.0, 6.0), math.hypot(10.0, 2.0)
    cosine = 10.0 / back_m
    zone_m = math.sqrt(WAVELENGTH_M * out_m * back_m / (out_m + back_m)) / cosine
    width_m = 0.1
    # A strip: the integral of exp(-pi u^2 / b^2) / b over its width, for each leg.
    share = math.erf(math.sqrt(math.pi) * width_m / 2 / zone_m)
    strip = amplitude(world(wall(SPECULAR_Y_M - width_m / 2, SPECULAR_Y_M + width_m / 2, height_m=40.0)))
    assert math.sqrt(strip / WHOLE) == pytest.approx(share, abs=0.06)


def test_mirror_in_many_pieces_is_one_mirror() -> None:
    edges = np.linspace(-30.0, 30.0, 61)
    pieces = world(*(wall(a, b) for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)))
    assert amplitude(pieces) == pytest.approx(WHOLE, rel=1e-6)


def test_ghosts_do_not_depend_on_the_order_of_faces_nor_on_threads() -> None:
    def powers(town: Scene) -> NDArray[np.float64]:
        echoes = ghosts(town)
        return np.sort(np.abs(echoes.amplitude))

    reference = powers(world(wall(-30.0, 5.9), wall(5.9, 30.0), GROUND))
    other = powers(world(GROUND, wall(5.9, 30.0), wall(-30.0, 5.9)))
    np.testing.assert_array_equal(other, reference)
    set_threads(1)
    try:
        np.testing.assert_array_equal(powers(world(wall(-30.0, 5.9), wall(5.9, 30.0), GROUND)), reference)
    finally:
        set_threads(2)


def test_only_large_flat_faces_of_surfaces_are_mirrors() -> None:
    whole = wall(-30.0, 30.0)
    small = wall(SPECULAR_Y_M - 0.5, SPECULAR_Y_M + 0.5, height_m=0.9 * LEAST_AREA_M2)
    leaves = wall(-30.0, 30.0, material="foliage")
    mesh = whole[2]
    bent = Mesh(
        vertices=mesh.vertices,
        faces=mesh.faces,
        normals=np.tile(np.array([-1, 0, 0], np.float32), (len(mesh.faces), 3, 1)),
    )
    for thing in (small, leaves):
        assert len(mirror_faces(world(thing)).corners) == 0
    assert len(mirror_faces(world(whole)).corners) == 2
    static = world(whole).static["metal"]
    curved = replace(world(whole), static={"metal": replace(static, normals=bent.normals)})
    assert len(mirror_faces(curved).corners) == 0
    screen = Target(kind="plate", position_m=(30.0, 6.0, HEIGHT_M), size_m=(4.0, 4.0))
    assert len(mirror_faces(with_targets(world(), [screen])).corners) == 0
    barrier = Target(kind="wall", position_m=(30.0, 6.0, 0.0), heading_rad=math.pi, size_m=(40.0, 8.0, 0.2))
    assert amplitude(with_targets(world(), [barrier])) > 0


def test_pole_on_the_ground_is_seen_in_it() -> None:
    pole = Target(kind="cylinder", position_m=(25.0, 3.0, 0.75), size_m=(0.05, 1.5))
    assert amplitude(world(GROUND), pole) > 0
