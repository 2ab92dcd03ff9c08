"""What roughness takes from the mirror reflection, and where it goes: coherent loss and diffuse lobes."""

import math
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from scipy.integrate import dblquad

from echoscape.scenes.core.materials import MATERIAL_NAMES, MATERIALS
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.raytracing.surface.scattering import Surfaces
from tests.physics.laws import LawRecorder
from tests.physics.tracing import HEIGHT_M, WAVELENGTH_M, traced
from tests.sim.worlds import decibel, plate, world

SECTION = "Roughness"
AMENT = "Ament 1953: exp(-(4 pi s cos(theta) / lambda)^2) in power"
EFFECTIVE = "Degli-Esposti et al., IEEE TAP 55(1), 2007"
Lobe = Literal["lambert", "directive", "backscatter"]


def surfaces(monkeypatch: pytest.MonkeyPatch, name: str, **changes: float | str) -> Surfaces:
    """The scattering of all materials, one of them changed."""
    monkeypatch.setitem(MATERIALS, name, replace(MATERIALS[name], **changes))
    return Surfaces(76.5e9, WAVELENGTH_M)


def mirror_share(found: Surfaces, name: str, cosine: float) -> float:
    material, active = mi.UInt32(MATERIAL_NAMES.index(name)), mi.Bool(True)
    return float(found.mirror_share(material, mi.Float(cosine), active).numpy()[0])


@pytest.mark.parametrize(("angle_deg", "limit_mm"), [(0, 0.49), (75, 1.89)])
def test_rayleigh_limit(
    law: LawRecorder, monkeypatch: pytest.MonkeyPatch, angle_deg: int, limit_mm: float
) -> None:
    # At s = lambda / (8 cos) the phase differs by pi/2: 4 pi s cos / lambda = pi / 2.
    heights = limit_mm * np.linspace(0.5, 1.5, 41)
    shares = [
        mirror_share(
            surfaces(monkeypatch, "metal", rms_height_m=height * 1e-3, scattering=0.0),
            "metal",
            math.cos(math.radians(angle_deg)),
        )
        for height in heights
    ]
    at_limit = -((math.pi / 2) ** 2)
    law(
        f"Rayleigh's roughness limit at {angle_deg} deg: height at which the mirror part is exp(-(pi/2)^2)",
        source="lambda / (8 cos(theta))",
        expected=limit_mm,
        simulated=float(np.sqrt(np.interp(at_limit, np.log(shares)[::-1], (heights**2)[::-1]))),
        tolerance=0.005,
        unit="mm",
        why="the expected value has two decimals",
    )


@pytest.mark.parametrize(("angle_deg", "factor"), [(0, 0.277), (75, 0.918)])
def test_coherent_amplitude(
    law: LawRecorder, monkeypatch: pytest.MonkeyPatch, angle_deg: int, factor: float
) -> None:
    found = surfaces(monkeypatch, "metal", rms_height_m=0.5e-3, scattering=0.0)
    share = mirror_share(found, "metal", math.cos(math.radians(angle_deg)))
    law(
        f"Amplitude of the mirror reflection at {angle_deg} deg for s = 0.5 mm",
        source=AMENT,
        expected=factor,
        simulated=math.sqrt(share),
        tolerance=0.0006,
        why="the expected value has three decimals",
    )


@pytest.mark.parametrize("scattering", [0.3, 0.6, 0.9])
def test_mirror_and_diffuse_parts_share_the_power(
    law: LawRecorder, monkeypatch: pytest.MonkeyPatch, scattering: float
) -> None:
    found = surfaces(monkeypatch, "metal", rms_height_m=1e-7, scattering=scattering)
    law(
        f"Mirror share R^2 of a smooth surface with S = {scattering}",
        source=f"R^2 + S^2 = 1, {EFFECTIVE}",
        expected=1 - scattering**2,
        simulated=mirror_share(found, "metal", 0.8),
        tolerance=1e-5,
        why="rounding of single precision",
    )


