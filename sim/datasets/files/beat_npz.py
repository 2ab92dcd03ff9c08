"""The beat signal of a scan as a NumPy archive that `numpy.load` opens, the same bytes for the same signal.

docs/conventions.md defines its arrays. Samples are mostly noise of some 17 steps of the converter:
compression at level 1 takes 18 ms to save a third of a megabyte, and higher levels save no more.
"""

from pathlib import Path

from echoscape.sim.datasets.beat_signal import BeatSignal
from echoscape.sim.datasets.files.atomic_write import DatasetError, write_atomic
from echoscape.sim.datasets.files.npz import archive_bytes, read_archive
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.sensor.sensor import Sensor

_LEVEL = 1
NAMES = ("samples", "scale")
"""Names of the arrays in a beat file, in their order."""


def beat_bytes(beat: BeatSignal) -> bytes:
    """Encode a beat signal.

    Args:
        beat: The beat signal of a scan.

    Returns:
        The bytes of an .npz archive.
    """
    return archive_bytes({name: getattr(beat, name) for name in NAMES}, level=_LEVEL)


def write_beat(path: Path, beat: BeatSignal) -> None:
    """Write a beat signal, whole or not at all.

    Args:
        path: File to write.
        beat: The beat signal of a scan.

    Raises:
        OSError: The folder cannot be written to.
    """
    write_atomic(path, beat_bytes(beat))


def read_beat(path: Path, *, sensor: Sensor = CTS350X) -> BeatSignal:
    """Read a beat signal.

    Args:
        path: A file that `write_beat` wrote.
        sensor: The radar, which gives the number of azimuths and samples.

    Returns:
        The beat signal of the scan.

    Raises:
        DatasetError: The file is absent, damaged, lacks an array, or an array does not fit the sensor; the
            message names both.
    """
    path = Path(path)
    found = read_archive(path, NAMES, kind="beat file")
    expected = (sensor.azimuths, sensor.samples)
    if found["samples"].shape != expected:
        raise DatasetError(
            f"{path}: samples of {sensor.name} have shape {expected}, these have {found['samples'].shape}"
        )
    try:
        return BeatSignal(**found)
    except ValueError as error:
        raise DatasetError(f"{path}: {error}") from error
