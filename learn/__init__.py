"""Learned keypoints: scans become keypoints, matches, motion and descriptions of places.

Public names are imported on first use; most need PyTorch (`pip install "echoscape[learn]"`).
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from echoscape.learn.data.scan_folder import ScanFolder as ScanFolder
    from echoscape.learn.data.scan_pairs import ScanPairs as ScanPairs
    from echoscape.learn.model.keypoint_model import KeypointModel as KeypointModel
    from echoscape.learn.model.weights import load_weights as load_weights
    from echoscape.learn.odometry.keyframe_odometry import KeyframeOdometry as KeyframeOdometry
    from echoscape.learn.odometry.keypoint_detector import KeypointDetector as KeypointDetector
    from echoscape.learn.odometry.keypoint_detector import ScanKeypoints as ScanKeypoints
    from echoscape.learn.odometry.scan_matcher import ScanMatcher as ScanMatcher
    from echoscape.learn.training.trainer import train as train
else:
    from lazy_loader import attach

    _attached, __dir__, __all__ = attach(
        __name__,
        submod_attrs={
            "data.scan_folder": ["ScanFolder"],
            "data.scan_pairs": ["ScanPairs"],
            "model.keypoint_model": ["KeypointModel"],
            "model.weights": ["load_weights"],
            "odometry.keyframe_odometry": ["KeyframeOdometry"],
            "odometry.keypoint_detector": ["KeypointDetector", "ScanKeypoints"],
            "odometry.scan_matcher": ["ScanMatcher"],
            "training.trainer": ["train"],
        },
    )

    def __getattr__(name: str) -> object:
        """Import a public name on first use; without PyTorch the error says how to install it."""
        try:
            return _attached(name)
        except ModuleNotFoundError as error:
            if error.name not in ("torch", "safetensors"):
                raise
            raise ImportError(f'{name} needs PyTorch: pip install "echoscape[learn]"') from error
