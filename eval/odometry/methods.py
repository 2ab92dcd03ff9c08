"""Odometry methods by name: phase correlation, hand-made keypoints, and learned keypoints.

fourier                  phase correlation (eval/odometry/fourier_mellin.py)
cen2018, cen2019         hand-made keypoints (eval/methods)
learned                  learned keypoints, the coarsest bundled weights, the keyframe solver
learned-fine             the finest bundled weights
learned-robust, -paper   another solver, with either weights: learned-fine-robust
learned:FILE             weights from a file, with any solver: learned-robust:FILE
"""

import hashlib
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from echoscape.eval.methods.keypoint_matcher import KeypointMatcher
from echoscape.eval.methods.registry import EXTRACTORS
from echoscape.eval.odometry.fourier_mellin import FourierOdometry
from echoscape.eval.odometry.interface import OdometryMethod
from echoscape.eval.odometry.keypoint_odometry import KeypointOdometry
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.sensor.sensor import Sensor

if TYPE_CHECKING:
    from echoscape.eval.odometry.learned import Solver
    from echoscape.learn.model.device import Device

_LEARNED = re.compile(r"learned(?P<fine>-fine)?(?:-(?P<solver>robust|paper))?(?::(?P<file>.+))?")
HAND_MADE = ("fourier", *EXTRACTORS)
"""The names of methods that nothing was learned for, which need no weights and no PyTorch."""
METHODS = (
    *HAND_MADE,
    *(f"learned{fine}{end}" for fine in ("", "-fine") for end in ("", "-robust", "-paper")),
)
"""The names, without those that bring weights from a file."""


@dataclass(frozen=True, kw_only=True)
class MethodChoice:
    """A method by its name.

    Attributes:
        name: Its name, of a file with weights without folder and suffix.
        learned: Whether it is a learned one, which needs PyTorch.
        fine: Whether it takes the finest bundled weights.
        solver: How poses are solved, as in `eval.odometry.learned.learned_odometry`.
        weights: File of weights, None for bundled ones.
    """

    name: str
    learned: bool = False
    fine: bool = False
    solver: "Solver" = "keyframe"
    weights: Path | None = None

    @property
    def weights_file(self) -> Path | None:
        """The file of weights that it takes, None for a method without.

        Raises:
            DatasetError: No weights are bundled.
        """
        if not self.learned or self.weights is not None:
            return self.weights
        from echoscape.learn.model.weights import chosen_weights, shipped_weights

        return chosen_weights(min(shipped_weights(), default=None) if self.fine else None)

    def weights_sha256(self) -> str | None:
        """Compute the hash of the file of weights, None for a method without.

        Raises:
            DatasetError: The file cannot be read, or none are bundled.
        """
        path = self.weights_file
        try:
            return None if path is None else hashlib.sha256(path.read_bytes()).hexdigest()
        except OSError as error:
            raise DatasetError(f"{path}: cannot be read ({error.strerror})") from error


def method_choice(word: str) -> MethodChoice:
    """Look up a method.

    Args:
        word: Its name, one of `METHODS`, or one with weights from a file: `learned:FILE`.

    Returns:
        The method.

    Raises:
        ValueError: There is no such method.
    """
    if word in HAND_MADE:
        return MethodChoice(name=word)
    found = _LEARNED.fullmatch(word)
    if found is None or (found["fine"] and found["file"]):
        raise ValueError(f"a method must be one of {', '.join(METHODS)} or learned:FILE, got {word!r}")
    path = Path(found["file"]) if found["file"] else None
    return MethodChoice(
        name=word if path is None else f"{word.partition(':')[0]}:{path.stem}",
        learned=True,
        fine=bool(found["fine"]),
        solver=cast("Solver", found["solver"] or "keyframe"),
        weights=path,
    )


def build_method(
    choice: MethodChoice, sensor: Sensor, *, range_offset_m: float = 0.0, device: "Device" = "cpu"
) -> OdometryMethod[Any]:
    """Build a method for the scans of a radar.

    Args:
        choice: The method.
        sensor: The radar, which gives the Doppler shift of ranges.
        range_offset_m: Added to the ranges of all bins [m], as in `ScanFolder`.
        device: Where a learned method computes.

    Returns:
        The method.

    Raises:
        DatasetError: The file of weights is not a model.
        ValueError: The device is absent.
    """
    path = choice.weights_file
    if path is None:
        return _hand_made(choice.name, range_offset_m)
    from echoscape.eval.odometry.learned import learned_odometry

    # Mean over azimuths: alternating chirps shift every other azimuth the other way, on average by 0.
    return learned_odometry(
        path,
        solver=choice.solver,
        device=device,
        range_offset_m=range_offset_m,
        doppler_beta_s=-float(sensor.doppler_shift_s.mean()),
    )


def _hand_made(name: str, range_offset_m: float) -> OdometryMethod[Any]:
    if name in EXTRACTORS:
        return KeypointOdometry(KeypointMatcher(EXTRACTORS[name](), range_offset_m=range_offset_m))
    return FourierOdometry(range_offset_m=range_offset_m)
