"""Scans of a spinning FMCW radar in procedural towns, with exact truth, and learned radar odometry.

    import echoscape

    scan = echoscape.scan("town", seed=7, index=0)

Every name is imported on first use, so that importing the package loads neither the ray tracer nor PyTorch.
docs/api.md lists them.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from echoscape.eval.odometry.kitti_drift import kitti_drift as kitti_drift
    from echoscape.eval.odometry.pipeline import Odometry as Odometry
    from echoscape.learn.model.keypoint_model import KeypointModel as KeypointModel
    from echoscape.scenes.driving.ego_drive import plan_ego_drive
    from echoscape.scenes.town.build import build_town as build_town
    from echoscape.sim.datasets.polar_scan import PolarScan as PolarScan
    from echoscape.sim.datasets.scan_folder import open_folder as open_folder
    from echoscape.sim.effects.echo_filter import EchoFilter as EchoFilter
    from echoscape.sim.generation.single_scan import scan as scan
    from echoscape.sim.sensor.sensor import Sensor as Sensor
    from echoscape.sim.settings.artefacts import Artefacts as Artefacts
    from echoscape.sim.simulator import Simulator as Simulator

    plan_drive = plan_ego_drive
    __version__: str
else:
    _PACKAGES = ("cli", "eval", "learn", "scenes", "sim", "testing")
    _NAMES = {
        "Artefacts": "sim.settings.artefacts.Artefacts",
        "EchoFilter": "sim.effects.echo_filter.EchoFilter",
        "KeypointModel": "learn.model.keypoint_model.KeypointModel",
        "Odometry": "eval.odometry.pipeline.Odometry",
        "PolarScan": "sim.datasets.polar_scan.PolarScan",
        "Sensor": "sim.sensor.sensor.Sensor",
        "Simulator": "sim.simulator.Simulator",
        "build_town": "scenes.town.build.build_town",
        "kitti_drift": "eval.odometry.kitti_drift.kitti_drift",
        "open_folder": "sim.datasets.scan_folder.open_folder",
        "plan_drive": "scenes.driving.ego_drive.plan_ego_drive",
        "scan": "sim.generation.single_scan.scan",
    }
    __all__ = [*_NAMES, "__version__"]

    def __getattr__(name: str) -> object:
        """Import a public name or a package on first use (PEP 562)."""
        if name == "__version__":
            from importlib import metadata

            value = metadata.version(__name__)
        elif name in _PACKAGES:
            return import_module(f"{__name__}.{name}")
        elif name in _NAMES:
            module, _, attribute = _NAMES[name].rpartition(".")
            try:
                value = getattr(import_module(f"{__name__}.{module}"), attribute)
            except ModuleNotFoundError as error:
                if error.name not in ("torch", "safetensors"):
                    raise
                raise ImportError(f'{name} needs PyTorch: pip install "echoscape[learn]"') from error
        else:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        globals()[name] = value
        return value

    def __dir__() -> list[str]:
        """List the public names and the packages."""
        return sorted([*__all__, *_PACKAGES])
