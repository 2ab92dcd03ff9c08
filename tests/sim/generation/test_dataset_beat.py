"""Raw data in a dataset: kept where asked for, worth the scan's own bytes, and no change to anything else."""

from dataclasses import replace
from pathlib import Path

import pytest
from numpy.testing import assert_array_equal

from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.files.beat_npz import read_beat
from echoscape.sim.datasets.files.navtech_png import read_png
from echoscape.sim.datasets.layouts.oxford import read_timestamps
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.dataset import write_dataset
from echoscape.sim.receiver.range_fft import codes_of_beat
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.settings.tracing import TraceSettings

CONFIG = SimulationConfig(preset="empty", seed=3, scans=2, trace=TraceSettings(rays=16))
KEEPING = replace(CONFIG, keep_beat=True)


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("plain") / "set"
    write_dataset(out, CONFIG)
    return out


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("kept") / "set"
    write_dataset(out, KEEPING)
    return out


def _bytes(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_kept_beat_gives_the_bytes_of_its_scan(kept: Path) -> None:
    stamps = read_timestamps(kept / "radar.timestamps")
    assert len(stamps) == 2
    for stamp in stamps:
        beat = read_beat(kept / "beat" / f"{stamp}.npz")
        assert_array_equal(codes_of_beat(beat, CTS350X), read_png(kept / "radar" / f"{stamp}.png").codes)


def test_keeping_the_beat_changes_no_other_file(plain: Path, kept: Path) -> None:
    without, with_beat = _bytes(plain), _bytes(kept)
    stamps = read_timestamps(plain / "radar.timestamps")
    assert with_beat.keys() - without.keys() == {f"beat/{stamp}.npz" for stamp in stamps}
    assert [name for name in without if without[name] != with_beat[name]] == ["echoscape.json"]


def test_beat_cannot_be_kept_of_scans_that_are_made(plain: Path) -> None:
    with pytest.raises(DatasetError, match="keep_beat was False, now it is True"):
        write_dataset(plain, KEEPING, resume=True)
    assert not (plain / "beat").exists()


def test_scan_without_its_beat_is_made_again(kept: Path) -> None:
    before = _bytes(kept)
    max((kept / "beat").iterdir()).unlink()
    write_dataset(kept, KEEPING, resume=True)
    assert _bytes(kept) == before


def test_beats_do_not_depend_on_workers(kept: Path, tmp_path: Path) -> None:
    write_dataset(tmp_path, KEEPING, workers=2)
    assert _bytes(tmp_path) == _bytes(kept)
