"""Echoes: what a traced scan hands to the waveform, one entry for each return in each row that hears it."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True)
class Returns:
    """What each of R return paths is, whichever rows hear it.

    bounces (R,) uint8: surfaces met out and back (1 direct, 2 loop, 3 mirror ghost or longer loop);
    instance (R,) uint32: the last of them; material (R,) uint8; moving (R,) bool; surfaces (R, D) uint32:
    instance ids of the surfaces met on the way out, in order, 0 where there are no more; coherent (R,)
    bool: a target's phase sum, without speckle.
    """

    bounces: NDArray[np.uint8]
    instance: NDArray[np.uint32]
    material: NDArray[np.uint8]
    moving: NDArray[np.bool_]
    surfaces: NDArray[np.uint32]
    coherent: NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class Origin:
    """Whence echoes were traced: the number of the scan, and the seed of its simulator."""

    scan: int
    seed: int

    def __str__(self) -> str:
        """Return it as messages tell it."""
        return f"scan {self.scan} and seed {self.seed}"


@dataclass(frozen=True, kw_only=True)
class Echoes:
    """E echoes, ordered by return and row, the same for any number of threads.

    row (E,) int32; range_m (E,) float64: half the path, Doppler shift included [m]; amplitude (E,) complex64
    [sqrt(W)], speckle and carrier phase included; mean_power (E,) float32: its mean over speckle [W];
    source (E,) uint32: index into `returns`; sidelobe (E,) bool: outside the beam's main lobe;
    closing_mps (E,) float32: radial speed, positive when approaching [m/s].
    Per row, `first_m` (A,) float32: distance of the first thing in the beam that is no ground [m], inf if
    none. origin: None where they were made by hand.
    """

    row: NDArray[np.int32]
    range_m: NDArray[np.float64]
    amplitude: NDArray[np.complex64]
    mean_power: NDArray[np.float32]
    source: NDArray[np.uint32]
    sidelobe: NDArray[np.bool_]
    closing_mps: NDArray[np.float32]
    returns: Returns
    first_m: NDArray[np.float32]
    origin: Origin | None = None

    def __len__(self) -> int:
        """Return the number of echoes."""
        return len(self.row)

    @property
    def bounces(self) -> NDArray[np.uint8]:
        """Bounce order (E,) of each echo."""
        return self.returns.bounces[self.source]

    @property
    def instance(self) -> NDArray[np.uint32]:
        """Instance id (E,) of the last thing that each echo met."""
        return self.returns.instance[self.source]

    @property
    def moving(self) -> NDArray[np.bool_]:
        """Whether each echo's thing (E,) moves."""
        return self.returns.moving[self.source]

    def select(self, keep: NDArray[np.bool_]) -> "Echoes":
        """Return the echoes where `keep` (E,) is true."""
        return replace(self, **{name: getattr(self, name)[keep] for name in _BY_ECHO})

    def scaled(self, power_gain: NDArray[np.float64]) -> "Echoes":
        """Return the echoes with their power changed by factors (E,)."""
        gain = power_gain.astype(np.float32)
        return replace(self, amplitude=self.amplitude * np.sqrt(gain), mean_power=self.mean_power * gain)


_BY_ECHO = ("row", "range_m", "amplitude", "mean_power", "source", "sidelobe", "closing_mps")


def point_echoes(
    *,
    row: NDArray,
    range_m: NDArray,
    amplitude: NDArray,
    azimuths: int,
) -> Echoes:
    """Return one echo for each row (E,), range (E,) [m] and complex amplitude (E,) [sqrt(W)] given."""
    count = len(row)
    returns = Returns(
        bounces=np.ones(count, np.uint8),
        instance=np.zeros(count, np.uint32),
        material=np.zeros(count, np.uint8),
        moving=np.zeros(count, np.bool_),
        surfaces=np.zeros((count, 1), np.uint32),
        coherent=np.ones(count, np.bool_),
    )
    amplitude = np.asarray(amplitude, np.complex64)
    return Echoes(
        row=np.asarray(row, np.int32),
        range_m=np.asarray(range_m, np.float64),
        amplitude=amplitude,
        mean_power=np.abs(amplitude) ** 2,
        source=np.arange(count, dtype=np.uint32),
        sidelobe=np.zeros(count, np.bool_),
        closing_mps=np.zeros(count, np.float32),
        returns=returns,
        first_m=np.full(azimuths, np.inf, np.float32),
    )
