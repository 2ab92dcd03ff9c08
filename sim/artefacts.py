"""The causes that make a scan look real, each with a switch.

Switching one off changes only what it causes: the town, the echoes and the random draws of the others stay.
"""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Artefacts:
    """Which effects a scan has."""

    speckle: bool = True
    """Random reflectivity of scatterers fixed in the world; off: every scatterer has its mean."""
    ghosts: bool = True
    """Paths that meet more than one surface."""
    sidelobes: bool = True
    """What the beam hears outside its main lobe."""
    saturation: bool = True
    """Clipping at the converter's full scale."""
    phase_noise: bool = True
    """Phase noise of the synthesiser, with range correlation."""
    thermal_noise: bool = True
    """Noise of the receiver."""
    leakage: bool = True
    """Transmit-receive leakage and echoes of the radome."""
    quantisation: bool = True
    """Steps of the analogue-to-digital converter; off: the finest that 16 bits allow a row."""
    motion_distortion: bool = True
    """The rolling scan: every row from its own pose; off: all rows from the pose at mid-scan."""
    doppler: bool = True
    """Range shift by radial speed."""
    movers: bool = True
    """Things that move."""

    @property
    def linear(self) -> bool:
        """Whether the receiver is linear, so that nothing distorts."""
        return not (self.saturation or self.phase_noise or self.quantisation)
