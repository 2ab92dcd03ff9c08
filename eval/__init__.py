"""Evaluation: scans and motions become figures, tables and reports.

Public names are imported on first use.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from echoscape.eval.detections.run import judge_detectors as judge_detectors
    from echoscape.eval.fidelity.score import fidelity_report as fidelity_report
    from echoscape.eval.odometry.kitti_drift import kitti_drift as kitti_drift
    from echoscape.eval.odometry.run import run_odometry as run_odometry
else:
    from lazy_loader import attach

    __getattr__, __dir__, __all__ = attach(
        __name__,
        submod_attrs={
            "detections.run": ["judge_detectors"],
            "fidelity.score": ["fidelity_report"],
            "odometry.kitti_drift": ["kitti_drift"],
            "odometry.run": ["run_odometry"],
        },
    )
