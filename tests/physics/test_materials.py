"""Half spaces: permittivities of ITU-R P.2040, Fresnel's coefficients, and which of them the tracer takes."""

import math
from dataclasses import replace

import numpy as np
import pytest

from echoscape.scenes.core.materials import MATERIALS
from echoscape.sim.raytracing.surface.fresnel import permittivity, reflection
from tests.physics.laws import LawRecorder
from tests.physics.tracing import HEIGHT_M, power_of, traced
from tests.sim.worlds import quad, world

SECTION = "Materials"
CARRIER_HZ = 76.5e9
ITU = "ITU-R P.2040-3, Table 3 and eq. (29)"
FRESNEL = "ITU-R P.2040-3, eqs. (31a), (31b)"
ROUNDED = "the expected value has this many digits"


def by_hand(a: float, b: float, c: float, d: float) -> complex:
    """eps = a f^b - j 17.98 c f^d / f, f in GHz: P.2040's own rounding of 1 / (2 pi eps0)."""
    return complex(a * 76.5**b, -17.98 * c * 76.5**d / 76.5)


# Rows of the recommendation, typed in anew.
ROWS = {
    "concrete": (5.24, 0.0, 0.0462, 0.7822),
    "glass": (6.31, 0.0, 0.0036, 1.3394),
    "wood": (1.99, 0.0, 0.0047, 1.0718),
    "metal": (1.0, 0.0, 1e7, 0.0),
    "brick": (3.91, 0.0, 0.0238, 0.16),
    "asphalt": (4.83, 0.0, 0.0108, 1.3969),
}


@pytest.mark.parametrize(
    ("name", "epsilon"), [("concrete", 5.24 - 0.32j), ("glass", 6.31 - 0.28j), ("wood", 1.99 - 0.12j)]
)
def test_permittivity(law: LawRecorder, name: str, epsilon: complex) -> None:
    found = permittivity(MATERIALS[name], CARRIER_HZ)
    assert abs(by_hand(*ROWS[name]) - epsilon) < 0.006
    law(
        f"Permittivity of {name}, real part",
        source=ITU,
        expected=epsilon.real,
        simulated=found.real,
        tolerance=0.005,
        why=ROUNDED,
    )
    law(
        f"Permittivity of {name}, imaginary part",
        source=ITU,
        expected=epsilon.imag,
        simulated=found.imag,
        tolerance=0.005,
        why=ROUNDED,
    )


@pytest.mark.parametrize(
    ("name", "level_db", "tolerance_db"),
    [
        ("concrete", -8.12, 0.01),
        ("glass", -7.31, 0.01),
        ("wood", -15.3, 0.05),
        ("metal", -0.01, 0.005),
        ("brick", -9.7, 0.05),
        ("asphalt", -8.3, 0.05),
    ],
)
def test_reflection_at_normal_incidence(
    law: LawRecorder, name: str, level_db: float, tolerance_db: float
) -> None:
    # Gamma = (1 - sqrt(eps)) / (1 + sqrt(eps)), from the recommendation's row.
    root = np.sqrt(by_hand(*ROWS[name]))
    assert 20 * math.log10(abs((1 - root) / (1 + root))) == pytest.approx(level_db, abs=tolerance_db)
    te, _ = reflection(permittivity(MATERIALS[name], CARRIER_HZ), 1.0)
    beyond = name in ("brick", "asphalt")
    law(
        f"Half space of {name}, reflection at normal incidence"
        + (" (defined up to 40 GHz: extrapolated)" if beyond else ""),
        source="ITU-R P.2040-4, Table 3" if name == "asphalt" else ITU,
        expected=level_db,
        simulated=20 * math.log10(abs(te)),
        tolerance=tolerance_db,
        unit="dB",
        why=ROUNDED,
    )


def test_rows_used_beyond_their_band_say_so() -> None:
    for material in MATERIALS.values():
        if not material.band_ghz[0] <= CARRIER_HZ / 1e9 <= material.band_ghz[1]:
            assert "beyond its band" in material.roughness_source, material.name
    assert MATERIALS["brick"].band_ghz[1] == MATERIALS["asphalt"].band_ghz[1] == 40.0


def test_brewster_angle_of_concrete(law: LawRecorder) -> None:
    angles = np.radians(np.linspace(50.0, 80.0, 3001))
    _, tm = reflection(permittivity(MATERIALS["concrete"], CARRIER_HZ), np.cos(angles))
    assert math.degrees(math.atan(math.sqrt(5.24))) == pytest.approx(66.4, abs=0.05)
    law(
        "Brewster's angle of concrete",
        source="arctan sqrt(eps')",
        expected=66.4,
        simulated=math.degrees(angles[np.argmin(np.abs(tm))]),
        tolerance=0.1,
        unit="deg",
        why="losses move the minimum by less",
    )


