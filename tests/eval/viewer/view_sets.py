"""Small folders of scans for the viewer, made by hand: a block of echoes, a box, a drive due north-west."""

import json
import math
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from echoscape.scenes.core.scene import CLASSES
from echoscape.sim.datasets.files.metadata import FORMAT
from echoscape.sim.datasets.files.navtech_png import write_png
from echoscape.sim.datasets.files.truth_npz import write_truth
from echoscape.sim.datasets.layouts.oxford import OdometryRow, write_odometry, write_timestamps
from echoscape.sim.datasets.polar_scan import CellTruth, Component, MoverBoxes, PolarScan, ScanTruth
from echoscape.sim.datasets.se2 import relative_from_world
from echoscape.sim.sensor.cts350x import CTS350X

SENSOR = replace(CTS350X, bins=1000)
START_US = 1_700_000_000_000_000
TURN_US = 250_000
STEP_M = 2.0
YAW = 3 * math.pi / 4
CAR = CLASSES.index("car")
BOX_INSTANCE = 7
BOX_FORWARD_M, BOX_RIGHT_M = 20.0, 10.0
BOX_ROW = 29
"""26.6 deg, from the first azimuth at 0.84 deg in steps of 0.9 deg."""
BLOCK_AZIMUTHS, BLOCK_BINS, BLOCK_CODE = slice(90, 110), slice(440, 520), 100
"""Echoes on the right, at 19.0 to 22.5 m, of every scan but those with an odd number."""


def pose_at(number: int) -> np.ndarray:
    """The car's pose at scan `number`: north-west at 2 m a scan, 8 m/s."""
    path_m = number * STEP_M
    return np.array([10 + path_m * math.cos(YAW), 5 + path_m * math.sin(YAW), 0.0, YAW])


def made_scan(number: int) -> PolarScan:
    """A scan from a standing car, with a block of direct echoes on the right and a box ahead on the right."""
    shape = (SENSOR.azimuths, SENSOR.bins)
    block = np.zeros(shape, bool)
    block[BLOCK_AZIMUTHS, BLOCK_BINS] = number % 2 == 0
    pose = pose_at(number)
    east = math.cos(YAW) * BOX_FORWARD_M + math.sin(YAW) * BOX_RIGHT_M
    north = math.sin(YAW) * BOX_FORWARD_M - math.cos(YAW) * BOX_RIGHT_M
    middle_us = START_US + number * TURN_US + TURN_US // 2
    truth = ScanTruth(
        cells=CellTruth(
            component=np.where(block, Component.DIRECT, Component.NOISE).astype(np.uint8),
            instance=np.where(block, BOX_INSTANCE, 0).astype(np.uint32),
            class_id=np.where(block, CAR, 0).astype(np.uint8),
            bounces=block.astype(np.uint8),
            moving=block,
            displaced=np.zeros(shape, bool),
        ),
        pose=np.tile(pose, (shape[0], 1)),
        middle_pose=pose,
        middle_us=middle_us,
        saturated=np.arange(shape[0]) < 5,
        first_obstacle_m=np.where(np.arange(shape[0]) < 100, 12.0, np.inf).astype(np.float32),
        boxes=MoverBoxes(
            instance=np.array([BOX_INSTANCE], np.uint32),
            class_id=np.array([CAR], np.uint8),
            centre=np.array([[pose[0] + east, pose[1] + north, 0.7]]),
            extent=np.array([[4.5, 1.8, 1.4]]),
            yaw=np.array([YAW]),
            velocity=np.zeros((1, 3)),
            row=np.array([BOX_ROW], np.int32),
            row_centre=np.array([[pose[0] + east, pose[1] + north, 0.7]]),
            row_yaw=np.array([YAW]),
        ),
        attitude=np.zeros((shape[0], 2)),
    )
    return PolarScan(
        codes=np.where(block, BLOCK_CODE, 0).astype(np.uint8),
        timestamp_us=START_US + number * TURN_US + 625 * np.arange(shape[0]),
        encoder=(13 + 14 * np.arange(shape[0])).astype(np.uint16),
        valid=np.ones(shape[0], bool),
        bin_m=SENSOR.bin_m,
        truth=truth,
    )


def write_set(folder: Path, *, scans: int = 3, simulated: bool = True) -> Path:
    """Write a folder of scans; with its truth, or as a real one that has its odometry only. Return it."""
    (folder / "radar").mkdir(parents=True)
    (folder / "gt").mkdir()
    stamps = [START_US + number * TURN_US for number in range(scans)]
    for number, stamp in enumerate(stamps):
        write_png(
            folder / "radar" / f"{stamp}.png", made_scan(number) if simulated else _wide(made_scan(number))
        )
    write_timestamps(folder / "radar.timestamps", stamps)
    write_odometry(folder / "gt" / "radar_odometry.csv", [_row(number) for number in range(1, scans)])
    if simulated:
        (folder / "truth").mkdir()
        for number, stamp in enumerate(stamps):
            truth = made_scan(number).truth
            assert truth is not None
            write_truth(folder / "truth" / f"{stamp}.npz", truth)
        (folder / "echoscape.json").write_text(json.dumps(_manifest(scans)))
    return folder


def _wide(scan: PolarScan) -> PolarScan:
    """The scan at the width by which a real one is recognised."""
    return replace(scan, codes=np.pad(scan.codes, ((0, 0), (0, CTS350X.bins - SENSOR.bins))))


def _manifest(scans: int) -> dict:
    config = {"preset": "hand <b>", "seed": 1, "scans": scans, "sensor": asdict(SENSOR)}
    components = [component.name.lower() for component in Component]
    return {"format": FORMAT, "config": config, "classes": list(CLASSES), "components": components}


def _row(number: int) -> OdometryRow:
    motion = relative_from_world(pose_at(number - 1), pose_at(number))
    stamp = START_US + number * TURN_US
    return OdometryRow(
        source_us=stamp + TURN_US // 2,
        destination_us=stamp - TURN_US // 2,
        x=motion.x_m,
        y=motion.y_m,
        z=0.0,
        roll=0.0,
        pitch=0.0,
        yaw=motion.yaw_rad,
        source_radar_us=stamp,
        destination_radar_us=stamp - TURN_US,
    )
