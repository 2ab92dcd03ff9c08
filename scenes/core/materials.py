"""Materials: electrical properties from ITU-R P.2040 and the surface roughness that the radar sees.

Relative permittivity eps' = a f^b and conductivity c f^d [S/m] with f in GHz: ITU-R P.2040-3 (08/2023), Table
3; asphalt concrete from P.2040-4 (09/2025). Roughness values are calibrated; each entry states its basis.
"""

import math
from dataclasses import dataclass, replace
from typing import Literal


@dataclass(frozen=True, kw_only=True)
class Material:
    """Electrical properties and roughness of a surface.

    Attributes:
        name: Name of the material.
        a: Factor of the relative permittivity a f^b, f in GHz.
        b: Exponent of the relative permittivity.
        c: Factor of the conductivity c f^d [S/m], f in GHz.
        d: Exponent of the conductivity.
        band_ghz: Lowest and highest frequency for which the source gives the values [GHz].
        source: Source of the electrical values.
        rms_height_m: Height deviation of the small-scale roughness, rms [m], for the Rayleigh factor.
        scattering: S of the effective-roughness model (Degli-Esposti 2007): amplitude share scattered
            diffusely.
        rms_slope_rad: Slope of the waviness on scales above the wavelength, rms [rad]; it widens a specular
            reflection to a glint of finite width.
        roughness_source: Basis of the roughness values.
        lobe: Direction of the diffuse lobe (Degli-Esposti 2007): Lambertian (`lambert`), about the specular
            direction (`directive`), or back towards the source (`backscatter`).
        lobe_order: Order of the lobe; the higher, the narrower.
        texture_shape: Shape nu of the gamma distribution of the mean reflectivity of surface patches (that of
            the K-distribution); inf for a uniform surface.
        texture_m: Side of those patches [m].
    """

    name: str
    a: float
    b: float
    c: float
    d: float
    band_ghz: tuple[float, float]
    source: str
    rms_height_m: float
    scattering: float
    rms_slope_rad: float
    roughness_source: str
    lobe: Literal["lambert", "directive", "backscatter"] = "lambert"
    lobe_order: int = 4
    texture_shape: float = math.inf
    texture_m: float = 1.0

    def __post_init__(self) -> None:
        """Check the lobe and the texture.

        Raises:
            ValueError: A value is not allowed; the message names the material and the field.
        """
        if self.lobe not in ("lambert", "directive", "backscatter"):
            raise ValueError(
                f"{self.name}: lobe must be lambert, directive or backscatter, got {self.lobe!r}"
            )
        if self.lobe_order != int(self.lobe_order) or not 1 <= self.lobe_order <= 100:
            raise ValueError(f"{self.name}: lobe_order must be whole, 1 to 100, got {self.lobe_order}")
        if not self.texture_shape >= 0.1:
            raise ValueError(f"{self.name}: texture_shape must be 0.1 or more, got {self.texture_shape}")
        if not 0.1 <= self.texture_m < math.inf:
            raise ValueError(f"{self.name}: texture_m must be 0.1 or more, got {self.texture_m}")


_P3 = "ITU-R P.2040-3, Table 3"
_P4 = "ITU-R P.2040-4, Table 3"
_TEXTURE = ": nu calibrated (land clutter at mm waves is compound Gaussian: Kulemin, Proc. SPIE 5077, 2003)"

_CONCRETE = Material(
    name="concrete",
    a=5.24,
    b=0.0,
    c=0.0462,
    d=0.7822,
    band_ghz=(1.0, 100.0),
    source=_P3,
    rms_height_m=0.0003,
    scattering=0.5,
    rms_slope_rad=0.02,
    roughness_source=(
        "cast and rendered facades: rms 0.2-0.5 mm; waviness of a few mm over a metre; calibrated"
    ),
)
_WOOD = Material(
    name="wood",
    a=1.99,
    b=0.0,
    c=0.0047,
    d=1.0718,
    band_ghz=(0.001, 100.0),
    source=_P3,
    rms_height_m=0.0005,
    scattering=0.5,
    rms_slope_rad=0.02,
    roughness_source="sawn timber, fences and doors; calibrated",
)
_METAL = Material(
    name="metal",
    a=1.0,
    b=0.0,
    c=10000000.0,
    d=0.0,
    band_ghz=(1.0, 100.0),
    source=_P3,
    rms_height_m=5e-05,
    scattering=0.15,
    rms_slope_rad=0.03,
    roughness_source="painted sheet: smooth, pressed in shallow curves; calibrated",
)


