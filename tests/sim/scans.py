"""Scans for tests, made by hand: no town, no rays."""

import numpy as np

from echoscape.sim.datasets.polar_scan import CellTruth, MoverBoxes, PolarScan, ScanTruth
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.sensor.sensor import Sensor

START_US = 1_700_000_000_000_000


def drawn_scan(*, seed: int = 1, movers: int = 2, sensor: Sensor = CTS350X) -> PolarScan:
    """Return a scan full of drawn numbers."""
    rng = np.random.default_rng(seed)
    shape = (sensor.azimuths, sensor.bins)
    cells = CellTruth(
        component=rng.integers(0, 6, shape, np.uint8),
        instance=rng.integers(0, 70_000, shape, np.uint32),
        class_id=rng.integers(0, 20, shape, np.uint8),
        bounces=rng.integers(0, 4, shape, np.uint8),
        moving=rng.random(shape) < 0.1,
        displaced=rng.random(shape) < 0.1,
    )
    boxes = MoverBoxes(
        instance=np.arange(movers, dtype=np.uint32),
        class_id=np.full(movers, 16, np.uint8),
        centre=rng.normal(size=(movers, 3)),
        extent=rng.uniform(1, 5, (movers, 3)),
        yaw=rng.normal(size=movers),
        velocity=rng.normal(size=(movers, 3)),
        row=rng.integers(0, sensor.azimuths, movers, np.int32),
        row_centre=rng.normal(size=(movers, 3)),
        row_yaw=rng.normal(size=movers),
    )
    truth = ScanTruth(
        cells=cells,
        pose=rng.normal(size=(shape[0], 4)),
        middle_pose=rng.normal(size=4),
        middle_us=START_US + 124_000,
        saturated=rng.random(shape[0]) < 0.5,
        first_obstacle_m=np.where(rng.random(shape[0]) < 0.5, np.inf, 7.0).astype(np.float32),
        boxes=boxes,
        attitude=rng.normal(size=(shape[0], 2)),
    )
    return PolarScan(
        codes=rng.integers(0, 255, shape, np.uint8),
        timestamp_us=START_US + 625 * np.arange(shape[0]),
        encoder=(sensor.encoder_first + 14 * np.arange(shape[0])).astype(np.uint16),
        valid=rng.random(shape[0]) < 0.9,
        bin_m=sensor.bin_m,
        truth=truth,
    )