def test_lossless_half_space_keeps_power(law: LawRecorder) -> None:
    worst = 0.0
    for epsilon in (1.01, 2.0, 5.24, 40.0):
        cosine = np.linspace(0.01, 1.0, 200)
        root = np.sqrt(epsilon - 1 + cosine**2)  # normal wave number inside, over that of free space
        te, tm = reflection(complex(epsilon), cosine)
        # Transmitted power from the transmission coefficients (Born & Wolf, 1.5.2), not as 1 - R.
        into_te = (2 * cosine / (cosine + root)) ** 2 * root / cosine
        into_tm = (2 * math.sqrt(epsilon) * cosine / (epsilon * cosine + root)) ** 2 * root / cosine
        error = [np.abs(np.abs(r) ** 2 + t - 1).max() for r, t in ((te, into_te), (tm, into_tm))]
        worst = max(worst, *error)
    law(
        "Lossless half space: R + T - 1, largest over angles and permittivities",
        source="Born & Wolf, Principles of Optics, 1.5.2",
        expected=0.0,
        simulated=worst,
        tolerance=1e-12,
        why="rounding of doubles",
    )


def test_polarisations_agree_at_normal_incidence(law: LawRecorder) -> None:
    rows = [reflection(permittivity(row, CARRIER_HZ), 1.0) for row in MATERIALS.values()]
    law(
        "TE and TM at normal incidence, largest difference of |Gamma| over all materials",
        source=FRESNEL,
        expected=0.0,
        simulated=max(float(abs(abs(te) - abs(tm))) for te, tm in rows),
        tolerance=1e-12,
        why="rounding of doubles",
    )


def coefficient(epsilon: complex, angle: float) -> tuple[float, float]:
    """|TE|^2 and |TM|^2 of a half space by the refracted angle (Born & Wolf, 1.5.2)."""
    cos_in, index = math.cos(angle), np.sqrt(epsilon)
    cos_inside = np.sqrt(1 - (math.sin(angle) / index) ** 2)
    te = (cos_in - index * cos_inside) / (cos_in + index * cos_inside)
    tm = (index * cos_in - cos_inside) / (index * cos_in + cos_inside)
    return abs(te) ** 2, abs(tm) ** 2


def test_vertical_polarisation_is_te_at_walls_and_tm_at_the_ground(
    law: LawRecorder, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Small plates too rough to mirror, at the radar's height: head on; turned by 60 deg about the vertical,
    # as a wall stands (E across the plane of incidence); tipped back by 60 deg, as the ground lies (E in it).
    monkeypatch.setitem(MATERIALS, "concrete", replace(MATERIALS["concrete"], rms_height_m=0.03))
    angle, distance_m, half = math.radians(60.0), 30.0, 0.3
    things = []
    for kind in range(3):
        for turn in range(6):
            bearing = math.radians(20 * kind + 60 * turn)
            towards = np.array([math.cos(bearing), math.sin(bearing), 0.0])
            aside, up = np.cross([0.0, 0.0, 1.0], towards), np.array([0.0, 0.0, 1.0])
            if kind == 1:
                aside = math.cos(angle) * aside + math.sin(angle) * towards
            if kind == 2:
                up = math.cos(angle) * up + math.sin(angle) * towards
            middle = distance_m * towards + [0.0, 0.0, HEIGHT_M]
            corners = [middle + half * (a * aside + b * up) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
            things.append(("concrete", "target", quad([list(corner) for corner in corners])))
    echoes = traced(world(*things), rays=2048, floor_db=-30.0)
    power = np.array([power_of(echoes, k + 1) for k in range(18)]).reshape(3, 6).mean(axis=1)
    epsilon = by_hand(*ROWS["concrete"])
    head_on = coefficient(epsilon, 0.0)[0]
    for kind, surface in ((1, "wall (TE)"), (2, "ground (TM)")):
        # Lambert: projected area and emission each fall with the cosine.
        share = coefficient(epsilon, angle)[kind - 1] * math.cos(angle) ** 2
        law(
            f"Rough concrete at 60 deg against normal incidence, vertical polarisation: {surface}",
            source="its Fresnel coefficient and Lambert's cosines",
            expected=10 * math.log10(share / head_on),
            simulated=10 * math.log10(power[kind] / power[0]),
            tolerance=0.5,
            unit="dB",
            why="a hundred rays per plate; swapped polarisations would be wrong by 15 dB",
        )
