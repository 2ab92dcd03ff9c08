"""Pairs: motions as in gt/radar_odometry.csv, augmentation, draws that depend on nothing else."""

import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from torch.utils.data import DataLoader

from echoscape.learn import ScanFolder, ScanPairs
from echoscape.learn.data.augmentation import (
    AugmentationConfig,
    PairAugmentation,
    augmented_motion,
    draw_augmentation,
)
from echoscape.learn.data.image_settings import ImageSettings
from echoscape.learn.data.pair_batch import Pair
from echoscape.learn.data.scan_pairs import TRAINING_STRIDES
from echoscape.learn.model.pixel_coords import pixels_of_metres
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.se2 import SE2
from tests.learn.folders import motion_between, world, write_folder
from tests.learn.items import assert_same_items
from tests.learn.simulated import write_simulated

IMAGE = ImageSettings(pixel_m=0.6912, size=160)
POSES = [(3.0 * i, 0.2 * i * i, 0.12 * i) for i in range(4)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_folder(tmp_path_factory.mktemp("data") / "drive", POSES)


@pytest.fixture(scope="module")
def pairs(folder: Path) -> ScanPairs:
    return ScanPairs(folder, **asdict(IMAGE), stride=TRAINING_STRIDES)


def _seen_from(pose: tuple[float, float, float]) -> np.ndarray:
    """The world's spots forward, right [m] of a pose."""
    x, y, yaw = pose
    away = world(1) - (x, y)
    return away @ np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])


def _brightness(image: torch.Tensor, points_m: np.ndarray) -> tuple[float, float]:
    """Mean of a image at those points that are 10 to 50 m away, and over all of it."""
    near = points_m[(np.hypot(*points_m.T) > 10) & (np.hypot(*points_m.T) < 50)]
    place = pixels_of_metres(torch.from_numpy(near), size=IMAGE.size, pixel_m=IMAGE.pixel_m).round().long()
    return float(image[0, place[:, 0], place[:, 1]].mean()), float(image.mean())


@pytest.mark.parametrize(
    "augmentation",
    [
        PairAugmentation(),
        PairAugmentation(source_rotation_rad=2.5, destination_rotation_rad=-1.0),
        PairAugmentation(source_rotation_rad=0.4, destination_rotation_rad=0.9, source_shift_m=(5.0, -8.0)),
    ],
)
@pytest.mark.parametrize(("source", "destination"), [(3, 0), (0, 3), (1, 2)])
def test_the_motion_maps_points_of_the_source_to_those_of_the_destination(
    pairs: ScanPairs, source: int, destination: int, augmentation: PairAugmentation
) -> None:
    batch = pairs.batch([Pair(drive=0, source=source, destination=destination, augmentation=augmentation)])
    cosine, sine = math.cos(augmentation.source_rotation_rad), math.sin(augmentation.source_rotation_rad)
    seen = (
        _seen_from(POSES[source]) @ np.array([[cosine, sine], [-sine, cosine]]) + augmentation.source_shift_m
    )
    bright, mean = _brightness(batch.source[0], seen)
    assert bright > 5 * mean
    moved = seen @ batch.motion.rotation[0].numpy().T + batch.motion.translation_m[0].numpy()
    bright, mean = _brightness(batch.destination[0], moved)
    assert bright > 5 * mean


def test_a_later_source_is_ahead_and_a_right_turn_is_positive(pairs: ScanPairs) -> None:
    motion = pairs.batch([Pair(drive=0, source=2, destination=1)]).motion
    x, y, yaw = motion_between(POSES[1], POSES[2])
    assert_allclose(motion.translation_m[0], [x, y], atol=1e-5)
    assert_allclose(motion.yaw_rad, [yaw], atol=1e-5)
    assert x > 2
    assert yaw > 0


