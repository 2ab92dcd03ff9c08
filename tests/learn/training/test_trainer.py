"""Training: the same result whether stopped or not, what it leaves behind, what it refuses."""

import json
import sys
import types
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import Tensor

from echoscape.cli.train import main
from echoscape.learn.data.augmentation import AugmentationConfig
from echoscape.learn.data.image_settings import ImageSettings
from echoscape.learn.data.scan_pairs import TRAINING_STRIDES, ScanPairs
from echoscape.learn.geometry.procrustes import Motion
from echoscape.learn.model.fast_keypoint_model import Matching
from echoscape.learn.model.model_settings import ModelSettings
from echoscape.learn.model.weights import load_weights
from echoscape.learn.training.checkpoint import initial_model
from echoscape.learn.training.config import TrainingConfig
from echoscape.learn.training.logger import TrainingLog
from echoscape.learn.training.trainer import TrainingData, recorded_threads, train
from echoscape.learn.training.validation import fixed_pairs, pair_errors
from echoscape.sim.datasets.files.atomic_write import DatasetError
from tests.learn.folders import write_folder

MODEL = ModelSettings(image=ImageSettings(pixel_m=1.3824, size=80))
SHORT = TrainingConfig(steps=5, validate_every=2, validate_pairs=2, log_every=2, save_every=3)
POSES = [(1.5 * i, 0.0, 0.05 * i) for i in range(6)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_folder(tmp_path_factory.mktemp("data") / "drive", POSES)


def training_pairs(folder: Path, image: ImageSettings) -> ScanPairs:
    """Return the pairs of a folder as `echoscape train` draws them."""
    return ScanPairs(folder, **asdict(image), stride=TRAINING_STRIDES, codes=False, cache=True)


@pytest.fixture(scope="module")
def data(folder: Path) -> TrainingData:
    pairs = training_pairs(folder, MODEL.image)
    return TrainingData(training=pairs, validation=pairs)


def test_a_resumed_run_gives_the_same_bytes(data: TrainingData, tmp_path: Path) -> None:
    def stop(line: dict[str, Any]) -> None:
        if line["step"] == 4:
            raise KeyboardInterrupt

    train(tmp_path / "whole", MODEL, SHORT, data)
    with pytest.raises(KeyboardInterrupt):
        train(tmp_path / "stopped", MODEL, SHORT, data, callback=stop)
    train(tmp_path / "stopped", MODEL, SHORT, data, resume=True)
    for name in ("last.safetensors", "best.safetensors", "log.jsonl", "settings.json"):
        assert (tmp_path / "stopped" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
    assert {path.name for path in (tmp_path / "whole").iterdir()} == {
        *("settings.json", "log.jsonl", "checkpoint.pt"),
        *("last.safetensors", "best.safetensors", "loss.png"),
    }
    lines = [json.loads(line) for line in (tmp_path / "whole" / "log.jsonl").read_text().splitlines()]
    assert [line["step"] for line in lines] == [2, 2, 4, 4]


def test_weights_carry_their_settings_and_their_training(data: TrainingData, tmp_path: Path) -> None:
    model = train(tmp_path / "run", MODEL, SHORT, data)
    read, record = load_weights(tmp_path / "run" / "last.safetensors")
    assert read.settings == MODEL
    assert record["step"] == 5
    assert record["learning_rate"] == 1e-3
    for name, value in model.state_dict().items():
        assert torch.equal(value, read.state_dict()[name])


def test_damaged_weights_are_refused_by_name(tmp_path: Path) -> None:
    (tmp_path / "bad.safetensors").write_bytes(b"no weights at all")
    with pytest.raises(DatasetError, match=r"bad\.safetensors: cannot be read as a model"):
        load_weights(tmp_path / "bad.safetensors")
    with pytest.raises(DatasetError, match=r"absent\.safetensors"):
        load_weights(tmp_path / "absent.safetensors")


def test_a_folder_in_use_or_other_settings_are_refused(data: TrainingData, tmp_path: Path) -> None:
    train(tmp_path / "run", MODEL, TrainingConfig(steps=1), data)
    with pytest.raises(DatasetError, match="OUT must be empty or new"):
        train(tmp_path / "run", MODEL, TrainingConfig(steps=1), data)
    with pytest.raises(DatasetError, match="other settings"):
        train(tmp_path / "run", MODEL, TrainingConfig(steps=2, seed=1), data, resume=True)
    with pytest.raises(DatasetError, match="cannot be read"):
        train(tmp_path / "empty", MODEL, SHORT, data, resume=True)


def test_training_ends_when_patience_does(data: TrainingData, tmp_path: Path) -> None:
    settings = TrainingConfig(
        steps=40, validate_every=1, validate_pairs=1, patience=2, learning_rate=1e-30, log_every=50
    )
    train(tmp_path / "run", MODEL, settings, data)
    lines = (tmp_path / "run" / "log.jsonl").read_text().splitlines()
    assert len(lines) < 40


def test_training_starts_from_weights_of_another_resolution(
    data: TrainingData, folder: Path, tmp_path: Path
) -> None:
    first = train(tmp_path / "coarse", MODEL, SHORT, data)
    fine = ModelSettings(image=ImageSettings(pixel_m=0.6912, size=160))
    still = TrainingConfig(steps=1, learning_rate=1e-30)
    start = tmp_path / "coarse" / "last.safetensors"
    second = train(
        tmp_path / "fine",
        fine,
        still,
        TrainingData(training=training_pairs(folder, fine.image)),
        init_weights=start,
    )
    for before, after in zip(first.parameters(), second.parameters(), strict=True):
        assert torch.equal(before, after)
    _, record = load_weights(tmp_path / "fine" / "last.safetensors")
    assert (record["init_weights"]["step"], record["init_weights"]["image"]["pixel_m"]) == (5, 1.3824)
    assert record["data"] == ["drive"]
    headless = ModelSettings(image=fine.image, score_head=False)
    with pytest.raises(DatasetError, match=r"last\.safetensors: has other heads"):
        train(
            tmp_path / "other",
            headless,
            still,
            TrainingData(training=training_pairs(folder, fine.image)),
            init_weights=start,
        )


def test_images_of_another_size_than_the_models_are_refused(
    data: TrainingData, folder: Path, tmp_path: Path
) -> None:
    other = ScanPairs(folder, pixel_m=1.3824, size=96)
    for each in (replace(data, training=other), replace(data, validation=other)):
        with pytest.raises(ValueError, match=r"data must have .*size=80.* got .*size=96"):
            train(tmp_path / "out", MODEL, SHORT, each)
    assert not (tmp_path / "out").exists()


def test_the_learning_rate_is_held_and_then_halved() -> None:
    settings = TrainingConfig(learning_rate=4e-3, lr_hold_steps=100, lr_half_life=50)
    assert [settings.learning_rate_at(step) for step in (0, 100, 150, 200)] == [4e-3, 4e-3, 2e-3, 1e-3]
    assert TrainingConfig().learning_rate_at(10**6) == 1e-3


def test_entries_go_to_tensorboard_where_it_is_installed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    added: list[tuple[str, float, int]] = []

    class Writer:
        def __init__(self, folder: str, *, purge_step: int) -> None:
            assert (Path(folder).name, purge_step) == ("tensorboard", 8)

        def add_scalar(self, name: str, value: float, step: int) -> None:
            added.append((name, value, step))

        def close(self) -> None:
            added.append(("closed", 0.0, 0))

    module = types.ModuleType("torch.utils.tensorboard")
    module.SummaryWriter = Writer  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "torch.utils.tensorboard", module)
    log = TrainingLog(tmp_path)
    log.begin(7)
    log.add({"step": 8, "loss_m": 2.0, "validation": {"mean_m": 3.0}})
    log.end()
    assert added == [("training/loss_m", 2.0, 8), ("validation/mean_m", 3.0, 8), ("closed", 0.0, 0)]


def test_without_tensorboard_the_log_is_a_file_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "torch.utils.tensorboard", None)
    log = TrainingLog(tmp_path)
    log.begin(0)
    log.add({"step": 1, "loss_m": 2.0})
    log.end()
    assert [path.name for path in tmp_path.iterdir()] == ["log.jsonl"]
    assert json.loads((tmp_path / "log.jsonl").read_text()) == {"step": 1, "loss_m": 2.0}


