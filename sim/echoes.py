"""Echoes: what ray tracing hands to the receiver, one entry per return path and azimuth that receives it."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True)
class Returns:
    """What each of R return paths is, whichever azimuths receive it.

    Attributes:
        bounces: Surfaces met out and back (R,) uint8: 1 direct, 2 loop, 3 mirror ghost or longer loop.
        instance: Instance id of the last surface (R,) uint32.
        material: Material id of the last surface (R,) uint8.
        moving: Whether a surface on the path moves (R,) bool.
        surfaces: Instance ids of the surfaces on the outward path, in order (R, D) uint32; 0 beyond the last.
        coherent: Whether the return is the phase sum of a target, without speckle (R,) bool.
        displaced: Whether the return shows where none of the surfaces on its path is (R,) bool; never with
            one surface, see `sim.raytracing.displacement`.
    """

    bounces: NDArray[np.uint8]
    instance: NDArray[np.uint32]
    material: NDArray[np.uint8]
    moving: NDArray[np.bool_]
    surfaces: NDArray[np.uint32]
    coherent: NDArray[np.bool_]
    displaced: NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class Origin:
    """The scan that echoes were traced for.

    Attributes:
        scan: Number of the scan.
        seed: Seed of its simulator.
    """

    scan: int
    seed: int

    def __str__(self) -> str:
        """Return scan and seed as messages name them."""
        return f"scan {self.scan} and seed {self.seed}"


@dataclass(frozen=True, kw_only=True)
class Echoes:
    """The E echoes of a scan, ordered by return and azimuth, the same for any number of threads.

    Attributes:
        azimuth: Number of the azimuth that receives the echo (E,) int32.
        range_m: Half the path length, Doppler shift included (E,) float64 [m].
        amplitude: Amplitude with speckle and carrier phase (E,) complex64 [sqrt(W)].
        mean_power: Mean power over speckle (E,) float32 [W].
        source: Index into `returns` (E,) uint32.
        sidelobe: Whether the echo is received outside the main lobe (E,) bool.
        closing_mps: Radial speed, positive when approaching (E,) float32 [m/s].
        returns: The return paths.
        first_obstacle_m: Distance of the first object in the beam that is not ground (azimuths,) float32
            [m], inf where there is none.
        origin: The scan that they were traced for; None where they were not traced.
    """

    azimuth: NDArray[np.int32]
    range_m: NDArray[np.float64]
    amplitude: NDArray[np.complex64]
    mean_power: NDArray[np.float32]
    source: NDArray[np.uint32]
    sidelobe: NDArray[np.bool_]
    closing_mps: NDArray[np.float32]
    returns: Returns
    first_obstacle_m: NDArray[np.float32]
    origin: Origin | None = None

    def __len__(self) -> int:
        """Return the number of echoes."""
        return len(self.azimuth)

    @property
    def bounces(self) -> NDArray[np.uint8]:
        """Bounce order of each echo (E,)."""
        return self.returns.bounces[self.source]

    @property
    def instance(self) -> NDArray[np.uint32]:
        """Instance id of the last object that each echo met (E,)."""
        return self.returns.instance[self.source]

    @property
    def moving(self) -> NDArray[np.bool_]:
        """Whether an object on the path of each echo moves (E,)."""
        return self.returns.moving[self.source]

    @property
    def displaced(self) -> NDArray[np.bool_]:
        """Whether each echo shows where no surface on its path is (E,)."""
        return self.returns.displaced[self.source]

    def select(self, keep: NDArray[np.bool_]) -> "Echoes":
        """Return some of the echoes.

        Args:
            keep: Which to keep (E,) bool.

        Returns:
            The echoes where `keep` is true, with all return paths.
        """
        return replace(self, **{name: getattr(self, name)[keep] for name in _PER_ECHO})

    def scaled(self, power_gain: NDArray[np.float64]) -> "Echoes":
        """Return the echoes with their power changed.

        Args:
            power_gain: Factor on the power of each echo (E,) float64 [W/W].

        Returns:
            The same echoes with other amplitudes and mean powers.
        """
        gain = power_gain.astype(np.float32)
        return replace(self, amplitude=self.amplitude * np.sqrt(gain), mean_power=self.mean_power * gain)


_PER_ECHO = ("azimuth", "range_m", "amplitude", "mean_power", "source", "sidelobe", "closing_mps")


def point_echoes(*, azimuth: NDArray, range_m: NDArray, amplitude: NDArray, azimuths: int) -> Echoes:
    """Return echoes of point reflectors, each received in one azimuth.

    Args:
        azimuth: Number of the azimuth of each echo (E,).
        range_m: Range of each echo (E,) [m].
        amplitude: Complex amplitude of each echo (E,) [sqrt(W)].
        azimuths: Number of azimuths of the scan.

    Returns:
        The echoes, direct, coherent and at rest.
    """
    count = len(azimuth)
    returns = Returns(
        bounces=np.ones(count, np.uint8),
        instance=np.zeros(count, np.uint32),
        material=np.zeros(count, np.uint8),
        moving=np.zeros(count, np.bool_),
        surfaces=np.zeros((count, 1), np.uint32),
        coherent=np.ones(count, np.bool_),
        displaced=np.zeros(count, np.bool_),
    )
    amplitude = np.asarray(amplitude, np.complex64)
    return Echoes(
        azimuth=np.asarray(azimuth, np.int32),
        range_m=np.asarray(range_m, np.float64),
        amplitude=amplitude,
        mean_power=np.abs(amplitude) ** 2,
        source=np.arange(count, dtype=np.uint32),
        sidelobe=np.zeros(count, np.bool_),
        closing_mps=np.zeros(count, np.float32),
        returns=returns,
        first_obstacle_m=np.full(azimuths, np.inf, np.float32),
    )
