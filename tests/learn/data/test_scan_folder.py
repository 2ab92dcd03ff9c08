"""Scans as items: what the files of a folder hold, at any index, in batches, and by several workers."""

import pickle
import shutil
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose, assert_array_equal
from PIL import Image
from torch import Tensor
from torch.utils.data import DataLoader, Dataset, Subset

from echoscape.learn import ScanFolder
from echoscape.learn.data.image import CODE_OF_ONE
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.scan_folder import open_folder
from tests.learn.folders import write_folder
from tests.learn.items import assert_same_items, stacked
from tests.learn.simulated import write_simulated

SIZE, PIXEL_M = 64, 1.0
POSES = [(3.0 * i, 0.1 * i * i, 0.05 * i) for i in range(4)]
LABELS = ["bounces", "class_id", "component", "displaced", "instance", "moving"]


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_simulated(tmp_path_factory.mktemp("simulated") / "yard")


@pytest.fixture(scope="module")
def real(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with poses and without truth."""
    return write_folder(tmp_path_factory.mktemp("real") / "drive", POSES)


@pytest.fixture(scope="module")
def scans(simulated: Path) -> ScanFolder:
    return ScanFolder(simulated, pixel_m=PIXEL_M, size=SIZE)


def test_an_item_holds_what_the_files_hold(scans: ScanFolder, simulated: Path) -> None:
    paths = sorted((simulated / "radar").glob("*.png"))
    assert len(scans) == len(paths) == 4
    for number, path in enumerate(paths):
        item, pixels = scans[number], np.asarray(Image.open(path))
        assert_array_equal(item["codes"], pixels[:, 11:])
        assert_array_equal(item["azimuth_us"], pixels[:, :8].copy().view(np.int64)[:, 0])
        assert int(item["time_us"]) == int(path.stem)
        assert int(item["index"]) == number
        with np.load(simulated / "truth" / f"{path.stem}.npz") as truth:
            assert sorted(item["labels"]) == LABELS
            for name in LABELS:
                assert_array_equal(item["labels"][name], truth[name])
    assert len(np.unique(scans[0]["labels"]["component"])) > 3


def test_the_image_shows_codes_at_their_places(scans: ScanFolder) -> None:
    """Pixels 1 m wide against means of the codes within half a metre of range, one azimuth."""
    item = scans[1]
    folder = scans.scans
    codes, bin_m = item["codes"].numpy().astype(float), folder.sensor.bin_m
    rows, columns = np.mgrid[4:60:7, 5:60:7]
    forward, right = (31.5 - rows) * PIXEL_M, (columns - 31.5) * PIXEL_M
    range_m, azimuth_rad = np.hypot(forward, right), np.arctan2(right, forward)
    step_rad = 2 * np.pi / len(codes)
    beam = np.rint((azimuth_rad - folder.sensor.first_azimuth_rad) / step_rad).astype(int) % len(codes)
    bins = np.rint(range_m / bin_m - 0.5).astype(int)
    expected = codes[beam, bins] / CODE_OF_ONE
    found = item["image"][0].numpy()[rows, columns]
    assert np.corrcoef(found.ravel(), expected.ravel())[0, 1] > 0.8
    turned = np.corrcoef(np.rot90(found).ravel(), expected.ravel())[0, 1]
    assert turned < 0.6


def test_poses_and_velocities_are_those_of_the_truth(scans: ScanFolder, simulated: Path) -> None:
    poses, times_s = [], []
    for path in sorted((simulated / "truth").glob("*.npz")):
        with np.load(path) as truth:
            poses.append(truth["middle_pose"])
            times_s.append(int(truth["middle_us"]) / 1e6)
    found = [scans[number]["pose"].numpy() for number in range(4)]
    for (a, b), (c, d) in zip(pairwise(poses), pairwise(found), strict=True):
        assert_allclose(np.linalg.norm(b[:2] - a[:2]), np.linalg.norm(d[:2] - c[:2]), atol=1e-3)
    speed_mps = np.linalg.norm(poses[2][:2] - poses[0][:2]) / (times_s[2] - times_s[0])
    assert_allclose(scans[1]["twist"][0], speed_mps, rtol=0.02)


def test_indexes_count_from_either_end_and_iteration_ends(scans: ScanFolder) -> None:
    assert_same_items(scans[-1], scans[3])
    assert_same_items(scans[-4], scans[0])
    assert_same_items(scans[np.int64(2)], scans[torch.tensor(2)])
    for index in (4, -5, 100):
        with pytest.raises(IndexError, match=f"index must be between -4 and 3, got {index}"):
            scans[index]
    numbers = [int(item["index"]) for item in scans]  # pyright: ignore[reportGeneralTypeIssues]
    assert numbers == [0, 1, 2, 3]
    with pytest.raises(TypeError, match=r"index must be an integer.*Subset"):
        scans[0:2]  # pyright: ignore[reportArgumentType]
    with pytest.raises(TypeError):
        scans["first"]  # pyright: ignore[reportArgumentType]


def test_what_is_not_asked_for_is_left_out(simulated: Path, real: Path) -> None:
    bare = ScanFolder(simulated, pixel_m=PIXEL_M, size=SIZE, codes=False, labels=False)
    assert sorted(bare[0]) == ["image", "index", "pose", "time_us", "twist"]
    without_truth = ScanFolder(real, pixel_m=PIXEL_M, size=SIZE)
    assert not without_truth.has_labels
    assert sorted(without_truth[0]) == [
        *("azimuth_us", "codes", "image", "index", "pose", "time_us", "twist")
    ]


def test_a_folder_without_poses_has_neither_pose_nor_twist(real: Path, tmp_path: Path) -> None:
    shutil.copytree(real / "radar", tmp_path / "radar")
    scans = ScanFolder(tmp_path, pixel_m=PIXEL_M, size=SIZE)
    assert sorted(scans[0]) == ["azimuth_us", "codes", "image", "index", "time_us"]
    assert scans.poses is None
    assert scans.motion is None


def test_a_cache_changes_no_item_and_is_mapped_by_every_worker(simulated: Path, tmp_path: Path) -> None:
    """A copy for another process maps the file of the cache instead of holding its content."""
    plain = ScanFolder(simulated, pixel_m=PIXEL_M, size=SIZE)
    cached = ScanFolder(simulated, pixel_m=PIXEL_M, size=SIZE, cache=tmp_path / "cache")
    assert len(list((tmp_path / "cache").iterdir())) == 1
    assert not (simulated / "cache").exists()
    content = pickle.dumps(cached)
    cells = 4 * 100 * plain.settings.cells
    assert len(content) - len(pickle.dumps(plain)) < cells / 4
    for number in range(4):
        assert_same_items(cached[number], plain[number])
        assert_same_items(pickle.loads(content)[number], plain[number])
    assert ScanFolder(simulated, pixel_m=PIXEL_M, size=SIZE, cache=True)[0].keys() == plain[0].keys()
    assert (simulated / "cache").is_dir()
    shutil.rmtree(simulated / "cache")


def batches(scans: Dataset[Any], workers: int = 0, context: str | None = None) -> list[Any]:
    loader = DataLoader(scans, batch_size=3, num_workers=workers, multiprocessing_context=context)
    return list(loader)


def test_the_default_collate_stacks_items(scans: ScanFolder) -> None:
    first, second = batches(scans)
    assert_same_items(first, stacked([scans[number] for number in range(3)]))
    assert_same_items(second, stacked([scans[3]]))
    assert first["labels"]["instance"].shape == (3, 100, 512)


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
@pytest.mark.parametrize("context", ["fork", pytest.param("spawn", marks=pytest.mark.slow)])
def test_workers_give_the_same_batches(simulated: Path, tmp_path: Path, context: str) -> None:
    scans = ScanFolder(simulated, pixel_m=PIXEL_M, size=SIZE, cache=tmp_path)
    for found, expected in zip(batches(scans, 2, context), batches(scans), strict=True):
        assert_same_items(found, expected)


def test_an_opened_folder_and_a_subset_are_taken(simulated: Path, scans: ScanFolder) -> None:
    opened = ScanFolder(open_folder(simulated), pixel_m=PIXEL_M, size=SIZE)
    assert_same_items(opened[2], scans[2])
    (only,) = batches(Subset(scans, [2]))
    assert isinstance(only["image"], Tensor)
    assert_same_items(only, stacked([scans[2]]))


def test_bad_input_is_refused_by_name(simulated: Path, real: Path, tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"nowhere: no such folder"):
        ScanFolder(tmp_path / "nowhere")
    with pytest.raises(DatasetError, match=r"no scans"):
        ScanFolder(tmp_path)
    with pytest.raises(DatasetError, match=r"drive: has no truth"):
        ScanFolder(real, labels=True)
    with pytest.raises(ValueError, match="pixel_m must be finite and above 0, got 0"):
        ScanFolder(real, pixel_m=0.0)
    with pytest.raises(ValueError, match="size must be even and 16 or more, got 33"):
        ScanFolder(real, size=33)
    damaged = tmp_path / "damaged"
    shutil.copytree(simulated, damaged)
    lost = sorted((damaged / "truth").glob("*.npz"))[1]
    lost.unlink()
    scans = ScanFolder(damaged, pixel_m=PIXEL_M, size=SIZE)
    assert "labels" in scans[0]
    with pytest.raises(DatasetError, match=lost.name):
        scans[1]
