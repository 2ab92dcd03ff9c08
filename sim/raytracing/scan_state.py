"""What the rays of one scan depend on, made once: its times, antenna poses, moving objects and ray scene."""

from dataclasses import dataclass, replace

import numpy as np

from echoscape.sim.kinematics.rolling_scan import AzimuthPoses, MoverStates, Revolution
from echoscape.sim.raytracing.intersection import RayScene
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.raytracing.mitsuba_scene import MitsubaScene


@dataclass(frozen=True, kw_only=True)
class PoseTables:
    """The antenna poses of a scan as Dr.Jit arrays, which kernels gather from by azimuth.

    Attributes:
        position: Positions (3 A,) double, x, y, z of each azimuth in turn [m].
        velocity: Velocities (3 A,) single, likewise [m/s].
        forward: Unit vectors straight ahead (3 A,) double, likewise.
        right: Unit vectors to the right (3 A,) double, likewise.
        up: Unit vectors along the axis of the antenna (3 A,) double, likewise.
        forward_single: `forward` in single precision, for directions that are known so far only: every echo
            gathers it, and double precision would take a third of the time of a trace.
        right_single: `right`, likewise.
        azimuth_period_s: Time from one azimuth to the next (1,) [s].
    """

    position: "mi.Float64"
    velocity: "mi.Float"
    forward: "mi.Float64"
    right: "mi.Float64"
    up: "mi.Float64"
    forward_single: "mi.Float"
    right_single: "mi.Float"
    azimuth_period_s: "mi.Float"

    def in_world(self, direction: "mi.Vector3d", azimuth: "mi.UInt32") -> "mi.Vector3d":
        """Turn directions from the frame of the antenna into the world.

        Args:
            direction: Components ahead, to the right and up (N).
            azimuth: Azimuth at which each is seen (N).

        Returns:
            The same directions in the world (N).
        """
        forward, right, up = (
            dr.gather(mi.Vector3d, axis, azimuth) for axis in (self.forward, self.right, self.up)
        )
        return forward * direction.x + right * direction.y + up * direction.z

    def bearing(self, direction: "mi.Vector3f", azimuth: "mi.UInt32") -> "mi.Float":
        """Return the angle of directions about the axis of the antenna, clockwise from straight ahead.

        Args:
            direction: Directions in the world (N).
            azimuth: Azimuth at which each is seen (N).

        Returns:
            Angles (N), -pi to pi [rad].
        """
        forward, right = (
            dr.gather(mi.Vector3f, axis, azimuth) for axis in (self.forward_single, self.right_single)
        )
        return dr.atan2(dr.dot(direction, right), dr.dot(direction, forward))

    def axis(self, azimuth: "mi.UInt32") -> "mi.Vector3f":
        """Return the axis about which the antenna rotates.

        Args:
            azimuth: Azimuths (N).

        Returns:
            Unit vectors in the world (N).
        """
        return mi.Vector3f(dr.gather(mi.Vector3d, self.up, azimuth))


def pose_tables(poses: AzimuthPoses) -> PoseTables:
    """Copy antenna poses into Dr.Jit arrays.

    Args:
        poses: The antenna at each azimuth.

    Returns:
        The same poses for kernels.
    """
    forward, right, up = (poses.axes[:, k].ravel() for k in range(3))
    return PoseTables(
        position=mi.Float64(poses.position.ravel()),
        velocity=mi.Float(poses.velocity.astype(np.float32).ravel()),
        forward=mi.Float64(forward),
        right=mi.Float64(right),
        up=mi.Float64(up),
        forward_single=mi.Float(forward.astype(np.float32)),
        right_single=mi.Float(right.astype(np.float32)),
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