def hemisphere(count: int = 400) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Directions: cosine with the normal, azimuth, solid angle, by midpoints even in both [sr]."""
    cosine, azimuth = np.meshgrid((np.arange(count) + 0.5) / count, (np.arange(count) + 0.5) / count)
    return cosine.ravel(), 2 * math.pi * azimuth.ravel(), np.full(count * count, 2 * math.pi / count**2)


@pytest.mark.parametrize("lobe", ["lambert", "directive", "backscatter"])
def test_diffuse_lobes_hold_their_share(
    law: LawRecorder, monkeypatch: pytest.MonkeyPatch, lobe: Lobe
) -> None:
    found = surfaces(monkeypatch, "wood", lobe=lobe, lobe_order=5)
    cos_out, azimuth, solid = hemisphere()
    worst = 0.25
    for angle in np.radians([0.0, 30.0, 60.0, 80.0]):
        cos_in = math.cos(angle)
        # The source lies at azimuth 0: the way back has (sin, 0, cos).
        cos_back = math.sin(angle) * np.sqrt(1 - cos_out**2) * np.cos(azimuth) + cos_in * cos_out
        size = len(cos_out)
        brdf = found.diffuse_lobe(
            dr.full(mi.Float, 0.25, size),
            dr.full(mi.UInt32, MATERIAL_NAMES.index("wood"), size),
            (dr.full(mi.Float, cos_in, size), mi.Float(cos_out), mi.Float(cos_back)),
            dr.full(mi.Bool, True, size),
        )
        total = float(np.sum(brdf.numpy() * cos_out * solid, dtype=np.float64))
        worst = max(worst, total, key=lambda value: abs(value - 0.25))
    law(
        f"{lobe.capitalize()} lobe over the hemisphere, S = 0.5, at its worst of 0, 30, 60 and 80 deg",
        source=f"S^2, {EFFECTIVE}",
        expected=0.25,
        simulated=worst,
        tolerance=2e-4,
        why="sum over 400 x 400 directions; the scale is tabled in 256 steps of the cosine",
    )


@pytest.mark.parametrize("angle_deg", [0, 40])
def test_mirror_lobe_holds_its_share(
    law: LawRecorder, monkeypatch: pytest.MonkeyPatch, angle_deg: int
) -> None:
    found = surfaces(monkeypatch, "wood", rms_slope_rad=0.1)
    cos_out, azimuth, solid = hemisphere(1200)
    angle = math.radians(angle_deg)
    sin_out = np.sqrt(1 - cos_out**2)
    half = np.array(
        [math.sin(angle) + sin_out * np.cos(azimuth), sin_out * np.sin(azimuth), math.cos(angle) + cos_out]
    )
    cos_half = half[2] / np.linalg.norm(half, axis=0)
    size = len(cos_out)
    lobe = found.mirror_lobe(
        dr.full(mi.UInt32, MATERIAL_NAMES.index("wood"), size),
        mi.Float(cos_half),
        dr.full(mi.Float, math.cos(angle), size),
        mi.Float(cos_out),
        dr.full(mi.Bool, True, size),
    )
    law(
        f"Mirror lobe over the hemisphere, slopes of 0.1 rad, at {angle_deg} deg",
        source="Beckmann's slopes in geometrical optics keep power",
        expected=1.0,
        simulated=float(np.sum(lobe.numpy() * cos_out * solid, dtype=np.float64)),
        tolerance=0.005,
        why="mutual shadowing of slopes is neglected",
    )


def lobe_to_lambert(lobe: Lobe, order: int, cos_in: float, cos_out: float, cos_back: float) -> float:
    """Power of a lobe in a direction against Lambert's, by quadrature of the model's definition."""
    sin_in = math.sqrt(1 - cos_in**2)
    side = 1 if lobe == "backscatter" else -1

    def shape(polar: float, azimuth: float) -> float:
        axis = side * sin_in * math.sin(polar) * math.cos(azimuth) + cos_in * math.cos(polar)
        return ((1 + axis) / 2) ** order * math.sin(polar)

    whole = dblquad(shape, 0, 2 * math.pi, 0, math.pi / 2)[0]
    axis = cos_back if lobe == "backscatter" else 2 * cos_in * cos_out - cos_back
    return ((1 + axis) / 2) ** order / whole / (cos_out / math.pi)


def test_lobes_through_the_tracer(law: LawRecorder, monkeypatch: pytest.MonkeyPatch) -> None:
    # A small plate seen slantwise, straight and by way of a metal wall: there and back by different ways.
    # So rough that it mirrors nothing.
    wall = plate([30.0, 0, 5.0], [-1, 0], 120.0, 10.0)
    side = plate([22.0, 6.0, HEIGHT_M], [0, -1], 1.0, 4.0)
    town = world(("metal", "wall", wall), ("soil", "car", side))
    rough = replace(MATERIALS["soil"], rms_height_m=0.03)
    power: dict[str, tuple[float, float]] = {}
    for lobe in ("lambert", "directive", "backscatter"):
        monkeypatch.setitem(MATERIALS, "soil", replace(rough, lobe=lobe, lobe_order=3))
        echoes = traced(town, rays=2048, max_bounces=2)
        mine = echoes.instance == 2
        power[lobe] = (
            float(echoes.mean_power[mine & (echoes.bounces == 1)].sum(dtype=np.float64)),
            float(echoes.mean_power[mine & (echoes.bounces == 2)].sum(dtype=np.float64)),
        )
    radar, image = np.array([-22.0, -6.0]), np.array([38.0, -6.0])
    cos_radar, cos_image = (6.0 / float(np.linalg.norm(way)) for way in (radar, image))
    apart = float(radar @ image / np.linalg.norm(radar) / np.linalg.norm(image))
    cases: list[tuple[Lobe, int, str, tuple[float, float, float]]] = [
        ("directive", 0, "straight back at 75 deg", (cos_radar, cos_radar, 1.0)),
        ("backscatter", 0, "straight back at 75 deg", (cos_radar, cos_radar, 1.0)),
        ("directive", 1, "in at 81, out forward at 75 deg", (cos_image, cos_radar, apart)),
        ("backscatter", 1, "in at 81, out forward at 75 deg", (cos_image, cos_radar, apart)),
    ]
    for lobe, way, directions, cosines in cases:
        law(
            f"{lobe.capitalize()} lobe (order 3) against Lambert's, traced, {directions}",
            source=EFFECTIVE,
            expected=float(decibel(lobe_to_lambert(lobe, 3, *cosines))),
            simulated=float(decibel(power[lobe][way] / power["lambert"][way])),
            tolerance=0.25,
            unit="dB",
            why="the plate is 1 m wide: angles differ over it",
        )
