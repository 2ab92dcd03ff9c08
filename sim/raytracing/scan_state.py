"""What the rays of one scan depend on, made once: its times, antenna poses, moving objects and ray scene."""

from dataclasses import dataclass, replace

import numpy as np

from echoscape.sim.kinematics.rolling_scan import AzimuthPoses, MoverStates, Revolution
from echoscape.sim.numerics.angles import principal_angle
from echoscape.sim.raytracing.intersection import RayScene
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.raytracing.mitsuba_scene import MitsubaScene


@dataclass(frozen=True, kw_only=True)
class PoseTables:
    """The antenna poses of a scan as Dr.Jit arrays, which kernels gather from by azimuth.

    Attributes:
        position: Positions (3 A,) double, x, y, z of each azimuth in turn [m].
        velocity: Velocities (3 A,) single, likewise [m/s].
        yaw: Headings (A,) single, -pi to pi [rad].
        cos_yaw: Cosines of the headings (A,) double.
        sin_yaw: Sines of the headings (A,) double.
        azimuth_period_s: Time from one azimuth to the next (1,) [s].
    """

    position: "mi.Float64"
    velocity: "mi.Float"
    yaw: "mi.Float"
    cos_yaw: "mi.Float64"
    sin_yaw: "mi.Float64"
    azimuth_period_s: "mi.Float"


def pose_tables(poses: AzimuthPoses) -> PoseTables:
    """Copy antenna poses into Dr.Jit arrays.

    Args:
        poses: The antenna at each azimuth.

    Returns:
        The same poses for kernels.
    """
    return PoseTables(
        position=mi.Float64(poses.position.ravel()),
        velocity=mi.Float(poses.velocity.astype(np.float32).ravel()),
        yaw=mi.Float(principal_angle(poses.yaw).astype(np.float32)),
        cos_yaw=mi.Float64(np.cos(poses.yaw)),
        sin_yaw=mi.Float64(np.sin(poses.yaw)),
        # The time between azimuths only enters through the motion of the objects.
        azimuth_period_s=dr.opaque(mi.Float, poses.azimuth_period_s),
    )


@dataclass(frozen=True, kw_only=True)
class ScanState:
    """What the rays of one scan depend on.

    Attributes:
        index: Number of the scan.
        revolution: When each azimuth is measured.
        poses: The antenna at each azimuth.
        pose_tables: The same for kernels.
        movers: The moving objects in reach, at each azimuth.
        ray_scene: The scene with these objects, for rays.
    """

    index: int
    revolution: Revolution
    poses: AzimuthPoses
    pose_tables: PoseTables
    movers: MoverStates
    ray_scene: RayScene

    def with_movers(self, scene: MitsubaScene, movers: MoverStates) -> "ScanState":
        """Return the same scan with other moving objects in reach.

        Args:
            scene: The scene in the ray tracer.
            movers: The objects at each azimuth.

        Returns:
            A state that shares times and poses with this one.
        """
        ray_scene = RayScene(scene, movers, self.revolution.azimuths)
        return replace(self, movers=movers, ray_scene=ray_scene)


def scan_state(
    scene: MitsubaScene, *, index: int, revolution: Revolution, poses: AzimuthPoses, movers: MoverStates
) -> ScanState:
    """Make the state of one scan.

    Args:
        scene: The scene in the ray tracer.
        index: Number of the scan.
        revolution: When each azimuth is measured.
        poses: The antenna at each azimuth.
        movers: The moving objects in reach, at each azimuth.

    Returns:
        The state, with the scene ready for rays.
    """
    return ScanState(
        index=index,
        revolution=revolution,
        poses=poses,
        pose_tables=pose_tables(poses),
        movers=movers,
        ray_scene=RayScene(scene, movers, revolution.azimuths),
    )
