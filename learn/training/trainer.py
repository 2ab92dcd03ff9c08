"""The training loop: pairs in, a model out, in a folder from which a run can be resumed.

Source: Barnes & Posner 2020, section IV (Adam, 1e-3, alpha = 10); gradients are clipped at a norm of 10. With
torchrun, every process draws its own pairs and gradients are averaged.

    RUN/settings.json   log.jsonl   checkpoint.pt   best.safetensors   last.safetensors   loss.png
"""

import json
import math
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, distributed
from torch.nn.parallel import DistributedDataParallel
from torch.nn.utils import clip_grad_norm_

from echoscape.learn.data.ground_truth import GroundTruth
from echoscape.learn.data.scan_pairs import ScanPairs
from echoscape.learn.geometry.matches import Matches
from echoscape.learn.geometry.procrustes import ROBUST_SCALE_PX, Motion
from echoscape.learn.model.device import Device, resolve_device
from echoscape.learn.model.fast_keypoint_model import FastKeypointModel, Matching
from echoscape.learn.model.keypoint_model import pose_loss
from echoscape.learn.model.model_settings import ModelSettings
from echoscape.learn.model.weights import write_weights
from echoscape.learn.training.checkpoint import (
    FILE_NAME,
    Checkpoint,
    RunState,
    initial_model,
    load_initial_weights,
    read_checkpoint,
    write_checkpoint,
)
from echoscape.learn.training.config import TrainingConfig
from echoscape.learn.training.distributed import Process, joined_processes
from echoscape.learn.training.logger import LOG_FILE, LogCallback, TrainingLog
from echoscape.learn.training.losses import likelihood_loss, match_loss, pose_errors, score_loss
from echoscape.learn.training.plots import draw_training
from echoscape.learn.training.validation import fixed_pairs, pair_errors
from echoscape.sim.datasets.files.atomic_write import DatasetError, remove_temporaries, write_atomic
from echoscape.sim.datasets.files.output_folder import check_output_folder

SETTINGS_FILE = "settings.json"

DTYPES = {"float32": torch.float32, "bfloat16": torch.bfloat16}
"""Number formats by the names that `TrainingConfig` has for them."""

_MAY_CHANGE = ("steps", "patience", "save_every", "save_minutes")
"""Settings that may differ when a run is resumed: its end and when it is saved."""


@dataclass(frozen=True, kw_only=True)
class TrainingData:
    """Pairs of a training run.

    Attributes:
        training: Pairs to train on.
        validation: Pairs to validate on; None for no validation.
    """

    training: ScanPairs
    validation: ScanPairs | None = None


def train(
    out: Path,
    model_settings: ModelSettings,
    config: TrainingConfig,
    data: TrainingData,
    *,
    init_weights: Path | None = None,
    resume: bool = False,
    device: Device = "auto",
    callback: LogCallback | None = None,
) -> FastKeypointModel:
    """Train a model.

    Args:
        out: Folder of the run; it must be empty or new, unless the run is resumed.
        model_settings: Settings of the model.
        config: How to train it.
        data: Pairs to train and to validate on.
        init_weights: Weights to start from, of any resolution; without, they are drawn by the seed.
        resume: Continue the run in `out`; with as many threads as before, to the same bytes.
        device: Where to compute.
        callback: Called with every entry of the log.

    Returns:
        The model as it is at the end, on the device.

    Raises:
        DatasetError: `out` is not empty (or, to resume, does not hold a run with these settings), or
            `init_weights` is not a model with the same heads.
        ValueError: The images of the data are not those of the model; a loss or its gradient is not finite,
            which ends the run at its last checkpoint; or there is no such device.
    """
    for pairs in filter(None, (data.training, data.validation)):
        if pairs.settings != model_settings.image:
            raise ValueError(f"data must have the model's {model_settings.image}, got {pairs.settings}")
    with joined_processes(resolve_device(device)) as process:
        run = _Run(out, model_settings, config, data, init_weights, process=process, callback=callback)
        run.begin(resume=resume)
        while run.state.step < config.steps and not run.is_out_of_patience:
            run.advance()
        run.end()
        return run.model


def recorded_threads(out: Path) -> int | None:
    """Look up the number of threads of a run, on which the last digits of its weights depend.

    Args:
        out: Folder of the run.

    Returns:
        The number in its settings.json, None where there is no such file or number.
    """
    try:
        threads = json.loads((out / SETTINGS_FILE).read_text())["threads"]
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return threads if isinstance(threads, int) else None