MATERIALS: dict[str, Material] = {
    row.name: row
    for row in (
        _CONCRETE,
        Material(
            name="brick",
            a=3.91,
            b=0.0,
            c=0.0238,
            d=0.16,
            band_ghz=(1.0, 40.0),
            source=_P3,
            rms_height_m=0.0008,
            scattering=0.6,
            rms_slope_rad=0.024,
            roughness_source=(
                "mortar joints 2-10 mm deep, faces 0.5-1 mm; used beyond its band (extrapolated to 76.5 GHz)"
            ),
        ),
        Material(
            name="plasterboard",
            a=2.73,
            b=0.0,
            c=0.0085,
            d=0.9395,
            band_ghz=(1.0, 100.0),
            source=_P3,
            rms_height_m=0.0002,
            scattering=0.3,
            rms_slope_rad=0.018,
            roughness_source="smooth board; calibrated",
        ),
        _WOOD,
        Material(
            name="glass",
            a=6.31,
            b=0.0,
            c=0.0036,
            d=1.3394,
            band_ghz=(0.1, 100.0),
            source=_P3,
            rms_height_m=1e-06,
            scattering=0.05,
            rms_slope_rad=0.003,
            roughness_source="float glass is optically smooth; panes lean by tenths of a degree; calibrated",
        ),
        _METAL,
        Material(
            name="asphalt",
            a=4.83,
            b=0.0,
            c=0.0108,
            d=1.3969,
            band_ghz=(1.0, 40.0),
            source=_P4,
            rms_height_m=0.0004,
            scattering=0.22,
            rms_slope_rad=0.01,
            roughness_source=(
                "dense asphalt texture depth 0.5-1 mm; used beyond its band (extrapolated to 76.5 GHz); "
                f"texture of wear, patches and joints{_TEXTURE}"
            ),
            texture_shape=3.0,
        ),
        replace(
            _CONCRETE,
            name="paving",
            rms_height_m=0.0003,
            scattering=0.27,
            rms_slope_rad=0.012,
            roughness_source="concrete slabs and kerbs, joints of some mm; values of concrete; calibrated",
            texture_shape=3.0,
        ),
        Material(
            name="soil",
            a=3.0,
            b=0.0,
            c=0.00015,
            d=2.52,
            band_ghz=(1.0, 10.0),
            source=_P3,
            rms_height_m=0.003,
            scattering=0.9,
            rms_slope_rad=0.1,
            roughness_source=(
                "very dry ground; grass and earth, rms 2-5 mm; "
                "used beyond its band (extrapolated to 76.5 GHz); "
                f"texture of tufts and bare patches{_TEXTURE}"
            ),
            texture_shape=4.0,
        ),
        replace(
            _WOOD,
            name="foliage",
            rms_height_m=0.002,
            scattering=0.9,
            rms_slope_rad=0.3,
            roughness_source=(
                "leaves and twigs: thin wet sheets in all directions, taken as rough wood; calibrated; "
                f"texture of branches and gaps{_TEXTURE}"
            ),
            texture_shape=2.0,
        ),
        Material(
            name="rubber",
            a=2.58,
            b=0.0,
            c=0.0217,
            d=0.78,
            band_ghz=(1.0, 100.0),
            source=_P3,
            rms_height_m=0.001,
            scattering=0.6,
            rms_slope_rad=0.1,
            roughness_source="tyres: no ITU values; chipboard has the nearest permittivity; calibrated",
        ),
        Material(
            name="person",
            a=3.66,
            b=0.0,
            c=0.0044,
            d=1.3515,
            band_ghz=(50.0, 100.0),
            source=_P3,
            rms_height_m=0.002,
            scattering=0.8,
            rms_slope_rad=0.2,
            roughness_source=(
                "clothed skin: no ITU values; floorboard reflects as much as an adult of -8 dBsm does; "
                "calibrated"
            ),
        ),
        replace(
            _METAL,
            name="fittings",
            rms_height_m=0.0002,
            scattering=0.6,
            rms_slope_rad=0.2,
            roughness_source=(
                "metal parts in many directions: lamps, grilles, what lies behind plastic bumpers, wirework; "
                "calibrated to cross-sections of vehicles"
            ),
        ),
        Material(
            name="water",
            a=8.85,
            b=0.0,
            c=68.0,
            d=0.0,
            band_ghz=(74.0, 79.0),
            source=(
                "fresh water at 20 degC, permittivity 8.85 - 16.0j at 76.5 GHz: double-Debye model of "
                "Liebe, Hufford & Manabe, Int. J. Infrared and Millimeter Waves 12 (1991)"
            ),
            rms_height_m=0.0005,
            scattering=0.1,
            rms_slope_rad=0.05,
            roughness_source="ripples in light wind, taken as a rough surface; estimated",
        ),
    )
}

MATERIAL_NAMES: tuple[str, ...] = tuple(MATERIALS)
"""Material names in the order of their numeric ids."""
