"""For authors of tests: small scans with known content, and golden scans, as fixtures that pytest finds.

docs/testing.md shows how. Public names are imported on first use, so that pytest starts as fast as without.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from echoscape.testing.golden import GoldenScans as GoldenScans
    from echoscape.testing.scans import ScanPair as ScanPair
    from echoscape.testing.scans import make_drive as make_drive
    from echoscape.testing.scans import make_pair as make_pair
    from echoscape.testing.scans import make_scan as make_scan
    from echoscape.testing.settings import ScanSettings as ScanSettings
    from echoscape.testing.target import TargetScan as TargetScan
    from echoscape.testing.target import make_target as make_target
else:
    from lazy_loader import attach

    __getattr__, __dir__, __all__ = attach(
        __name__,
        submod_attrs={
            "golden": ["GoldenScans"],
            "scans": ["ScanPair", "make_drive", "make_pair", "make_scan"],
            "settings": ["ScanSettings"],
            "target": ["TargetScan", "make_target"],
        },
    )
