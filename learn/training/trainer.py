"""Training: pairs in, a model out, in a folder that tells how it went and from which it can go on.

Source: Barnes & Posner 2020, section IV (Adam, 1e-3, alpha = 10); gradients are clipped at a norm of 10. With
torchrun, every process draws pairs of its own and gradients are averaged.

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

from echoscape.learn.data.ground_truth import Truth
from echoscape.learn.data.scan_pairs import PairSet
from echoscape.learn.geometry.matches import Matches
from echoscape.learn.geometry.procrustes import ROBUST_SCALE_PX, Motion
from echoscape.learn.model.keypoint_model import KeypointModel, ModelSettings
from echoscape.learn.model.weights import write_weights
from echoscape.learn.training.checkpoint import (
    FILE_NAME,
    Checkpoint,
    Progress,
    begin_with,
    initial_model,
    read_checkpoint,
    write_checkpoint,
)
from echoscape.learn.training.config import DTYPES, TrainSettings
from echoscape.learn.training.distributed import joined_processes
from echoscape.learn.training.logger import LOG_FILE, Report, TrainingLog
from echoscape.learn.training.losses import likelihood_loss, match_loss, pose_errors, pose_loss, score_loss
from echoscape.learn.training.plots import draw_training
from echoscape.learn.training.validation import fixed_pairs, pair_errors
from echoscape.sim.datasets.files.atomic_write import DatasetError, remove_temporaries, write_whole
from echoscape.sim.datasets.files.output_folder import check_output_folder

SETTINGS_FILE = "settings.json"


@dataclass(frozen=True, kw_only=True)
class Data:
    """What is learned from, and what is validated on (None: nothing)."""

    training: PairSet
    validation: PairSet | None = None


def train(
    out: Path,
    model_settings: ModelSettings,
    settings: TrainSettings,
    data: Data,
    *,
    start: Path | None = None,
    resume: bool = False,
    report: Report | None = None,
) -> KeypointModel:
    """Train a model into the folder `out` and return it as it is at the end.

    start: weights to begin with, of any resolution; without, the seed draws them.

    Raises:
        DatasetError: `out` is not empty (or, to resume, holds no run with these settings), or `start` is no
            model with the same heads.
        ValueError: a loss or its gradient is not finite, which ends the run at its last checkpoint.
    """
    with joined_processes() as (rank, world):
        run = _Run(out, model_settings, settings, data, start, rank=rank, world=world, report=report)
        run.begin(resume=resume)
        while run.progress.step < settings.steps and not run.is_out_of_patience:
            run.advance()
        run.end()
        return run.model


class _Run:
    """One process's part of a training run."""

    def __init__(
        self,
        out: Path,
        model_settings: ModelSettings,
        settings: TrainSettings,
        data: Data,
        start: Path | None,
        *,
        rank: int,
        world: int,
        report: Report | None,
    ) -> None:
        self.out, self.settings, self.data = out, settings, data
        self.rank, self.world = rank, world
        self.log = TrainingLog(out, report) if rank == 0 else None
        self.model = initial_model(model_settings, seed=settings.seed)
        begun = None if start is None else begin_with(self.model, start)
        told = {"model": asdict(model_settings), "train": asdict(settings), "processes": world}
        held = [] if data.validation is None else data.validation.names
        told |= {"data": data.training.names, "validation": held, "start": begun}
        self.told = json.loads(json.dumps(told))
        self.optimiser = torch.optim.Adam(self.model.parameters(), settings.learning_rate)
        self.progress = Progress()
        self.forward = DistributedDataParallel(self.model) if world > 1 else self.model
        self.since = self.saved = time.monotonic()
        self.chosen = (
            []
            if data.validation is None
            else fixed_pairs(
                data.validation,
                settings.validate_pairs,
                seed=settings.seed,
                gap_power=settings.gap_power,
            )
        )

    @property
    def is_out_of_patience(self) -> bool:
        """Whether so many validations were no better that training ends."""
        waited = self.progress.step - self.progress.best_step
        patience = self.settings.patience
        return patience > 0 and bool(self.chosen) and waited >= patience * self.settings.validate_every

    def begin(self, *, resume: bool) -> None:
        """Make the folder, or take up what is in it."""
        if resume:
            self._take_up(read_checkpoint(self.out))
        else:
            check_output_folder(self.out, empty=True, hint="--resume continues a run that was stopped")
        if self.world > 1:
            distributed.barrier()
        if self.rank == 0 and not resume:
            self.out.mkdir(parents=True, exist_ok=True)
            write_whole(self.out / SETTINGS_FILE, (json.dumps(self.told, indent=1) + "\n").encode())
            self._save()
        if self.log is not None:
            self.log.begin(self.progress.step)

    def _take_up(self, checkpoint: Checkpoint) -> None:
        defaults = {"train": asdict(TrainSettings()), "model": asdict(ModelSettings())}
        told = {**checkpoint.settings}
        told |= {name: {**defaults[name], **told[name]} for name in defaults}  # of versions that had fewer
        if _without_ends(told) != _without_ends(self.told):
            raise DatasetError(f"{self.out / FILE_NAME}: was made with other settings, see {SETTINGS_FILE}")
        self.model.load_state_dict(checkpoint.model)
        self.optimiser.load_state_dict(checkpoint.optimiser)
        self.progress = checkpoint.progress
        if self.rank == 0:
            remove_temporaries(self.out)
            write_whole(self.out / SETTINGS_FILE, (json.dumps(self.told, indent=1) + "\n").encode())

    def advance(self) -> None:
        """Make one step of Adam, and what is due after it."""
        self.progress.recent.append(self._step())
        self.progress.step += 1
        step, settings = self.progress.step, self.settings
        if step % settings.log_every == 0:
            self._log_recent()
        if self.chosen and step % settings.validate_every == 0:
            self._validate()
        # Minutes count on one process only where no other waits for it to agree.
        late = self.world == 1 and time.monotonic() - self.saved > 60 * settings.save_minutes
        if self.rank == 0 and (step % settings.save_every == 0 or (late and step % settings.log_every == 0)):
            self._save()
            self._draw()

    def _step(self) -> tuple[float, float, float]:
        """Return the mean loss and the mean errors [m], [rad] of one step."""
        step, settings = self.progress.step, self.settings
        rng = np.random.default_rng(np.random.SeedSequence([settings.seed, 0, step, self.rank]))
        drawn = [
            self.data.training.drawn(settings.turns, step, rng=rng, gap_power=settings.gap_power)
            for _ in range(settings.pairs)
        ]
        batch = self.data.training.batch(drawn)
        self.forward.train()
        self.optimiser.zero_grad(set_to_none=True)
        truth = batch.truth if settings.compensate else Truth(motion=batch.motion)
        places = truth.places if settings.likelihood_weight > 0 else None
        network = DTYPES[settings.network]
        found = self.forward(batch.source, batch.destination, settings.matching, network, places)
        matches = truth.to_mid_scan(found)
        scale_m = ROBUST_SCALE_PX * self.model.settings.image.pixel_m if settings.robust_pose else None
        motion = matches.motion(robust_scale_m=scale_m)
        loss = self._loss(matches, motion, batch.motion)
        if not bool(loss.isfinite()):
            raise ValueError(f"loss must be finite, got {float(loss.detach())} at step {step}; pairs {drawn}")
        loss.backward()
        norm = clip_grad_norm_(self.model.parameters(), settings.clip)
        if not bool(norm.isfinite()):
            raise ValueError(f"gradients must be finite, got {float(norm)} at step {step}; pairs {drawn}")
        for group in self.optimiser.param_groups:
            group["lr"] = settings.rate(step)
        self.optimiser.step()
        shift, turn = (each.detach() for each in pose_errors(motion, batch.motion))
        return float(loss.detach()), float(shift.mean()), float(turn.mean())

    def _loss(self, matches: Matches, motion: Motion, truth: Motion) -> Tensor:
        """Return the loss of a step: of the motion, and of the matches as far as the settings ask for it."""
        settings = self.settings
        loss = pose_loss(motion, truth, alpha_m=settings.alpha_m)
        if settings.match_weight > 0:
            loss = loss + settings.match_weight * match_loss(matches, truth)
        if settings.likelihood_weight > 0:
            loss = loss + settings.likelihood_weight * likelihood_loss(matches)
        if settings.score_weight > 0:
            loss = loss + settings.score_weight * score_loss(matches, truth, scale_m=settings.score_scale_m)
        return loss.mean()

    def _log_recent(self) -> None:
        loss, shift, turn = np.mean(self.progress.recent, axis=0).tolist()
        median = np.median(self.progress.recent, axis=0).tolist()
        self._log({"loss_m": loss, "mean_m": shift, "mean_rad": turn, "median_m": median[1]})
        self.progress.recent.clear()

    def _validate(self) -> None:
        """Log the errors of the held-out pairs, and keep the model if it is the best."""
        assert self.data.validation is not None
        dtype = DTYPES[self.settings.network]
        errors = pair_errors(
            self.model,
            self.data.validation,
            self.chosen,
            self.settings.matching,
            dtype,
            compensate=self.settings.compensate,
        )
        self._log({"validation": asdict(errors)})
        loss_m = self._of_first_process(errors.loss_m)
        if loss_m < self.progress.best_m:
            self.progress.best_m, self.progress.best_step = loss_m, self.progress.step
            self._write_weights("best")

    def _of_first_process(self, value: float) -> float:
        """Return the first process's value, so that all end together: running means differ between them."""
        if self.world == 1:
            return value
        told = torch.tensor([value], dtype=torch.float64)
        distributed.broadcast(told, 0)
        return float(told)

    def _log(self, line: dict[str, Any]) -> None:
        if self.log is not None:
            self.log.add({"step": self.progress.step, **line})

    def _save(self) -> None:
        now = time.monotonic()
        self.progress.seconds += now - self.since
        self.since = self.saved = now
        write_checkpoint(
            self.out,
            Checkpoint(
                settings=self.told,
                progress=self.progress,
                model=self.model.state_dict(),
                optimiser=self.optimiser.state_dict(),
            ),
        )

    def _write_weights(self, name: str) -> None:
        if self.rank == 0:
            record = {name: value for name, value in self.told.items() if name not in ("model", "train")}
            record = {**self.told["train"], **record, "step": self.progress.step}
            best = self.progress.best_m
            record["validation_loss_m"] = best if math.isfinite(best) else None
            write_weights(self.out / f"{name}.safetensors", self.model, record)

    def end(self) -> None:
        """Write the last state, the weights and the plot."""
        if self.rank == 0:
            self._save()
            self._write_weights("last")
            if self.log is not None:
                self.log.end()
            self._draw()

    def _draw(self) -> None:
        """Draw how the run went, and matches of a pair that is held out, or learned from for want of one."""
        if not (self.out / LOG_FILE).is_file():
            return  # nothing is known yet
        pairs = self.data.validation or self.data.training
        pair = self.chosen[0] if self.chosen else fixed_pairs(pairs, 1, seed=self.settings.seed)[0]
        draw_training(self.out / LOG_FILE, self.out / "loss.png", self.model, (pairs, pair))


def _without_ends(told: dict[str, Any]) -> dict[str, Any]:
    """Return settings without those that may change when a run is taken up: its end, when it is saved."""
    free = ("steps", "patience", "save_every", "save_minutes")
    return {**told, "train": {name: value for name, value in told["train"].items() if name not in free}}