@pytest.mark.parametrize(
    "name", ["match_weight", "likelihood_weight", "score_weight", "robust_pose", "compensate"]
)
def test_each_loss_changes_the_weights(data: TrainingData, tmp_path: Path, name: str) -> None:
    two = TrainingConfig(steps=2)
    plain = train(tmp_path / "plain", MODEL, two, data)
    changed = train(tmp_path / "changed", MODEL, TrainingConfig(steps=2, **{name: 1.0}), data)  # type: ignore[arg-type]
    assert any(not torch.equal(a, b) for a, b in zip(plain.parameters(), changed.parameters(), strict=True))


@pytest.mark.gpu
def test_a_run_on_a_gpu_is_resumed_there_and_on_the_cpu(data: TrainingData, tmp_path: Path) -> None:
    """The first step begins with the same weights and pairs, so that its loss differs by rounding only."""
    config = replace(SHORT, likelihood_weight=1.0, compensate=True, robust_pose=True)
    first: dict[str, float] = {}
    for device in ("cuda", "cpu"):
        out = tmp_path / device
        model = train(out, MODEL, replace(config, steps=2), data, device=device)  # type: ignore[arg-type]
        assert {each.device.type for each in model.parameters()} == {device}
        first[device] = json.loads((out / "log.jsonl").read_text().splitlines()[0])["loss_m"]
        assert json.loads((out / "settings.json").read_text())["device"] == device
    assert first["cuda"] == pytest.approx(first["cpu"], rel=0.05)
    train(tmp_path / "cpu", MODEL, config, data, resume=True, device="cuda")
    train(tmp_path / "cuda", MODEL, config, data, resume=True, device="cpu")
    for device in ("cuda", "cpu"):
        model, record = load_weights(tmp_path / device / "last.safetensors")
        assert record["step"] == config.steps
        assert all(bool(each.isfinite().all()) for each in model.parameters())


