"""Normals of a curved surface within the footprint of a ray, which widen its specular lobe.

A ray stands for a patch of the surface as wide as the distance to its neighbours. Over that patch the normal
of a curved surface turns, by d / rho for a patch of d on a radius of curvature rho, and the patch reflects
towards every direction that one of its normals does. The lobe of the ray is therefore that of the slopes of
the material and of the normals in its footprint together, a Gaussian whose covariance is the sum of both
(ray differentials: Igehy, SIGGRAPH 1999). The mean over rays stays that of the curved surface, pi rho_1 rho_2
for a smooth metal one, and the sum needs no ray to meet the specular point itself.
"""

from dataclasses import dataclass

from echoscape.sim.raytracing.mitsuba_backend import dr, mi

FOOTPRINT_VARIANCE = 0.25
"""Variance of the Gaussian that stands for a footprint, as a share of its area: neighbours overlap."""
MOST_VARIANCE = 0.09
"""Largest slope variance by the footprint: a wider Gaussian reaches beyond the horizon of a round body."""


@dataclass
class SlopeSpread:
    """Slopes of N half vectors and of the curved surface around N hits, in a tangent basis (u, v).

    Attributes:
        along_u: Slope of the half vector along u (N).
        along_v: Slope of the half vector along v (N).
        variance_u: Variance of the slopes of the surface along u within the footprint (N).
        variance_v: Variance along v (N).
        covariance: Covariance of both (N).
    """

    along_u: "mi.Float"
    along_v: "mi.Float"
    variance_u: "mi.Float"
    variance_v: "mi.Float"
    covariance: "mi.Float"


def slope_spread(
    curvature: "mi.Vector3f",
    twist: "mi.Vector3f",
    normal: "mi.Vector3f",
    half: "mi.Vector3f",
    footprint_m2: "mi.Float",
) -> SlopeSpread:
    """Return the slopes of half vectors, and those of a curved surface within the footprints of rays.

    Args:
        curvature: Diagonal xx, yy, zz of C = M M^T, M the derivative of the normal by place (N) [1/m^2].
        twist: Its other elements xy, xz, yz (N) [1/m^2].
        normal: Unit normals (N).
        half: Unit vectors half way between both directions (N).
        footprint_m2: Areas across the ray that each ray stands for (N) [m^2].

    Returns:
        Slopes and their covariance in the tangent plane.
    """
    u, v = _tangents(normal)
    cu = _applied(curvature, twist, u)
    cv = _applied(curvature, twist, v)
    uu, vv, uv = dr.dot(u, cu), dr.dot(v, cv), dr.dot(u, cv)
    spread = FOOTPRINT_VARIANCE * footprint_m2
    spread = dr.minimum(spread, MOST_VARIANCE / dr.maximum(uu + vv, 1e-12))
    upright = 1 / dr.maximum(dr.dot(half, normal), 1e-3)
    return SlopeSpread(
        along_u=dr.dot(half, u) * upright,
        along_v=dr.dot(half, v) * upright,
        variance_u=spread * uu,
        variance_v=spread * vv,
        covariance=spread * uv,
    )


def _applied(diagonal: "mi.Vector3f", rest: "mi.Vector3f", vector: "mi.Vector3f") -> "mi.Vector3f":
    """Return symmetric matrices, given by their elements xx, yy, zz and xy, xz, yz, times vectors."""
    return mi.Vector3f(
        diagonal.x * vector.x + rest.x * vector.y + rest.y * vector.z,
        rest.x * vector.x + diagonal.y * vector.y + rest.z * vector.z,
        rest.y * vector.x + rest.z * vector.y + diagonal.z * vector.z,
    )


def _tangents(normal: "mi.Vector3f") -> "tuple[mi.Vector3f, mi.Vector3f]":
    """Return two unit vectors across each normal and each other (Duff et al., JCGT 6(1), 2017)."""
    sign = dr.select(normal.z >= 0, mi.Float(1), mi.Float(-1))
    a = -1 / (sign + normal.z)
    b = normal.x * normal.y * a
    return (
        mi.Vector3f(1 + sign * dr.square(normal.x) * a, sign * b, -sign * normal.x),
        mi.Vector3f(b, sign + dr.square(normal.y) * a, -normal.y),
    )
