"""The routes by which the radar sees coherent targets in a scan: directly and in plane mirrors.

A target is seen directly out and back by way of a mirror, both ways round in phase, and out and back by way
of the same or of two mirrors. A leg by way of two mirrors is left out.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core import portable_math
from echoscape.scenes.core.attitude import bearing_and_elevation
from echoscape.scenes.core.targets import PlacedTarget, Target
from echoscape.sim.kinematics.rolling_scan import AzimuthPoses
from echoscape.sim.numerics.angles import principal_angle
from echoscape.sim.raytracing.beam_weighting import MAIN_AZIMUTHS
from echoscape.sim.raytracing.scan_state import ScanState
from echoscape.sim.raytracing.targets.fresnel_zone import MirrorLegs, filled_shares
from echoscape.sim.raytracing.targets.mirror_faces import MirrorFaces
from echoscape.sim.raytracing.targets.mirror_search import MirrorSearch
from echoscape.sim.raytracing.targets.mirrors import Mirror, Vectors
from echoscape.sim.sensor.sensor import Sensor

_LEAST_SHARE = 0.1
"""Mirrors that fill less of the Fresnel zone, as a share of the amplitude, are left out."""


@dataclass(frozen=True, kw_only=True)
class Leg:
    """A way between the antenna and a target, at each azimuth (A,) of a scan.

    Attributes:
        mirror: The mirror; None where the way is direct.
        image: Where the antenna sees the target's reference point (3,) float64 [m].
        range_m: Range of this image (A,) float64 [m].
        offset_rad: Angle of it from the beam (A,) float64 [rad].
        closing_mps: Rate at which the range falls (A,) float64 [m/s].
        beyond_rad: Angle between the beam and the nearest part of the target (A,) float64 [rad].
        main: Whether the main lobe covers the target (A,) bool.
        share: Share of the amplitude that mirror and obstacles leave (A,) float64.
    """

    mirror: Mirror | None
    image: NDArray[np.float64]
    range_m: NDArray[np.float64]
    offset_rad: NDArray[np.float64]
    closing_mps: NDArray[np.float64]
    beyond_rad: NDArray[np.float64]
    main: NDArray[np.bool_]
    share: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Route:
    """A target and the legs out to it and back; where they differ, the way round is taken both ways.

    Attributes:
        placed: The target.
        out: The leg from the antenna.
        back: The leg back to it.
    """

    placed: PlacedTarget
    out: Leg
    back: Leg

    @property
    def target(self) -> Target:
        """The target."""
        return self.placed.target

    @property
    def legs(self) -> tuple[Leg, Leg]:
        """Both legs."""
        return self.out, self.back

    @property
    def bounces(self) -> int:
        """Surfaces met out and back; the bounces within a target are one."""
        return 1 + sum(leg.mirror is not None for leg in self.legs)

    @property
    def ways(self) -> int:
        """In how many directions the route is taken."""
        return 1 if self.out is self.back else 2

    @cached_property
    def range_m(self) -> NDArray[np.float64]:
        """Half the length of the route at each azimuth (A,) [m]."""
        return (self.out.range_m + self.back.range_m) / 2

    @cached_property
    def closing_mps(self) -> NDArray[np.float64]:
        """Its rate of change (A,), positive when it shortens [m/s]."""
        return (self.out.closing_mps + self.back.closing_mps) / 2

    @cached_property
    def share(self) -> NDArray[np.float64]:
        """Share of the amplitude (A,) that mirrors and obstacles leave."""
        return self.out.share * self.back.share

    @property
    def surfaces(self) -> list[int]:
        """Instance ids of the surfaces on the way out; of the direct leg and another, the other is it."""
        mirrors = [leg.mirror.instance for leg in self.legs if leg.mirror is not None]
        return [*mirrors[:1], self.placed.instance]


class RouteSearch:
    """Finds the routes to the coherent targets of a scene."""

    def __init__(
        self, placed: Sequence[PlacedTarget], sensor: Sensor, *, mirrors: MirrorFaces | None = None
    ) -> None:
        """Take the targets.

        Args:
            placed: Coherent targets.
            sensor: The radar.
            mirrors: Faces in which the targets may be seen; None is none.
        """
        self._placed, self._sensor = placed, sensor
        self._azimuth_rad = sensor.azimuth_rad
        self._main_rad = (MAIN_AZIMUTHS + 0.5) * sensor.azimuth_step_rad
        self._mirrors = None
        if mirrors is not None and placed:
            self._mirrors = MirrorSearch(
                mirrors, wavelength_m=sensor.wavelength_m, reach_m=2 * sensor.range_m
            )

    def routes(self, state: ScanState, max_bounces: int) -> list[Route]:
        """Return the routes to all targets in a scan.

        Args:
            state: The scan.
            max_bounces: Most surfaces that a route meets, out and back; the target is one of them.

        Returns:
            The direct routes, then those by way of mirrors.
        """
        direct = [self._leg(each.target, None, state.poses) for each in self._placed]
        routes = [
            Route(placed=placed, out=leg, back=leg) for placed, leg in zip(self._placed, direct, strict=True)
        ]
        if self._mirrors is None or max_bounces < 2:
            return routes
        mirrored = self._mirrored_legs(self._mirrors, direct, state)
        for placed, leg, others in zip(self._placed, direct, mirrored, strict=True):
            pairs = itertools.combinations_with_replacement([leg, *others], 2)
            found = [Route(placed=placed, out=out, back=back) for out, back in pairs][1:]
            routes += [each for each in found if each.bounces <= max_bounces]
        return routes

    def _mirrored_legs(
        self, mirrors: MirrorSearch, direct: Sequence[Leg], state: ScanState
    ) -> list[list[Leg]]:
        """Return the legs to each target by way of mirrors that show some of it, the targets in order."""
        poses = state.poses
        legs = [
            [
                self._leg(placed.target, mirror, poses)
                for mirror in self._mirrors_of(mirrors, placed.target, poses)
            ]
            for placed in self._placed
        ]
        for exact in (False, True):
            wanted = [
                MirrorLegs(
                    target=placed.target,
                    mirror=leg.mirror,
                    azimuth=self._covering(leg, straight, exact=exact),
                )
                for placed, straight, others in zip(self._placed, direct, legs, strict=True)
                for leg in others
                if leg.mirror is not None
            ]
            if not wanted:
                break
            shares = filled_shares(
                wanted,
                poses.position,
                state.ray_scene,
                wavelength_m=self._sensor.wavelength_m,
                exact=exact,
            )
            for each, share, leg in zip(wanted, shares, itertools.chain.from_iterable(legs), strict=True):
                leg.share[:] = _by_nearest(each.azimuth, share, len(leg.share))
            legs = [[leg for leg in others if leg.share.max() >= _LEAST_SHARE] for others in legs]
        return legs

    def _mirrors_of(self, mirrors: MirrorSearch, target: Target, poses: AzimuthPoses) -> list[Mirror]:
        """Return the mirrors that may show a target in a scan."""
        axes = poses.axes[len(poses.yaw) // 2]

        def nearest_azimuth(towards: Vectors) -> NDArray[np.int64]:
            turned = bearing_and_elevation(axes, towards)[0] - self._azimuth_rad[0]
            return np.rint(turned / self._sensor.azimuth_step_rad).astype(np.int64) % self._sensor.azimuths

        return mirrors.mirrors(np.array(target.position_m), poses.position, nearest_azimuth)

    def _covering(self, leg: Leg, straight: Leg, *, exact: bool) -> NDArray[np.int64]:
        """Return azimuths that cover a leg or the direct one: all in their main lobes, or the middle ones."""
        if not exact:
            return np.unique([np.argmin(leg.beyond_rad), np.argmin(straight.beyond_rad)])
        return np.flatnonzero(leg.main | straight.main)

    def _leg(self, target: Target, mirror: Mirror | None, poses: AzimuthPoses) -> Leg:
        """Return a leg; the share of one by way of a mirror is still 0."""
        image = np.array(target.position_m)
        if mirror is not None:
            image = mirror.image(image)
        away = image - poses.position
        range_m = np.maximum(np.linalg.norm(away, axis=1), 1e-3)
        offset = principal_angle(bearing_and_elevation(poses.axes, away)[0] - self._azimuth_rad)
        beyond_rad = np.abs(offset) - portable_math.arctan(target.reach_m / range_m)
        main = beyond_rad <= self._main_rad
        # In a left turn it may lie between the main lobes of the last and the first azimuth.
        main[np.argmin(beyond_rad)] = True
        return Leg(
            mirror=mirror,
            image=image,
            range_m=range_m,
            offset_rad=offset,
            closing_mps=np.einsum("ak,ak->a", poses.velocity, away) / range_m,
            beyond_rad=beyond_rad,
            main=main,
            share=np.full(len(range_m), float(mirror is None)),
        )


def _by_nearest(known: NDArray[np.int64], values: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return values at 0, 1 ... count - 1, each that at the nearest `known` place."""
    place = np.arange(count)
    after = np.clip(np.searchsorted(known, place), 0, len(known) - 1)
    before = np.maximum(after - 1, 0)
    return values[np.where(np.abs(known[before] - place) <= np.abs(known[after] - place), before, after)]
