"""The methods by name. A further one is a module with a `Detector` and an entry here."""

import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Literal

from echoscape.eval.detections.cfar import Cfar, CfarSettings, OrderedCfarSettings, noise_correlation
from echoscape.eval.detections.hand_made import HandMadeKeypoints
from echoscape.eval.detections.interface import Detector
from echoscape.eval.detections.k_strongest import KStrongest, KStrongestSettings
from echoscape.eval.methods.cen2018 import Cen2018, Cen2018Settings
from echoscape.eval.methods.cen2019 import Cen2019, Cen2019Settings
from echoscape.sim.sensor.sensor import Sensor


@dataclass(frozen=True, kw_only=True)
class KeypointSettings:
    """Which network detects keypoints, and which of them count."""

    weights: Path | None = None
    """File of weights; by default bundled ones."""
    resolution: float | None = None
    """Which of the bundled weights: width of a pixel [m]; by default the coarsest, which are the fastest."""
    least_score: float = 0.0
    """Least score of a keypoint that counts as a detection, 0 to 1."""
    device: Literal["auto", "cpu", "cuda"] = "auto"
    """Where the network runs; auto takes a GPU where PyTorch finds one."""

    def __post_init__(self) -> None:
        if not 0 <= self.least_score <= 1:  # NaN is refused too
            raise ValueError(f"least_score must be between 0 and 1, got {self.least_score}")
        if self.resolution is not None and not 0 < self.resolution < math.inf:
            raise ValueError(f"resolution must be finite and above 0, got {self.resolution}")
        if self.resolution is not None and self.weights is not None:
            raise ValueError("resolution chooses among the bundled weights: not with weights")


@dataclass(frozen=True, kw_only=True)
class MethodSettings:
    """The settings of every method."""

    cfar: CfarSettings = field(default_factory=CfarSettings)
    """CFAR by cell averaging."""
    oscfar: OrderedCfarSettings = field(default_factory=OrderedCfarSettings)
    """CFAR by order statistics."""
    kstrongest: KStrongestSettings = field(default_factory=KStrongestSettings)
    """The k strongest cells of each azimuth."""
    cen2018: Cen2018Settings = field(default_factory=Cen2018Settings)
    """Keypoints of Cen & Newman, ICRA 2018."""
    cen2019: Cen2019Settings = field(default_factory=Cen2019Settings)
    """Keypoints of Cen & Newman, ICRA 2019."""
    learned: KeypointSettings = field(default_factory=KeypointSettings)
    """Keypoints of the learned odometry."""


def _cfar(settings: MethodSettings, sensor: Sensor) -> Detector:
    return Cfar(settings.cfar, bin_m=sensor.bin_m, correlation=noise_correlation(sensor))


def _oscfar(settings: MethodSettings, sensor: Sensor) -> Detector:
    return Cfar(settings.oscfar, bin_m=sensor.bin_m, correlation=noise_correlation(sensor))


def _kstrongest(settings: MethodSettings, sensor: Sensor) -> Detector:
    return KStrongest(settings.kstrongest)


def _cen2018(settings: MethodSettings, sensor: Sensor) -> Detector:
    return HandMadeKeypoints(Cen2018(settings.cen2018), settings=asdict(settings.cen2018))


def _cen2019(settings: MethodSettings, sensor: Sensor) -> Detector:
    return HandMadeKeypoints(Cen2019(settings.cen2019), settings=asdict(settings.cen2019))


def _learned(settings: MethodSettings, sensor: Sensor) -> Detector:
    # Here, so that the others work without PyTorch.
    from echoscape.eval.detections.learned import LearnedKeypoints
    from echoscape.learn.model.weights import chosen_weights
    from echoscape.learn.odometry.keypoint_detector import KeypointDetector

    chosen = settings.learned
    detector = KeypointDetector(chosen.weights, resolution_m=chosen.resolution, device=chosen.device)
    file = chosen.weights or chosen_weights(chosen.resolution)
    record = {
        "weights": file.name,
        "weights_sha256": hashlib.sha256(file.read_bytes()).hexdigest(),
        "pixel_m": detector.pixel_m,
        "device": chosen.device,
    }
    return LearnedKeypoints(detector, least_score=chosen.least_score, weights=record)


METHODS: Mapping[str, Callable[[MethodSettings, Sensor], Detector]] = {
    "cfar": _cfar,
    "oscfar": _oscfar,
    "kstrongest": _kstrongest,
    "cen2018": _cen2018,
    "cen2019": _cen2019,
    "learned": _learned,
}
"""Builds each method for a radar."""
NEED_TORCH = ("learned",)
"""Methods that need PyTorch."""


def check_methods(names: Sequence[str]) -> None:
    """Refuse names that are not those of methods.

    Args:
        names: Names of methods.

    Raises:
        ValueError: There is none, one is unknown, or one is given twice.
    """
    if not names:
        raise ValueError(f"methods must name at least one of {', '.join(METHODS)}")
    for number, name in enumerate(names):
        if name not in METHODS:
            raise ValueError(f"methods must be among {', '.join(METHODS)}, got {name!r}")
        if name in names[:number]:
            raise ValueError(f"methods must be named once each, got {name} twice")


def build_detectors(names: Sequence[str], settings: MethodSettings, sensor: Sensor) -> list[Detector]:
    """Build methods for a radar.

    Args:
        names: Names of methods.
        settings: The settings of all methods.
        sensor: The radar.

    Returns:
        The methods in the order of their names.

    Raises:
        ValueError: As `check_methods`, or a setting does not suit the radar.
        DatasetError: The file of weights is absent or damaged.
    """
    check_methods(names)
    return [METHODS[name](settings, sensor) for name in names]
