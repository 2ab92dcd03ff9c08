"""The physical laws that the simulator is tested for, as rows of docs/physics.md.

A test records a law with an expected number that is computed apart from the simulator. The page lists
expected and simulated value, the tolerance and its reason.
"""

import math
from dataclasses import dataclass, field
from typing import Literal, Protocol

from tests.paths import ROOT

PAGE = ROOT / "docs" / "physics.md"

Section = Literal[
    "Link and cross-sections",
    "Curved surfaces and road users",
    "Antenna",
    "Materials",
    "Roughness",
    "Speckle",
    "FMCW",
    "Receiver",
    "Multipath",
    "Motion",
    "Weather and interference",
]
SECTIONS: tuple[Section, ...] = (
    "Link and cross-sections",
    "Curved surfaces and road users",
    "Antenna",
    "Materials",
    "Roughness",
    "Speckle",
    "FMCW",
    "Receiver",
    "Multipath",
    "Motion",
    "Weather and interference",
)
INTRO = """\
# Physics

The physical laws that the simulator is tested for. Each row has a law, its source, the value that follows
from it by hand, the simulated value, the tolerance and the reason for the tolerance. The tests in
`tests/physics` compute the expected values apart from the code, fail when a row does not hold, and write
this page:

    pytest tests/physics --write-physics

The sensor is the CTS350-X at 76.5 GHz (wavelength 3.919 mm) unless a row names another. Rows on windows,
peaks, the noise floor, the converter and rain use a sweep without the calibrated amplitude ripple
(`sweep_ripple_db`), which the row on paired echoes and [fidelity](fidelity.md) cover.

Known limits: the power that rays find in a patch of near ground differs between draws of their directions:
complex cells of two draws correlate by 0.6 to 0.8 there (soil, 6 to 30 m, default rays; 1 without that).
Expected widths of the windows are those of their cosine sums, 1.44, 1.30 and 1.64 cells at -3 dB (Harris
1978: 1.44, 1.30).

Cross-sections of road users are compared with 3GPP TR 38.901 V19.4, Tables 7.9.2.1-1 and -4 (cars: front
15.5, rear 14.6, sides 20.8, elsewhere 7 dBsm; adults -1.4 dBsm in the mean of power), and with the usual
figures at 76-79 GHz (car front and rear 10 to 20, oblique -5 to 5, cyclist -3 to 0, adult about -8 dBsm).
Measured at these frequencies: Fortuny-Guasch & Chareau, JRC report EUR 25762, 2013 (humans, 24 and 77 GHz);
Matsunami et al., ICSPCS 2012 (vehicles and pedestrians, 26 and 79 GHz); Buller et al., DOT HS 811 817, 2013
(cars). Methods differ by 5 dB and more. The whole table by aspect and range is in [scenes](scenes.md).
"""
HEADER = """\
| law | source | expected | simulated | tolerance | why this tolerance |
|---|---|---|---|---|---|
"""


@dataclass(frozen=True, kw_only=True)
class Law:
    """A law, what it predicts, what was simulated, and how far apart they may be, all in `unit`."""

    section: Section
    name: str
    source: str
    expected: float
    simulated: float
    tolerance: float
    unit: str
    why: str

    @property
    def holds(self) -> bool:
        """Whether the simulator keeps the law."""
        return abs(self.simulated - self.expected) <= self.tolerance

    @property
    def cells(self) -> tuple[str, ...]:
        """The row's cells as the page has them."""
        unit = f" {self.unit}" if self.unit else ""
        numbers = [_rounded(value, self.tolerance) for value in (self.expected, self.simulated)]
        tolerance = "exact" if self.tolerance == 0 else f"± {self.tolerance:.2g}{unit}"
        cells = (self.name, self.source, *(number + unit for number in numbers), tolerance, self.why)
        return tuple(cell.replace("|", r"\|") for cell in cells)

    def __str__(self) -> str:
        """Return the row as a test that fails says it."""
        unit = f" {self.unit}" if self.unit else ""
        return (
            f"{self.name}: expected {self.expected:.6g} +- {self.tolerance:.3g}{unit} ({self.source}), "
            f"simulated {self.simulated:.6g}{unit}"
        )


class LawRecorder(Protocol):
    """What the fixture `law` is called as."""

    def __call__(
        self,
        name: str,
        *,
        source: str,
        expected: float,
        simulated: float,
        tolerance: float,
        why: str,
        unit: str = "",
    ) -> None:
        """Record the law and fail where it does not hold."""


@dataclass
class Laws:
    """The laws that the tests of one run recorded, and whether those were all the tests."""

    rows: list[Law] = field(default_factory=list)
    complete: bool = True

    def record(self, law: Law) -> None:
        """Keep a row and fail where it does not hold."""
        assert law.name not in {row.name for row in self.rows}, f"{law.name} is recorded twice"
        self.rows.append(law)
        assert law.holds, str(law)


def page(rows: list[Law]) -> str:
    """Return docs/physics.md: the laws by section, in the order in which they were recorded."""
    parts = [INTRO]
    for section in SECTIONS:
        cells = [row.cells for row in rows if row.section == section]
        if cells:
            lines = "".join(f"| {' | '.join(row)} |\n" for row in cells)
            parts.append(f"\n## {section}\n\n{HEADER}{lines}")
    return "".join(parts)


def stated(text: str) -> dict[str, tuple[str, ...]]:
    """Return the cells of each row of the page, but for what was simulated, by law."""
    lines = [line[2:-2].split(" | ") for line in text.splitlines() if line.startswith("| ")]
    return {cells[0]: _lasting(tuple(cells)) for cells in lines if cells[0] != "law"}


def _lasting(cells: tuple[str, ...]) -> tuple[str, ...]:
    """Drop the simulated number, whose last digit may differ from processor to processor."""
    return cells[:3] + cells[4:]


def lasting_cells(law: Law) -> tuple[str, ...]:
    """Return what the page must say of a law whatever the processor."""
    return _lasting(law.cells)


def _rounded(value: float, tolerance: float) -> str:
    """Return a number with a digit more than its tolerance has."""
    if value == 0:
        return "0"
    if not 1e-3 <= abs(value) < 1e5:
        return f"{value:.3g}"
    if tolerance == 0:
        return f"{value:g}"
    text = f"{value:.{min(max(0, 1 - math.floor(math.log10(tolerance))), 6)}f}"
    return text.lstrip("-") if float(text) == 0 else text
