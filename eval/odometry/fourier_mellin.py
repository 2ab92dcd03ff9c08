"""A classical odometry to compare with: the Fourier-Mellin way, turn from spectra, then shift from pictures.

Sources: Reddy & Chatterji, "An FFT-Based Technique for Translation, Rotation, and Scale-Invariant Image
Registration", IEEE TIP 1996, and for radar Park et al., "PhaRaO", ICRA 2020. Magnitudes of spectra turn with
the picture and do not feel its shift; there is no scale to find, so radii stay linear.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from echoscape.eval.odometry.interface import PairFailed, PairMotion
from echoscape.learn.data.image import ImageSettings, Projector, range_cells
from echoscape.sim.datasets.polar_scan import PolarScan

_LOUDNESS = 1000.0
"""How far below its largest value the logarithm of a spectrum's magnitude levels off: 60 dB."""
_SMALLEST = 1e-12


@dataclass(frozen=True, kw_only=True)
class FourierSettings:
    """How pictures are compared.

    image: the picture of a scan; floor_code: code up to which cells count as empty (13 dB, which noise alone
    seldom exceeds); directions: of the spectrum, over half a turn; band: radii of the spectrum that are
    compared, as parts of the sampling frequency; blur_px: low-pass before the shift is sought, standard
    deviation [px]; largest_shift_m [m], largest_turn_rad [rad]: what is searched, 60 m/s and 120 deg/s at
    four scans a second.
    """

    image: ImageSettings = field(default_factory=lambda: ImageSettings(pixel_m=0.4, size=384))
    floor_code: int = 26
    directions: int = 720
    band: tuple[float, float] = (0.02, 0.25)
    blur_px: float = 1.0
    largest_shift_m: float = 15.0
    largest_turn_rad: float = math.radians(30)


@dataclass(frozen=True, kw_only=True)
class FourierFeatures:
    """A scan to compare.

    cells (azimuths, cells) uint8: codes above the floor by range cell; spectrum (size, size / 2 + 1)
    complex64: of its picture; directions (directions, radii) complex64: transform over the direction of the
    spectrum's magnitude.
    """

    cells: NDArray[np.uint8]
    spectrum: NDArray[np.complex64]
    directions: NDArray[np.complex64]


