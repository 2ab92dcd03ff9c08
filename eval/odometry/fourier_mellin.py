"""Odometry without learning: phase correlation, the rotation from spectra, then the translation from images.

Sources: Reddy & Chatterji, "An FFT-Based Technique for Translation, Rotation, and Scale-Invariant Image
Registration", IEEE TIP 1996 (the Fourier-Mellin method), and for radar Park et al., "PhaRaO", ICRA 2020. The
magnitude of a spectrum rotates with the image and does not depend on its translation; the scale of radar
images is known, so radii stay linear.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from echoscape.eval.odometry.interface import PairFailed, PairMotion
from echoscape.sim.datasets.cartesian import polar_to_cartesian, range_averages
from echoscape.sim.datasets.polar_scan import PolarScan

_DYNAMIC_RANGE = 1000.0
"""Ratio of a spectrum's largest magnitude to the one where its logarithm levels off: 60 dB."""
_MIN_MAGNITUDE = 1e-12


@dataclass(frozen=True, kw_only=True)
class FourierSettings:
    """How scans are compared.

    Attributes:
        pixel_m: Width of a pixel of the images [m].
        size: Pixels along a side of the images.
        near_m: Range below which a scan counts as empty, where leakage and the car are [m].
        floor_code: Code up to which cells count as empty: 13 dB, which noise alone seldom exceeds.
        directions: Directions of the spectrum over half a revolution.
        band: Radii of the spectrum that are compared, as parts of the sampling frequency.
        blur_px: Standard deviation of the low-pass before the translation is searched [px].
        max_translation_m: Largest translation that is searched: 60 m/s at four scans a second [m].
        max_rotation_rad: Largest rotation that is searched: 120 deg/s at four scans a second [rad].
    """

    pixel_m: float = 0.4
    size: int = 384
    near_m: float = 3.0
    floor_code: int = 26
    directions: int = 720
    band: tuple[float, float] = (0.02, 0.25)
    blur_px: float = 1.0
    max_translation_m: float = 15.0
    max_rotation_rad: float = math.radians(30)


@dataclass(frozen=True, kw_only=True)
class FourierFeatures:
    """What is kept of a scan for comparison.

    Attributes:
        cells: Codes above the floor (azimuths, cells) uint8, averaged to range cells of half a pixel.
        first_rad: Direction of the first azimuth, clockwise from ahead [rad].
        spectrum: Spectrum of its image (size, size / 2 + 1) complex64.
        directions: Transform over the direction of the spectrum's magnitude (frequencies, radii) complex64.
    """

    cells: NDArray[np.uint8]
    first_rad: float
    spectrum: NDArray[np.complex64]
    directions: NDArray[np.complex64]