def test_first_weights_are_drawn_apart_from_the_global_generators() -> None:
    torch.manual_seed(5)
    before = torch.get_rng_state()
    one = initial_model(MODEL, seed=0)
    assert torch.equal(torch.get_rng_state(), before)
    torch.manual_seed(6)
    other = initial_model(MODEL, seed=0)
    assert all(torch.equal(a, b) for a, b in zip(one.parameters(), other.parameters(), strict=True))


def test_a_resumed_run_takes_the_threads_that_it_had(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("echoscape.cli.train.idle_cores", lambda: 1)
    few = ["--steps", "1", "--resolution", "1.3824", "--size", "80"]
    words = ["--data", str(folder), "--out", str(tmp_path / "run"), *few]
    try:
        assert main([*words, "--threads", "2"]) == 0
        assert torch.get_num_threads() == 2
        assert main([*words, "--steps", "2", "--resume", "--threads", "1"]) == 0
        assert main([*words, "--steps", "3", "--resume"]) == 0
        assert torch.get_num_threads() == 1
        assert main([*words[:3], str(tmp_path / "new"), *few]) == 0
        assert torch.get_num_threads() == 1
    finally:
        torch.set_num_threads(1)
    assert recorded_threads(tmp_path / "run") == 1
    assert recorded_threads(tmp_path / "none") is None


def test_validation_moves_points_to_mid_scan_as_training_does(data: TrainingData) -> None:
    chosen, model = fixed_pairs(data.training, 4, seed=1), initial_model(MODEL, seed=0)
    found = [
        pair_errors(model, data.training, chosen, Matching(), torch.float32, compensate=each).mean_m
        for each in (False, True)
    ]
    assert found[0] != found[1]


def test_a_run_of_a_version_with_fewer_settings_is_resumed(data: TrainingData, tmp_path: Path) -> None:
    train(tmp_path / "run", MODEL, replace(SHORT, steps=2), data)
    held = torch.load(tmp_path / "run" / "checkpoint.pt", weights_only=True)
    del held["settings"]["training"]["compensate"]
    torch.save(held, tmp_path / "run" / "checkpoint.pt")
    train(tmp_path / "run", MODEL, SHORT, data, resume=True)
    assert load_weights(tmp_path / "run" / "last.safetensors")[1]["step"] == 5


def test_gradients_are_clipped_and_the_rate_falls(data: TrainingData, tmp_path: Path) -> None:
    """Adam's first step is the rate in every weight that has a slope, unless that is tiny."""
    begun = initial_model(MODEL, seed=0)

    def moved(name: str, **settings: Any) -> float:
        trained = train(tmp_path / name, MODEL, TrainingConfig(steps=1, **settings), data)
        pairs = zip(trained.parameters(), begun.parameters(), strict=True)
        return max(float((one - other).detach().abs().max()) for one, other in pairs)

    assert moved("plain") == pytest.approx(1e-3, rel=0.01)
    assert moved("fallen", learning_rate=1e-2, lr_hold_steps=0, lr_half_life=1) == pytest.approx(
        1e-2, rel=0.01
    )
    # Shortened to 1e-9, slopes are below Adam's epsilon of 1e-8, and steps are shorter than the rate.
    assert moved("clipped", clip=1e-9) < 2e-4
    two = TrainingConfig(steps=2, learning_rate=1e-2, lr_half_life=1)
    slow = train(tmp_path / "two", MODEL, two, data)
    first = train(tmp_path / "one", MODEL, TrainingConfig(steps=1, learning_rate=1e-2, lr_half_life=1), data)
    last = [(a - b).detach().abs().max() for a, b in zip(slow.parameters(), first.parameters(), strict=True)]
    assert float(max(last)) < 0.6e-2  # half the rate, and never more than Adam's bound for a second step


def test_gradients_that_are_not_finite_end_the_run(
    data: TrainingData, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(estimate: Motion, truth: Motion, *, alpha_m: float) -> Tensor:
        return (estimate.translation_m.sum(-1) * 0).sqrt()  # 0, with a slope of infinity times 0

    monkeypatch.setattr("echoscape.learn.training.trainer.pose_loss", broken)
    with pytest.raises(ValueError, match="gradients must be finite, got nan at step 0"):
        train(tmp_path / "run", MODEL, SHORT, data)


def test_validation_draws_gaps_by_their_power(folder: Path) -> None:
    pairs = training_pairs(folder, MODEL.image)
    near = [abs(pair.source - pair.destination) for pair in fixed_pairs(pairs, 40, seed=1, gap_power=9.0)]
    assert near.count(1) >= 38
    far = [abs(pair.source - pair.destination) for pair in fixed_pairs(pairs, 40, seed=1)]
    assert set(far) == {1, 2, 3, 4, 5}


def test_the_command_passes_the_model_its_settings(folder: Path, tmp_path: Path) -> None:
    options = [
        "--no-location-head",
        "--no-score-head",
        "--temperature",
        "55",
        "--near-m",
        "4",
        "--size",
        "80",
    ]
    few = ["--steps", "1", "--resolution", "1.3824"]
    assert main(["--data", str(folder), "--out", str(tmp_path / "run"), *options, *few]) == 0
    settings = load_weights(tmp_path / "run" / "last.safetensors")[0].settings
    image = ImageSettings(pixel_m=1.3824, size=80, near_m=4.0)
    assert settings == ModelSettings(image=image, temperature=55.0, location_head=False, score_head=False)


def test_folders_of_the_training_data_cannot_validate(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    both = ["--data", str(folder), "--validate", str(folder)]
    assert main([*both, "--out", str(tmp_path / "run"), "--resolution", "1.3824", "--size", "80"]) == 2
    assert "other folders than data" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("cut", ["", '{"step": 4, "lo'])
def test_a_log_whose_last_line_was_cut_short_is_continued(tmp_path: Path, cut: str) -> None:
    (tmp_path / "log.jsonl").write_text('{"step": 2, "loss_m": 1.0}\n' + cut)
    log = TrainingLog(tmp_path)
    log.begin(9)
    log.end()
    assert (tmp_path / "log.jsonl").read_text() == '{"step": 2, "loss_m": 1.0}\n'
    (tmp_path / "log.jsonl").write_text("nothing\n")
    with pytest.raises(DatasetError, match=r"log\.jsonl"):
        log.begin(9)


@pytest.mark.slow
def test_a_few_hundred_steps_bring_the_error_down_by_half(tmp_path: Path) -> None:
    poses = [(2.0 * i, 0.03 * i * i, 0.03 * i) for i in range(16)]
    folder = write_folder(tmp_path / "drive", poses)
    pairs = training_pairs(folder, ImageSettings(pixel_m=1.3824, size=160))
    settings = TrainingConfig(
        steps=300, validate_every=299, augmentation=AugmentationConfig(max_rotation_rad=0.0), log_every=50
    )
    train(
        tmp_path / "run",
        ModelSettings(image=ImageSettings(pixel_m=1.3824, size=160)),
        settings,
        TrainingData(training=pairs),
    )
    lines = [json.loads(line) for line in (tmp_path / "run" / "log.jsonl").read_text().splitlines()]
    assert lines[-1]["median_m"] < 0.5 * lines[0]["median_m"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--size", "101"], "size must be even"),
        (["--steps", "0"], "steps must be 1 or more"),
        (["--threads", "0"], "threads must be 1 or more"),
        (["--augmentation.max-rotation-rad", "9"], "--augmentation.max-rotation-rad must be"),
    ],
)
def test_bad_arguments_are_refused_in_one_line(
    arguments: list[str], message: str, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["--data", str(folder), "--out", str(tmp_path / "run"), *arguments]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert len(error.strip().splitlines()) == 1
    assert not (tmp_path / "run").exists()


def test_the_command_trains(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "run"
    words = [
        "--data",
        str(folder),
        "--out",
        str(out),
        "--size",
        "80",
        "--resolution",
        "1.3824",
        "--steps",
        "2",
    ]
    assert main([*words, "--cache", str(tmp_path / "cache")]) == 0
    assert (out / "last.safetensors").exists()
    assert main(words) == 2
    assert "must be empty or new" in capsys.readouterr().err