class FourierOdometry:
    """Odometry without learning: one turn and one shift for the whole picture, whatever moves in it."""

    def __init__(self, settings: FourierSettings | None = None, *, range_offset_m: float = 0.0) -> None:
        """Prepare; `range_offset_m` is what to add to the ranges of bins [m], as in `ScanFolder`."""
        self.settings = settings or FourierSettings()
        self.range_offset_m = range_offset_m
        size = self.settings.image.size
        taper = np.hanning(size + 2)[1:-1].astype(np.float32)
        self._window = np.outer(taper, taper)
        self._low_pass = _low_pass(size, self.settings.blur_px)
        self._places = _direction_places(self.settings)
        self._projectors: dict[int, Projector] = {}

    @property
    def name(self) -> str:
        """What results are labelled with."""
        return "fourier"

    def features(self, scan: PolarScan) -> FourierFeatures:
        """Return the spectrum of the scan's picture.

        Raises:
            PairFailed: nothing in the scan rises above the floor.
        """
        floor, image = self.settings.floor_code, self.settings.image
        codes = np.where(scan.codes > floor, scan.codes - np.uint8(floor), np.uint8(0))
        cells = range_cells(codes, scan.bin_m, image, range_offset_m=self.range_offset_m)
        if not cells.any():
            raise PairFailed(f"no echo above code {floor} beyond {image.near_m:g} m")
        spectrum = self._spectrum(cells, 0.0)
        magnitude = np.abs(spectrum)
        loudness = np.log1p(_LOUDNESS / magnitude.max() * magnitude)
        rings = map_coordinates(loudness, self._places, order=1, mode="grid-wrap")
        rings -= rings.mean(axis=0)  # what all directions share says nothing of the turn
        directions = np.fft.rfft(rings, axis=0).astype(np.complex64)
        return FourierFeatures(cells=cells, spectrum=spectrum, directions=directions)

    def start(self, scan: PolarScan) -> FourierFeatures:
        """Return the scan's features.

        Raises:
            PairFailed: see `features`.
        """
        return self.features(scan)

    def follow(self, state: FourierFeatures, scan: PolarScan) -> tuple[PairMotion, FourierFeatures]:
        """Return the motion since the scan before, and the scan's features.

        Raises:
            PairFailed: see `features` and `motion`.
        """
        later = self.features(scan)
        return self.motion(state, later), later

    def motion(self, earlier: FourierFeatures, later: FourierFeatures) -> PairMotion:
        """Return the turn at which the spectra agree, then the shift at which the pictures do.

        Raises:
            PairFailed: the spectra do not depend on the direction, so that the turn is open.
        """
        turn_rad = self._turn(earlier.directions, later.directions)
        x_m, y_m = self._shift(earlier.spectrum, self._spectrum(later.cells, turn_rad))
        return PairMotion(x_m=x_m, y_m=y_m, yaw_rad=turn_rad)

    def _spectrum(self, cells: NDArray[np.uint8], turn_rad: float) -> NDArray[np.complex64]:
        """Return the spectrum of the picture of `cells`, its content turned clockwise by `turn_rad`."""
        rows = len(cells)
        if rows not in self._projectors:
            self._projectors[rows] = Projector(self.settings.image, rows)
        picture = self._projectors[rows].image(cells, turn_rad=turn_rad)[0].numpy()
        return np.fft.rfft2(picture * self._window).astype(np.complex64)

    def _turn(self, earlier: NDArray[np.complex64], later: NDArray[np.complex64]) -> float:
        """Return the yaw of the later scan [rad]: how far its content turned anticlockwise."""
        count = self.settings.directions
        agreement = np.fft.irfft((earlier * later.conj()).sum(axis=1), count)
        reach = round(self.settings.largest_turn_rad * count / math.pi)
        lags = np.arange(-reach - 1, reach + 2)
        values = agreement[lags]
        peak = int(np.argmax(values[1:-1])) + 1
        if not values[peak] > 0:
            raise PairFailed("the scan looks the same from all directions, the turn is open")
        return float(lags[peak] + _vertex(*values[peak - 1 : peak + 2])) * math.pi / count

    def _shift(self, earlier: NDArray[np.complex64], later: NDArray[np.complex64]) -> tuple[float, float]:
        """Return forward, right [m] at which the phases of two spectra agree best."""
        image = self.settings.image
        cross = earlier * later.conj()
        phases = cross / (np.abs(cross) + _SMALLEST) * self._low_pass
        agreement = np.fft.irfft2(phases, (image.size, image.size))
        reach = round(self.settings.largest_shift_m / image.pixel_m)
        lags = np.arange(-reach - 1, reach + 2)
        values = agreement[np.ix_(lags, lags)]
        inner = values[1:-1, 1:-1]
        i, j = (int(place) + 1 for place in np.unravel_index(np.argmax(inner), inner.shape))
        down = lags[i] + _vertex(*values[i - 1 : i + 2, j])
        right = lags[j] + _vertex(*values[i, j - 1 : j + 2])
        return float(-down * image.pixel_m), float(right * image.pixel_m)


def _vertex(before: float, at: float, after: float) -> float:
    """Return where the parabola through three values at -1, 0 and 1 is highest."""
    bend = before - 2 * at + after
    return 0.5 * (before - after) / bend if bend < 0 else 0.0


def _low_pass(size: int, blur_px: float) -> NDArray[np.float32]:
    """Return the transform (size, size / 2 + 1) of a Gaussian of standard deviation `blur_px`."""
    down, right = np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size)[None, :]
    return np.exp(-2 * (math.pi * blur_px) ** 2 * (down**2 + right**2)).astype(np.float32)


def _direction_places(settings: FourierSettings) -> NDArray[np.float64]:
    """Return row and column (2, directions, radii) in a spectrum, directions clockwise from forward."""
    size = settings.image.size
    angle = np.arange(settings.directions)[:, None] * (math.pi / settings.directions)
    radius = np.arange(round(settings.band[0] * size), round(settings.band[1] * size)).astype(np.float64)
    return np.stack([-np.cos(angle) * radius % size, np.sin(angle) * radius])
