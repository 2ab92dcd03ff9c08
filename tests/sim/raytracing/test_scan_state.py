"""The state of a scan: what other moving objects in reach leave as it is, and that beams keep none of it."""

import numpy as np

from echoscape.sim.kinematics.rolling_scan import Revolution
from echoscape.sim.raytracing.scan_state import ScanState, scan_state
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.sim.settings.tracing import TraceSettings
from echoscape.sim.simulator import Simulator
from tests.sim.worlds import box_prototype, mover, plate, straight, world

DRY = Artefacts()


def simulator() -> Simulator:
    car = box_prototype("box", (4.0, 1.8, 1.5), "metal")
    movers = [mover(5 + k, car, straight([20.0 + 200 * k, -4.0], [-6.0, 0.0])) for k in range(3)]
    scene = world(("concrete", "building", plate([10, 15, 4], [0, -1], 60, 8)))
    return Simulator(scene, straight([0, 0], [10.0, 2.0]), movers, seed=2, settings=TraceSettings(rays=16))


def state_of(made: Simulator, index: int, reach_m: float | None = None) -> ScanState:
    revolution = made.revolution(index)
    return scan_state(
        made._scene,
        index=index,
        revolution=revolution,
        poses=made._timeline.poses(revolution, DRY),
        movers=made._timeline.movers(revolution, DRY, reach_m=reach_m),
    )


def test_other_movers_leave_times_and_poses() -> None:
    made = simulator()
    state = state_of(made, 1)
    far = made._timeline.movers(state.revolution, DRY, reach_m=500.0)
    wider = state.with_movers(made._scene, far)
    assert [each.instance for each in state.movers.movers] == [5]
    assert [each.instance for each in wider.movers.movers] == [5, 6, 7]
    assert wider.revolution is state.revolution
    assert wider.poses is state.poses
    assert wider.pose_tables is state.pose_tables


def test_tables_are_the_poses_of_the_antenna() -> None:
    state = state_of(simulator(), 3)
    tables, poses = state.pose_tables, state.poses
    np.testing.assert_array_equal(tables.position.numpy().reshape(-1, 3), poses.position)
    forward, right, up = (axis.numpy().reshape(-1, 3).T for axis in (tables.forward, tables.right, tables.up))
    level = np.zeros_like(poses.yaw)
    np.testing.assert_allclose(forward, [np.cos(poses.yaw), np.sin(poses.yaw), level], atol=1e-15)
    np.testing.assert_allclose(right, [np.sin(poses.yaw), -np.cos(poses.yaw), level], atol=1e-15)
    np.testing.assert_array_equal(up, [level, level, level + 1])
    assert isinstance(state.revolution, Revolution)


def test_traces_of_two_scans_do_not_depend_on_their_order() -> None:
    # Both scans are launched before either is traced: nothing of one is kept for the other.
    made = simulator()
    first, second = state_of(made, 0), state_of(made, 40)
    launched = made._tracer.launch(first), made._tracer.launch(second)
    late = made._tracer.trace(second, launched[1]), made._tracer.trace(first, launched[0])
    for index, echoes in zip((40, 0), late, strict=True):
        alone = simulator().echoes(index)
        np.testing.assert_array_equal(echoes.amplitude, alone.amplitude)
        np.testing.assert_array_equal(echoes.range_m, alone.range_m)
