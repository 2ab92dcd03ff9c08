"""The radar: a scene and a drive become polar scans with their truth.

Public names are imported on first use.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from echoscape.sim.datasets.polar_scan import PolarScan as PolarScan
    from echoscape.sim.datasets.scan_folder import open_folder as open_folder
    from echoscape.sim.effects.echo_filter import EchoFilter as EchoFilter
    from echoscape.sim.effects.sensor_faults import SensorFaults as SensorFaults
    from echoscape.sim.effects.sensor_faults import faulty_scans as faulty_scans
    from echoscape.sim.generation.dataset import write_dataset as write_dataset
    from echoscape.sim.sensor.cir204 import CIR204 as CIR204
    from echoscape.sim.sensor.cir304 import CIR304 as CIR304
    from echoscape.sim.sensor.cir304 import CIR304_RT as CIR304_RT
    from echoscape.sim.sensor.cts350x import CTS350X as CTS350X
    from echoscape.sim.sensor.cts_small import CTS_SMALL as CTS_SMALL
    from echoscape.sim.sensor.sensor import Sensor as Sensor
    from echoscape.sim.settings.artefacts import Artefacts as Artefacts
    from echoscape.sim.simulator import Simulator as Simulator
else:
    from lazy_loader import attach

    __getattr__, __dir__, __all__ = attach(
        __name__,
        submod_attrs={
            "datasets.polar_scan": ["PolarScan"],
            "datasets.scan_folder": ["open_folder"],
            "effects.echo_filter": ["EchoFilter"],
            "effects.sensor_faults": ["SensorFaults", "faulty_scans"],
            "generation.dataset": ["write_dataset"],
            "sensor.cir204": ["CIR204"],
            "sensor.cir304": ["CIR304", "CIR304_RT"],
            "sensor.cts350x": ["CTS350X"],
            "sensor.cts_small": ["CTS_SMALL"],
            "sensor.sensor": ["Sensor"],
            "settings.artefacts": ["Artefacts"],
            "simulator": ["Simulator"],
        },
    )