class FourierOdometry:
    """Odometry without learning: one rotation and one translation for the whole image."""

    def __init__(self, settings: FourierSettings | None = None, *, range_offset_m: float = 0.0) -> None:
        """Prepare for scans of any size.

        Args:
            settings: How scans are compared.
            range_offset_m: Offset to the ranges of bins [m], as in `ScanFolder`.
        """
        self.settings = settings or FourierSettings()
        self.range_offset_m = range_offset_m
        size = self.settings.size
        taper = np.hanning(size + 2)[1:-1].astype(np.float32)
        self._window = np.outer(taper, taper)
        self._low_pass = _low_pass(size, self.settings.blur_px)
        self._polar_grid = _polar_grid(self.settings)

    @property
    def name(self) -> str:
        """Name of the method in results."""
        return "fourier"

    def features(self, scan: PolarScan) -> FourierFeatures:
        """Compute the spectrum of the image of a scan.

        Args:
            scan: The scan.

        Returns:
            What is kept of it.

        Raises:
            PairFailed: No cell is above the floor.
        """
        settings = self.settings
        floor = settings.floor_code
        codes = np.where(scan.codes > floor, scan.codes - np.uint8(floor), np.uint8(0))
        cells = range_averages(
            codes,
            scan.bin_m,
            cell_m=settings.pixel_m / 2,
            cells=math.ceil(math.sqrt(2) * settings.size) + 1,  # up to the corners of the image
            near_m=settings.near_m,
            range_offset_m=self.range_offset_m,
        )
        if not cells.any():
            raise PairFailed(f"no echo above code {floor} beyond {settings.near_m:g} m")
        spectrum = self._spectrum(cells, scan.first_azimuth_rad)
        magnitude = np.abs(spectrum)
        level = np.log1p(_DYNAMIC_RANGE / magnitude.max() * magnitude)
        rings = map_coordinates(level, self._polar_grid, order=1, mode="grid-wrap")
        rings -= rings.mean(axis=0)  # the mean over directions does not depend on the rotation
        directions = np.fft.rfft(rings, axis=0).astype(np.complex64)
        return FourierFeatures(
            cells=cells, first_rad=scan.first_azimuth_rad, spectrum=spectrum, directions=directions
        )

    def start(self, scan: PolarScan) -> FourierFeatures:
        """Begin a drive with a scan.

        Args:
            scan: The first scan.

        Returns:
            What is kept of it.

        Raises:
            PairFailed: No cell is above the floor.
        """
        return self.features(scan)

    def follow(self, state: FourierFeatures, scan: PolarScan) -> tuple[PairMotion, FourierFeatures]:
        """Estimate the motion since the scan before.

        Args:
            state: What was kept of the scan before.
            scan: The next scan.

        Returns:
            The motion, and what is kept of the scan.

        Raises:
            PairFailed: No cell is above the floor, or the rotation is not determined.
        """
        later = self.features(scan)
        return self.motion(state, later), later

    def motion(self, earlier: FourierFeatures, later: FourierFeatures) -> PairMotion:
        """Estimate the rotation at which two spectra agree best, then the translation of the images.

        Args:
            earlier: What was kept of the earlier scan.
            later: What was kept of the later scan.

        Returns:
            The pose of the later scan in the frame of the earlier one.

        Raises:
            PairFailed: The spectra do not depend on direction, so that the rotation is not determined.
        """
        yaw_rad = self._rotation(earlier.directions, later.directions)
        x_m, y_m = self._translation(earlier.spectrum, self._spectrum(later.cells, later.first_rad + yaw_rad))
        return PairMotion(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad)

    def _spectrum(self, cells: NDArray[np.uint8], first_rad: float) -> NDArray[np.complex64]:
        """Return the spectrum of the image of `cells`, whose first azimuth looks along `first_rad`."""
        settings = self.settings
        image = polar_to_cartesian(
            cells, settings.pixel_m / 2, first_rad=first_rad, pixel_m=settings.pixel_m, size=settings.size
        )
        return np.fft.rfft2(image * self._window).astype(np.complex64)

    def _rotation(self, earlier: NDArray[np.complex64], later: NDArray[np.complex64]) -> float:
        """Return the yaw of the later scan [rad]: the anticlockwise rotation of its content."""
        count = self.settings.directions
        correlation = np.fft.irfft((earlier * later.conj()).sum(axis=1), count)
        reach = round(self.settings.max_rotation_rad * count / math.pi)
        lags = np.arange(-reach - 1, reach + 2)
        values = correlation[lags]
        peak = int(np.argmax(values[1:-1])) + 1
        if not values[peak] > 0:
            raise PairFailed("the scan looks the same in all directions, the rotation is not determined")
        return float(lags[peak] + _vertex(*values[peak - 1 : peak + 2])) * math.pi / count

    def _translation(
        self, earlier: NDArray[np.complex64], later: NDArray[np.complex64]
    ) -> tuple[float, float]:
        """Return forward, right [m] at which the phases of two spectra agree best."""
        settings = self.settings
        cross = earlier * later.conj()
        phases = cross / (np.abs(cross) + _MIN_MAGNITUDE) * self._low_pass
        agreement = np.fft.irfft2(phases, (settings.size, settings.size))
        reach = round(settings.max_translation_m / settings.pixel_m)
        lags = np.arange(-reach - 1, reach + 2)
        values = agreement[np.ix_(lags, lags)]
        inner = values[1:-1, 1:-1]
        i, j = (int(place) + 1 for place in np.unravel_index(np.argmax(inner), inner.shape))
        down = lags[i] + _vertex(*values[i - 1 : i + 2, j])
        right = lags[j] + _vertex(*values[i, j - 1 : j + 2])
        return float(-down * settings.pixel_m), float(right * settings.pixel_m)


def _vertex(before: float, at: float, after: float) -> float:
    """Return the abscissa of the vertex of the parabola through three values at -1, 0 and 1."""
    bend = before - 2 * at + after
    return 0.5 * (before - after) / bend if bend < 0 else 0.0


def _low_pass(size: int, blur_px: float) -> NDArray[np.float32]:
    """Return the spectrum (size, size / 2 + 1) of a Gaussian of standard deviation `blur_px`."""
    down, right = np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size)[None, :]
    return np.exp(-2 * (math.pi * blur_px) ** 2 * (down**2 + right**2)).astype(np.float32)


def _polar_grid(settings: FourierSettings) -> NDArray[np.float64]:
    """Return row and column (2, directions, radii) of a polar grid in a spectrum, clockwise from forward."""
    size = settings.size
    angle = np.arange(settings.directions)[:, None] * (math.pi / settings.directions)
    radius = np.arange(round(settings.band[0] * size), round(settings.band[1] * size)).astype(np.float64)
    return np.stack([-np.cos(angle) * radius % size, np.sin(angle) * radius])
