"""Speckle: its distribution, its texture, and that it belongs to the world."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from echoscape.scenes.core.materials import MATERIAL_NAMES, MATERIALS
from echoscape.scenes.core.scene import Mesh
from echoscape.sim.echoes import Echoes
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.raytracing.surface.speckle import patch_key, reflectivity
from echoscape.sim.raytracing.surface.texture import Texture
from echoscape.sim.settings.tracing import TraceSettings
from echoscape.sim.simulator import Simulator
from tests.physics.laws import LawRecorder
from tests.physics.tracing import HEIGHT_M, ROW_DEG, STEADY, WAVELENGTH_M, traced
from tests.sim.worlds import plate, quad, standing, world

SECTION = "Speckle"
GOODMAN = "Goodman, Speckle Phenomena in Optics, 2007, ch. 3"
WARD = "Ward, Tough & Watts, Sea Clutter, 2013, ch. 4"
GROUND = quad([[-70, -70, 0], [70, -70, 0], [70, 70, 0], [-70, 70, 0]])


def bowl(sides: int = 360) -> Mesh:
    """A ring of ground that rises from 3 deg below the beam's middle at 30 m to 2 deg above it at 36 m."""
    angle = 2 * math.pi * np.arange(sides) / sides
    rims = [
        np.column_stack([r * np.cos(angle), r * np.sin(angle), np.full(sides, HEIGHT_M + r * math.tan(e))])
        for r, e in ((30.0, math.radians(-3)), (36.0, math.radians(2)))
    ]
    a, b = np.arange(sides), (np.arange(sides) + 1) % sides
    faces = np.concatenate([np.column_stack([a, b, b + sides]), np.column_stack([a, b + sides, a + sides])])
    return Mesh(vertices=np.concatenate(rims).astype(np.float32), faces=faces.astype(np.uint32))