@given(
    st.floats(-3, 3),
    st.tuples(st.floats(-9, 9), st.floats(-9, 9)),
    st.floats(-7, 7),
    st.floats(-7, 7),
    st.tuples(st.floats(-9, 9), st.floats(-9, 9)),
)
@settings(deadline=None)
def test_rotating_and_shifting_images_changes_the_motion_exactly(
    yaw: float,
    shift: tuple[float, float],
    source: float,
    destination: float,
    source_shift: tuple[float, float],
) -> None:
    x, y = shift
    found = augmented_motion(
        SE2(x_m=x, y_m=y, yaw_rad=yaw),
        PairAugmentation(
            source_rotation_rad=source, destination_rotation_rad=destination, source_shift_m=source_shift
        ),
    )
    point = complex(4.0, -2.0)  # forward + i right: clockwise rotations are products with exp(i angle)
    seen_before = point * np.exp(1j * yaw) + complex(x, y)
    rendered = point * np.exp(1j * source) + complex(*source_shift)
    seen = rendered * np.exp(1j * found.yaw_rad) + complex(found.x_m, found.y_m)
    assert abs(seen - seen_before * np.exp(1j * destination)) < 1e-9
    assert abs(found.yaw_rad) <= math.pi


def test_relative_rotations_grow_from_none_to_any() -> None:
    augmentation = AugmentationConfig(shared_rotation=False, ramp_start_step=10, ramp_end_step=20)
    rng = np.random.default_rng(1)
    widest = [
        max(abs(draw_augmentation(augmentation, step, rng=rng).source_rotation_rad) for _ in range(400))
        for step in (10, 15, 30)
    ]
    assert widest[0] == 0
    assert_allclose(widest[1:], [math.pi / 2, math.pi], rtol=0.02)
    assert draw_augmentation(augmentation, 30, rng=rng).destination_rotation_rad == 0


def test_shifts_are_uniform_up_to_the_largest() -> None:
    augmentation, rng = AugmentationConfig(shared_rotation=False, max_shift_m=6.0), np.random.default_rng(1)
    drawn = np.array([draw_augmentation(augmentation, 0, rng=rng).source_shift_m for _ in range(4000)])
    assert_allclose(np.abs(drawn).max(axis=0), [6, 6], rtol=0.01)
    assert_allclose(drawn.std(axis=0), [6 / math.sqrt(3)] * 2, rtol=0.05)
    assert abs(np.corrcoef(drawn.T)[0, 1]) < 0.05
    assert draw_augmentation(AugmentationConfig(), 0, rng=rng).source_shift_m == (0.0, 0.0)
    with pytest.raises(ValueError, match="max_shift_m must"):
        AugmentationConfig(max_shift_m=-1.0)


def test_distortions_are_those_of_each_scan_at_its_pose_in_the_image(pairs: ScanPairs) -> None:
    augmentation = PairAugmentation(
        source_rotation_rad=0.4, destination_rotation_rad=0.9, source_shift_m=(5.0, -8.0)
    )
    truth = pairs.batch([Pair(drive=0, source=3, destination=1, augmentation=augmentation)]).truth
    motion = pairs.drives[0].motion
    assert motion is not None
    velocities = motion.velocities
    assert truth.source is not None
    assert truth.destination is not None
    assert_allclose(truth.source.twist.velocity_mps[0], velocities[3, :2], rtol=1e-6)
    assert_allclose(truth.destination.twist.yaw_rate_rps, velocities[1, 2:], rtol=1e-6)
    assert_allclose(truth.source.scan_in_image.translation_m[0], [5.0, -8.0])
    assert_allclose(
        [float(truth.source.scan_in_image.yaw_rad), float(truth.destination.scan_in_image.yaw_rad)],
        [0.4, 0.9],
    )
    assert_allclose(truth.destination.scan_in_image.translation_m[0], [0.0, 0.0])


def test_draws_depend_on_the_generator_alone_and_have_both_orders_and_all_gaps(pairs: ScanPairs) -> None:
    def drawn(seed: int) -> list[Pair]:
        rng = np.random.default_rng(seed)
        return [pairs.draw(AugmentationConfig(), 5, rng=rng) for _ in range(60)]

    assert drawn(1) == drawn(1)
    assert drawn(1) != drawn(2)
    assert {pair.source - pair.destination for pair in drawn(1)} == {-3, -2, -1, 1, 2, 3}