class _Run:
    """One process's part of a training run."""

    def __init__(
        self,
        out: Path,
        model_settings: ModelSettings,
        config: TrainingConfig,
        data: TrainingData,
        init_weights: Path | None,
        *,
        process: Process,
        callback: LogCallback | None,
    ) -> None:
        self.out, self.config, self.data, self.process = out, config, data, process
        self.log = TrainingLog(out, callback) if process.rank == 0 else None
        model = initial_model(model_settings, seed=config.seed)
        initial = None if init_weights is None else load_initial_weights(model, init_weights)
        self.settings = self._settings(model_settings, initial)
        self.model = model.to(process.device)
        self.optimiser = torch.optim.Adam(self.model.parameters(), config.learning_rate)
        self.state = RunState()
        self.forward = DistributedDataParallel(self.model) if process.world > 1 else self.model
        self.matching = Matching(stride=config.match_stride, dtype=DTYPES[config.matching_dtype])
        self.network_dtype = DTYPES[config.network_dtype]
        self.since = self.saved = time.monotonic()
        self.validation_pairs = (
            []
            if data.validation is None
            else fixed_pairs(
                data.validation, config.validate_pairs, seed=config.seed, gap_power=config.gap_power
            )
        )

    def _settings(self, model_settings: ModelSettings, initial: dict[str, Any] | None) -> dict[str, Any]:
        """Return all that decides the result, as settings.json has it."""
        validation = [] if self.data.validation is None else self.data.validation.names
        settings = {
            "model": asdict(model_settings),
            "training": asdict(self.config),
            "processes": self.process.world,
            "data": self.data.training.names,
            "validation": validation,
            "init_weights": initial,
            "device": self.process.device.type,
            "threads": torch.get_num_threads(),
        }
        return json.loads(json.dumps(settings))

    @property
    def is_out_of_patience(self) -> bool:
        """Whether training ends because `patience` validations brought no improvement."""
        waited = self.state.step - self.state.best_step
        patience = self.config.patience
        return (
            patience > 0 and bool(self.validation_pairs) and waited >= patience * self.config.validate_every
        )

    def begin(self, *, resume: bool) -> None:
        """Make the folder, or read the state of the run in it."""
        if resume:
            self._restore(read_checkpoint(self.out))
        else:
            check_output_folder(self.out, empty=True, hint="--resume continues a run that was stopped")
        if self.process.world > 1:
            distributed.barrier()
        if self.process.rank == 0 and not resume:
            self.out.mkdir(parents=True, exist_ok=True)
            self._write_settings()
            self._save()
        if self.log is not None:
            self.log.begin(self.state.step)

    def _restore(self, checkpoint: Checkpoint) -> None:
        defaults = {"training": asdict(TrainingConfig()), "model": asdict(ModelSettings())}
        settings = {**checkpoint.settings}
        # Settings that the version of the run lacked have their defaults.
        settings |= {name: {**defaults[name], **settings.get(name, {})} for name in defaults}
        if _comparable(settings) != _comparable(self.settings):
            raise DatasetError(f"{self.out / FILE_NAME}: was made with other settings, see {SETTINGS_FILE}")
        self.model.load_state_dict(checkpoint.model)
        self.optimiser.load_state_dict(checkpoint.optimiser)
        self.state = checkpoint.state
        if self.process.rank == 0:
            remove_temporaries(self.out)
            self._write_settings()

    def advance(self) -> None:
        """Make one step of Adam, and log, validate and save where that is due."""
        self.state.recent.append(self._step())
        self.state.step += 1
        step, config = self.state.step, self.config
        if step % config.log_every == 0:
            self._log_recent()
        if self.validation_pairs and step % config.validate_every == 0:
            self._validate()
        # Minutes count in a single process only: several would have to agree on them.
        overdue = self.process.world == 1 and time.monotonic() - self.saved > 60 * config.save_minutes
        due = step % config.save_every == 0 or (overdue and step % config.log_every == 0)
        if self.process.rank == 0 and due:
            self._save()
            self._draw()

    def _step(self) -> tuple[float, float, float]:
        """Return the mean loss and the mean errors [m], [rad] of one step."""
        step, config = self.state.step, self.config
        rng = np.random.default_rng(np.random.SeedSequence([config.seed, 0, step, self.process.rank]))
        pairs = [
            self.data.training.draw(config.augmentation, step, rng=rng, gap_power=config.gap_power)
            for _ in range(config.pairs)
        ]
        batch = self.data.training.batch(pairs).to(self.process.device)
        self.forward.train()
        self.optimiser.zero_grad(set_to_none=True)
        truth = batch.truth if config.compensate else GroundTruth(motion=batch.motion)
        true_places = truth.true_places if config.likelihood_weight > 0 else None
        found = self.forward(batch.source, batch.destination, self.matching, self.network_dtype, true_places)
        matches = truth.to_mid_scan(found)
        scale_m = ROBUST_SCALE_PX * self.model.settings.image.pixel_m if config.robust_pose else None
        motion = matches.motion(robust_scale_m=scale_m)
        loss = self._loss(matches, motion, batch.motion)
        if not bool(loss.isfinite()):
            raise ValueError(f"loss must be finite, got {float(loss.detach())} at step {step}; pairs {pairs}")
        loss.backward()
        norm = clip_grad_norm_(self.model.parameters(), config.clip)
        if not bool(norm.isfinite()):
            raise ValueError(f"gradients must be finite, got {float(norm)} at step {step}; pairs {pairs}")
        for group in self.optimiser.param_groups:
            group["lr"] = config.learning_rate_at(step)
        self.optimiser.step()
        off_m, off_rad = (each.detach() for each in pose_errors(motion, batch.motion))
        return float(loss.detach()), float(off_m.mean()), float(off_rad.mean())

    def _loss(self, matches: Matches, motion: Motion, truth: Motion) -> Tensor:
        """Return the loss of a step: that of the pose, and those of the matches that have a weight."""
        config = self.config
        loss = pose_loss(motion, truth, alpha_m=config.alpha_m)
        if config.match_weight > 0:
            loss = loss + config.match_weight * match_loss(matches, truth)
        if config.likelihood_weight > 0:
            loss = loss + config.likelihood_weight * likelihood_loss(matches)
        if config.score_weight > 0:
            loss = loss + config.score_weight * score_loss(matches, truth, scale_m=config.score_scale_m)
        return loss.mean()

    def _log_recent(self) -> None:
        loss_m, off_m, off_rad = np.mean(self.state.recent, axis=0).tolist()
        median = np.median(self.state.recent, axis=0).tolist()
        self._log({"loss_m": loss_m, "mean_m": off_m, "mean_rad": off_rad, "median_m": median[1]})
        self.state.recent.clear()

    def _validate(self) -> None:
        """Log the errors of the validation pairs, and keep the model if it is the best so far."""
        assert self.data.validation is not None
        errors = pair_errors(
            self.model,
            self.data.validation,
            self.validation_pairs,
            self.matching,
            self.network_dtype,
            compensate=self.config.compensate,
        )
        self._log({"validation": asdict(errors)})
        loss_m = self._of_first_process(errors.loss_m)
        if loss_m < self.state.best_m:
            self.state.best_m, self.state.best_step = loss_m, self.state.step
            self._write_weights("best")

    def _of_first_process(self, value: float) -> float:
        """Return the first process's value, so that all end together: running means differ between them."""
        if self.process.world == 1:
            return value
        shared = torch.tensor([value], dtype=torch.float64, device=self.process.device)
        distributed.broadcast(shared, 0)
        return float(shared)

    def _log(self, entry: dict[str, Any]) -> None:
        if self.log is not None:
            self.log.add({"step": self.state.step, **entry})

    def _write_settings(self) -> None:
        write_atomic(self.out / SETTINGS_FILE, (json.dumps(self.settings, indent=1) + "\n").encode())

    def _save(self) -> None:
        now = time.monotonic()
        self.state.seconds += now - self.since
        self.since = self.saved = now
        write_checkpoint(
            self.out,
            Checkpoint(
                settings=self.settings,
                state=self.state,
                model=self.model.state_dict(),
                optimiser=self.optimiser.state_dict(),
            ),
        )

    def _write_weights(self, name: str) -> None:
        if self.process.rank == 0:
            others = {key: value for key, value in self.settings.items() if key not in ("model", "training")}
            record = {**self.settings["training"], **others, "step": self.state.step}
            best = self.state.best_m
            record["validation_loss_m"] = best if math.isfinite(best) else None
            write_weights(self.out / f"{name}.safetensors", self.model, record)

    def end(self) -> None:
        """Write the last state, the weights and the figure."""
        if self.process.rank == 0:
            self._save()
            self._write_weights("last")
            if self.log is not None:
                self.log.end()
            self._draw()

    def _draw(self) -> None:
        """Draw the log, and the matches of a validation pair, or of a training pair where there is none."""
        if not (self.out / LOG_FILE).is_file():
            return  # nothing is logged yet
        pairs = self.data.validation or self.data.training
        pair = self.validation_pairs[0] if self.validation_pairs else None
        pair = pair or fixed_pairs(pairs, 1, seed=self.config.seed)[0]
        draw_training(self.out / LOG_FILE, self.out / "loss.png", self.model, (pairs, pair))


def _comparable(settings: dict[str, Any]) -> dict[str, Any]:
    """Return the settings that must be the same when a run is resumed."""
    training = {name: value for name, value in settings["training"].items() if name not in _MAY_CHANGE}
    others = {name: value for name, value in settings.items() if name not in ("device", "threads")}
    return {**others, "training": training}