def cell_sums(
    echoes: Echoes, near_m: float, far_m: float, *, rows: int, length_m: float = 0.25
) -> NDArray[np.complex128]:
    """Sums of the echoes in cells of every third azimuth and `length_m`, over their root mean square."""
    steps = int((far_m - near_m) / length_m)
    step = np.floor((echoes.range_m - near_m) / length_m).astype(np.int64)
    mine = (step >= 0) & (step < steps) & (echoes.azimuth % rows == 0)
    number = echoes.azimuth[mine] // rows * steps + step[mine]
    size = -(-400 // rows) * steps
    total = np.bincount(number, echoes.amplitude[mine].real.astype(np.float64), size) + 1j * np.bincount(
        number, echoes.amplitude[mine].imag.astype(np.float64), size
    )
    mean = np.bincount(number, echoes.mean_power[mine].astype(np.float64), size)
    strong = np.sort(echoes.mean_power[mine])[::-1]
    return total[mean > strong[0] * 1e-9] / np.sqrt(mean[mean > strong[0] * 1e-9])


def test_speckle_of_rough_ground(law: LawRecorder) -> None:
    # Concrete has no texture. Every third row (2.7 deg) and every 0.25 m, some thirty rays in each.
    town = world(("concrete", "road", bowl()))
    cells = [
        cell_sums(traced(town, rays=1024, floor_db=-30.0, sensor=STEADY, seed=seed), 30.5, 35.5, rows=3)
        for seed in range(2)
    ]
    intensity = np.abs(np.concatenate(cells)) ** 2
    intensity /= intensity.mean()
    assert len(intensity) > 5000
    amplitude, level_db = np.sqrt(intensity), 10 * np.log10(intensity)
    for name, expected, found, tolerance, unit in (
        ("Intensity, mean over standard deviation", 1.0, 1 / intensity.std(), 0.06, ""),
        ("Amplitude, mean over standard deviation", 1.911, amplitude.mean() / amplitude.std(), 0.06, ""),
        ("Level, standard deviation", 5.57, level_db.std(), 0.2, "dB"),
        ("Level, mean against the mean power", -2.51, level_db.mean(), 0.2, "dB"),
    ):
        law(
            f"{name} of rough ground, traced",
            source=GOODMAN,
            expected=expected,
            simulated=float(found),
            tolerance=tolerance,
            unit=unit,
            why="five thousand cells: three standard errors",
        )


@pytest.mark.parametrize("shape", [0.5, 1.0, 2.0, 5.0])
def test_texture_makes_speckle_k_distributed(
    law: LawRecorder, monkeypatch: pytest.MonkeyPatch, shape: float
) -> None:
    # A million texture cells of 1 m, in each the sum of four patches.
    monkeypatch.setitem(MATERIALS, "soil", replace(MATERIALS["soil"], texture_shape=shape))
    count = 1 << 20
    index = np.arange(count)
    real, imag, place = np.zeros(count), np.zeros(count), mi.Point3d(0)
    seed, owner = dr.full(mi.UInt32, 5, count), dr.zeros(mi.UInt32, count)
    for patch in range(4):
        x, y = index % 1024 + 0.3 + 0.1 * patch, index // 1024 + 0.45
        place = mi.Point3d(mi.Float64(x), mi.Float64(y), mi.Float64(np.zeros(count)))
        key = patch_key(place, dr.full(mi.Float64, 0.05, count), owner, seed)
        for total, part in zip((real, imag), reflectivity(key), strict=True):
            total += part.numpy() / 2
    material = dr.full(mi.UInt32, MATERIAL_NAMES.index("soil"), count)
    texture = Texture().amplitude(material, place, owner, seed, dr.full(mi.Bool, True, count)).numpy()
    intensity = (real**2 + imag**2) * texture.astype(np.float64) ** 2
    law(
        f"K-distribution, second moment of the intensity for nu = {shape:g}",
        source=f"2 (1 + 1 / nu), {WARD}",
        expected=2 * (1 + 1 / shape),
        simulated=float(np.mean(intensity**2) / np.mean(intensity) ** 2),
        tolerance=0.03 * 2 * (1 + 1 / shape),
        why="a million cells: three standard errors of the heaviest tail, with its last thousandth averaged",
    )


def test_traced_ground_is_k_distributed(law: LawRecorder, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(MATERIALS, "paving", replace(MATERIALS["paving"], texture_shape=1.0, texture_m=2.0))
    cells = []
    for seed in range(4):
        echoes = traced(world(("paving", "road", GROUND)), rays=256, floor_db=-20.0, sensor=STEADY, seed=seed)
        cells.append(np.abs(cell_sums(echoes, 6.0, 24.0, rows=3)) ** 2)
    intensity = np.concatenate(cells)
    law(
        "Ground with a texture of nu = 1 in cells of 2 m, traced: second moment of the intensity",
        source=f"2 (1 + 1 / nu), {WARD}",
        expected=4.0,
        simulated=float(np.mean(intensity**2) / np.mean(intensity) ** 2),
        tolerance=0.7,
        why="some 1500 texture cells: a standard error of 6 %; radar cells across two of them lose 4 %",
    )


def test_speckle_stays_for_who_stands(law: LawRecorder) -> None:
    town = world(("soil", "ground", GROUND))
    simulator = Simulator(town, standing(), seed=3, sensor=STEADY, settings=TraceSettings(rays=64))
    first, second = simulator.echoes(0), simulator.echoes(7)
    assert len(first) == len(second) > 1000
    law(
        "Car at rest, two scans: echoes that differ",
        source="speckle is fixed in the world",
        expected=0,
        simulated=int(np.sum(first.amplitude != second.amplitude)),
        tolerance=0,
        why="only the noise of the receiver differs",
    )
    scans = [simulator.scan(k) for k in (0, 7)]
    assert (scans[0].codes != scans[1].codes).any()
    other = Simulator(town, standing(), seed=4, sensor=STEADY, settings=TraceSettings(rays=64)).echoes(0)
    assert not np.array_equal(first.amplitude[:100], other.amplitude[:100])


def test_speckle_of_a_parked_car_stays_and_of_a_moving_one_turns(law: LawRecorder) -> None:
    # The radar steps towards a small rough plate by half a millimetre, at a range where patches are alike.
    town = world(("soil", "target", plate([30.0, 0, HEIGHT_M], [-1, 0], 0.3, 0.3)))

    def ahead(x: float) -> complex:
        echoes = traced(town, standing(x=x), rays=256, floor_db=-20.0, sensor=STEADY)
        return complex(echoes.amplitude[echoes.azimuth == 0].sum(dtype=np.complex128))

    start, moved = ahead(0.0), ahead(0.5e-3)
    law(
        "Phase of a small rough plate's speckle after 0.5 mm towards it",
        source="4 pi r / lambda",
        expected=math.degrees(4 * math.pi * 0.5e-3 / WAVELENGTH_M),
        simulated=math.degrees(np.angle(moved / start)),
        tolerance=3.0,
        unit="deg",
        why="scatterers over 0.3 m see the step at slightly different angles",
    )


def plates_field(range_m: float, x: float, *, seed: int) -> NDArray[np.complex128]:
    """Field of small rough plates ahead, at `range_m` from the origin, to a radar at `x` on the way to them.

    The phases of the paths to the middles of the plates are taken out; what changes is the speckle of each.
    """
    bearings = np.radians(np.arange(-5, 6) * 2.7)
    places = range_m * np.column_stack([np.cos(bearings), np.sin(bearings)])
    plates = [("soil", "target", plate([*place, HEIGHT_M], list(-place), 0.25, 0.25)) for place in places]
    echoes = traced(world(*plates), standing(x=x), rays=512, floor_db=-40.0, sensor=STEADY, seed=seed)
    found = []
    for instance, (ahead, aside) in enumerate(places - [x, 0.0], start=1):
        row = round(-math.degrees(math.atan2(aside, ahead)) / ROW_DEG) % 400
        mine = (echoes.instance == instance) & (echoes.azimuth == row)
        power = echoes.mean_power[mine].sum(dtype=np.float64)
        path = np.exp(4j * math.pi * math.hypot(ahead, aside) / WAVELENGTH_M)
        found.append(echoes.amplitude[mine].sum(dtype=np.complex128) / math.sqrt(power) * path)
    return np.array(found)


@pytest.mark.parametrize(("range_m", "step_m"), [(6.0, 0.05), (12.0, 0.1), (25.0, 0.1), (50.0, 0.25)])
def test_speckle_changes_no_faster_where_patches_grow(
    law: LawRecorder, range_m: float, step_m: float
) -> None:
    # Five steps towards the plates, the third of them across the range at which patches become larger.
    fields = [
        np.concatenate([plates_field(range_m + 2.5 * step_m, k * step_m, seed=seed) for seed in (0, 1)])
        for k in range(6)
    ]
    coherence = [
        abs(np.vdot(one, two)) / np.linalg.norm(one) / np.linalg.norm(two) for one, two in pairwise(fields)
    ]
    law(
        f"Rough plates, coherence over {step_m:g} m of approach at {range_m:g} m against that beside it",
        source="speckle depends on path lengths alone, which know no steps of range",
        expected=1.0,
        simulated=float(coherence[2] / np.mean([*coherence[:2], *coherence[3:]])),
        tolerance=0.1,
        why="22 plates; where all speckle changed at once, 0.1 to 0.3",
    )