@pytest.mark.parametrize(
    ("power", "expected"), [(0.0, [1 / 3, 1 / 3, 1 / 3]), (1.0, [6 / 11, 3 / 11, 2 / 11])]
)
def test_gaps_are_drawn_in_proportion_to_their_power(
    pairs: ScanPairs, power: float, expected: list[float]
) -> None:
    rng = np.random.default_rng(3)
    drawn = [pairs.draw(AugmentationConfig(), 5, rng=rng, gap_power=power) for _ in range(3000)]
    gaps = np.abs([pair.source - pair.destination for pair in drawn])
    assert_allclose([np.mean(gaps == gap) for gap in (1, 2, 3)], expected, atol=0.04)


def test_a_cache_is_made_once_and_not_taken_for_another_resolution(folder: Path, tmp_path: Path) -> None:
    one = ScanPairs([folder], **asdict(IMAGE), cache=tmp_path)
    files = sorted(tmp_path.iterdir())
    before = files[0].stat().st_mtime_ns
    again = ScanPairs([folder], **asdict(IMAGE), cache=tmp_path)
    assert sorted(tmp_path.iterdir()) == files
    assert files[0].stat().st_mtime_ns == before
    assert torch.equal(one.drives[0].image(2), again.drives[0].image(2))
    ScanPairs([folder], pixel_m=0.3456, size=160, cache=tmp_path)
    assert len(list(tmp_path.iterdir())) == 2


def test_folders_without_poses_are_refused(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "bare", POSES[:2])
    (folder / "gt" / "radar_odometry.csv").unlink()
    with pytest.raises(DatasetError, match="bare: has no poses"):
        ScanPairs([folder])
    with pytest.raises(DatasetError, match="data must name"):
        ScanPairs([])


def test_a_batch_is_moved_to_a_device_with_all_its_fields(pairs: ScanPairs) -> None:
    """The device `meta` exists everywhere."""
    batch = pairs.batch([Pair(drive=0, source=1, destination=0)])
    there = batch.to(torch.device("meta"))
    assert there.truth.source is not None
    assert there.truth.destination is not None
    for tensor in (
        *(there.source, there.destination, there.motion.rotation, there.motion.translation_m),
        *(there.truth.source.scan_s, there.truth.source.twist.velocity_mps),
        *(there.truth.destination.scan_in_image.rotation, there.truth.destination.doppler_beta_s),
    ):
        assert tensor.device.type == "meta"
    here = batch.to(torch.device("cpu"))
    assert here.source is batch.source


def test_a_pair_is_two_scans_and_the_motion_between_them(pairs: ScanPairs, folder: Path) -> None:
    single = ScanPairs(folder, **asdict(IMAGE))
    scans = ScanFolder(folder, **asdict(IMAGE))
    assert len(single) == len(POSES) - 1
    for number, item in enumerate(single):  # pyright: ignore[reportArgumentType]
        assert_same_items(item["source"], scans[number + 1])
        assert_same_items(item["destination"], scans[number])
        assert_allclose(item["motion"], motion_between(POSES[number], POSES[number + 1]), atol=1e-5)
        assert int(item["drive"]) == 0


def test_training_sees_the_images_and_motions_of_the_items(pairs: ScanPairs) -> None:
    batch = pairs.batch(pairs.pairs)
    items = next(iter(DataLoader(pairs, batch_size=len(pairs))))
    assert torch.equal(batch.source, items["source"]["image"])
    assert torch.equal(batch.destination, items["destination"]["image"])
    assert torch.equal(batch.motion.translation_m, items["motion"][:, :2])
    assert_allclose(batch.motion.yaw_rad, items["motion"][:, 2], atol=1e-6)
    assert batch.truth.source is not None
    assert torch.equal(batch.truth.source.twist.velocity_mps, items["source"]["twist"][:, :2])


@pytest.mark.parametrize(
    ("stride", "expected"),
    [
        (1, [(0, 1), (1, 2), (2, 3)]),
        (3, [(0, 3)]),
        ([2, 1], [(0, 1), (1, 2), (2, 3), (0, 2), (1, 3)]),
        (range(2, 9), [(0, 2), (1, 3), (0, 3)]),
    ],
)
def test_pairs_are_a_stride_apart(
    folder: Path, stride: int | list[int] | range, expected: list[tuple[int, int]]
) -> None:
    found = ScanPairs(folder, **asdict(IMAGE), stride=stride, codes=False)
    numbers = [(int(item["destination"]["index"]), int(item["source"]["index"])) for item in found]  # pyright: ignore
    assert numbers == expected
    assert len(found) == len(expected)


