"""For authors of tests: small scans with known content, and golden scans, as fixtures that pytest finds.

docs/testing.md shows how. Public names are imported on first use, so that pytest starts as fast as without.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from echoscape.testing.golden import GoldenScans as GoldenScans
    from echoscape.testing.scans import ScanPair as ScanPair
    from echoscape.testing.scans import TargetScan as TargetScan
    from echoscape.testing.scans import make_drive as make_drive
    from echoscape.testing.scans import make_pair as make_pair
    from echoscape.testing.scans import make_scan as make_scan
    from echoscape.testing.scans import make_target as make_target
    from echoscape.testing.settings import ScanSettings as ScanSettings
else:
    from lazy_loader import attach

    __getattr__, __dir__, __all__ = attach(
        __name__,
        submod_attrs={
            "golden": ["GoldenScans"],
            "scans": ["ScanPair", "TargetScan", "make_drive", "make_pair", "make_scan", "make_target"],
            "settings": ["ScanSettings"],
        },
    )
