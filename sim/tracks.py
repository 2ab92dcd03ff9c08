"""Who moves and where, as two small tables: movers.csv (what they are) and tracks.csv (where they are).

World frame, z up, yaw counter-clockwise from world x; times on the clock of the scans' time stamps. The car
that carries the radar is instance 0 in tracks.csv.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.trajectory import Trajectory
from echoscape.scenes.world import Mover
from echoscape.sim.polar_scan import EPOCH_US

MOVER_COLUMNS = "instance,class,prototype,length_m,width_m,height_m"
TRACK_COLUMNS = "timestamp_us,instance,x_m,y_m,z_m,yaw_rad,vx_mps,vy_mps,yaw_rate_rps"


def movers_csv(movers: Sequence[Mover]) -> str:
    """Return movers.csv: a row a mover."""
    rows = [
        f"{mover.instance},{mover.prototype.class_name},{mover.prototype.name},"
        + ",".join(f"{value:.3f}" for value in mover.prototype.extent_m)
        for mover in movers
    ]
    return "\n".join([MOVER_COLUMNS, *rows]) + "\n"


def tracks_csv(car: Trajectory, movers: Sequence[Mover], times_s: NDArray[np.float64]) -> str:
    """Return tracks.csv: the poses and velocities of the car and the movers at `times_s` (T,) [s], by time.

    A pose is that of the middle of the box on the ground; to a millimetre and a tenth of a milliradian.
    """
    tracks = {0: car} | {mover.instance: mover.track for mover in movers}
    states = [
        np.hstack([track.pose(times_s), track.velocity(times_s)[:, [0, 1, 3]]]) for track in tracks.values()
    ]
    lines = [TRACK_COLUMNS]
    for i, time_s in enumerate(times_s):
        stamp = EPOCH_US + round(float(time_s) * 1e6)
        for instance, state in zip(tracks, states, strict=True):
            x, y, z, yaw, *rates = state[i] + 0.0
            rate = ",".join(f"{value:.4f}" for value in rates)
            lines.append(f"{stamp},{instance},{x:.3f},{y:.3f},{z:.3f},{yaw:.4f},{rate}")
    return "\n".join(lines) + "\n"