def test_pairs_of_several_folders_follow_each_other_and_count_from_either_end(
    folder: Path, tmp_path: Path
) -> None:
    other = write_folder(tmp_path / "other", POSES[:3], seed=2)
    both = ScanPairs([folder, str(other)], pixel_m=2.0, size=32)
    assert both.names == ["drive", "other"]
    assert [int(item["drive"]) for item in both] == [0, 0, 0, 1, 1]  # pyright: ignore[reportGeneralTypeIssues]
    assert_same_items(both[-1]["source"], ScanFolder(other, pixel_m=2.0, size=32)[2])
    for index in (5, -6):
        with pytest.raises(IndexError, match=f"index must be between -5 and 4, got {index}"):
            both[index]
    with pytest.raises(TypeError, match="Subset"):
        both[1:]  # pyright: ignore[reportArgumentType]


def test_scans_without_a_pose_are_in_no_pair(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "gap", [(2.0 * i, 0.0, 0.0) for i in range(5)])
    path = folder / "gt" / "radar_odometry.csv"
    lines = path.read_text().splitlines()
    path.write_text("\n".join(lines[:-1]) + "\n")  # the last scan has no pose any more
    assert len(ScanPairs(folder, pixel_m=2.0, size=32)) == 3
    assert len(ScanPairs(folder, pixel_m=2.0, size=32, stride=[1, 2])) == 3 + 2


def test_labels_are_there_where_all_folders_have_truth(folder: Path, tmp_path: Path) -> None:
    simulated = write_simulated(tmp_path / "yard", scans=2)
    item = ScanPairs(simulated, pixel_m=2.0, size=32)[0]
    assert item["source"]["labels"]["component"].shape == item["source"]["codes"].shape == (100, 512)
    assert "labels" not in ScanPairs(simulated, pixel_m=2.0, size=32, labels=False)[0]["source"]
    assert "labels" not in ScanPairs([simulated, folder], pixel_m=2.0, size=32, codes=False)[0]["source"]
    with pytest.raises(DatasetError, match="drive: has no truth"):
        ScanPairs([simulated, folder], labels=True)
    with pytest.raises(
        DatasetError, match=r"drive: its scans have 400 x 3768 cells, those of .*yard 100 x 512"
    ):
        ScanPairs([simulated, folder])


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
@pytest.mark.parametrize("context", ["fork", pytest.param("spawn", marks=pytest.mark.slow)])
def test_shuffled_batches_of_workers_are_those_of_one_process(folder: Path, context: str) -> None:
    pairs = ScanPairs(folder, pixel_m=2.0, size=32, stride=[1, 2])

    def shuffled(workers: int, context: str | None) -> list[dict[str, Any]]:
        generator = torch.Generator().manual_seed(1)
        return list(
            DataLoader(
                pairs,
                batch_size=2,
                shuffle=True,
                generator=generator,
                num_workers=workers,
                multiprocessing_context=context,
            )
        )

    for found, expected in zip(shuffled(2, context), shuffled(0, None), strict=True):
        assert_same_items(found, expected)


def test_folders_without_pairs_are_refused_by_name(folder: Path, tmp_path: Path) -> None:
    alone = write_folder(tmp_path / "alone", POSES[:1])
    with pytest.raises(DatasetError, match=r"alone: no two of its scans \(1\) have poses and are 1 apart"):
        ScanPairs(alone)
    with pytest.raises(DatasetError, match=r"drive: no two of its scans \(4\) .* are 4 to 8 apart"):
        ScanPairs(folder, stride=range(4, 9))
    for stride in (0, [], [1, -1]):
        with pytest.raises(ValueError, match="stride must be 1 or more"):
            ScanPairs(folder, stride=stride)
    bad: tuple[Any, ...] = (1.5, True, "3", None, [1, 2.5])
    for stride in bad:
        with pytest.raises(ValueError, match="stride must be a whole number, got"):
            ScanPairs(folder, stride=stride)
    with pytest.raises(DatasetError, match="nowhere: no such folder"):
        ScanPairs(tmp_path / "nowhere")
