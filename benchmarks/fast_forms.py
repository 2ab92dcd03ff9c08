"""What each fast form saves of its command's time: a training step, or odometry over a drive.

    python -m benchmarks.fast_forms --data FOLDER [--repeats 9] [--threads 1] [--resolution M] [--forms NAME]

Both are timed in turn in one process, so that a busy machine slows both; printed are medians. Without a form
its plain counterpart stands in: PyTorch's own operator, or the form of `learn.model.keypoint_model`.
"""

import argparse
import statistics
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import torch
from torch import Tensor, nn
from torch.nn.functional import interpolate

from benchmarks.machine import description
from echoscape.eval.odometry.learned import Solver, learned_odometry
from echoscape.learn.data.image_settings import ImageSettings
from echoscape.learn.geometry.procrustes import moved
from echoscape.learn.geometry.se2 import to_motion
from echoscape.learn.model import fast_keypoint_model, feature_pyramid, keypoints, unet
from echoscape.learn.model.blurred_pooling import blurred_max_pool
from echoscape.learn.model.fast_keypoint_model import FastKeypointModel, Matching
from echoscape.learn.model.feature_pyramid import FeaturePyramid
from echoscape.learn.model.keypoint_model import (
    KeypointModel,
    Maps,
    dense_descriptors,
    pose_loss,
    unit,
)
from echoscape.learn.model.local_matching import Moments, Near, NearSearch
from echoscape.learn.model.model_settings import ModelSettings
from echoscape.learn.model.pixel_coords import pixel_grid, sampled
from echoscape.learn.model.tiled_matching import Search
from echoscape.learn.model.weights import chosen_weights
from echoscape.learn.odometry import scan_matcher
from echoscape.learn.training.checkpoint import initial_model
from echoscape.learn.training.losses import likelihood_loss
from echoscape.sim.datasets.scan_folder import ScanFolder, open_folder
from echoscape.sim.datasets.se2 import SE2
from echoscape.sim.numerics.malloc import keep_freed_memory

_SCANS = 10
"""Scans of a timed drive."""


# ---------------------------------------------------------------------- plain counterparts


def _from_dense(maps: Maps, points_px: Tensor) -> Tensor:
    return unit(sampled(dense_descriptors(maps), points_px))


def _interpolated(values: Tensor, factor: int) -> Tensor:
    if factor == 1:
        return values
    return interpolate(values, scale_factor=factor, mode="bilinear", align_corners=False)


def _lengths_by_resizing(values: Tensor, factor: int) -> Tensor:
    return _interpolated(values, factor).square().sum(1)


def _upsampled_above(coarse: Tensor, fine: Tensor) -> Tensor:
    return torch.cat([_interpolated(coarse, 2), fine], 1)


def _global(queries: Tensor, pyramid: FeaturePyramid, *, temperature: float) -> Search:
    logits = temperature * (queries @ pyramid.descriptors().flatten(2).to(queries.dtype))
    places = logits.softmax(-1) @ pixel_grid(*pyramid.shape, like=queries)
    return Search(places_px=(places + 0.5) * pyramid.stride - 0.5, log_sums=logits.logsumexp(-1))


def _local(queries: Tensor, pyramid: FeaturePyramid, *, temperature: float, near: Near) -> NearSearch:
    places = (pixel_grid(*pyramid.shape, like=queries) + 0.5) * pyramid.stride - 0.5
    log_prior = -(torch.cdist(near.places_px, places[None]) ** 2) / (2 * near.deviation_px**2)
    logits = temperature * (queries @ pyramid.descriptors().flatten(2).to(queries.dtype)) + log_prior
    return NearSearch(found=_moments(logits, places), expected=_moments(log_prior, places))


def _moments(logits: Tensor, places: Tensor) -> Moments:
    chances = logits.softmax(-1)
    products = (places[:, :, None] * places[:, None]).flatten(1)
    mean, square = (chances @ torch.cat([places, products], 1)).split([2, 4], -1)
    spread = square.unflatten(-1, (2, 2)) - mean[..., None] * mean[..., None, :]
    return Moments(places_px=mean, spread_px2=spread + 0.02 * torch.eye(2))


def _unfolded(model: KeypointModel) -> nn.Module:
    return FastKeypointModel.from_plain(model).eval().requires_grad_(False)


@dataclass(frozen=True, kw_only=True)
class Form:
    """A fast form: the command that it is for, and the attributes that stand in for it."""

    command: str
    patches: tuple[tuple[Any, str, Any], ...]

    def without(self) -> ExitStack:
        """Return a context in which the plain counterpart is used."""
        stack = ExitStack()
        for owner, name, plain in self.patches:
            stack.enter_context(patch.object(owner, name, plain))
        return stack


_DESCRIPTORS = tuple((module, "descriptors_at", _from_dense) for module in (fast_keypoint_model, keypoints))
_IDENTITY = tuple((module, "with_gradient_by_pixel", lambda x: x) for module in (unet, fast_keypoint_model))
_BILINEAR = (
    (feature_pyramid, "resized", _interpolated),
    (feature_pyramid, "squared_lengths", _lengths_by_resizing),
    (unet, "upsampled_above", _upsampled_above),
)
_GLOBAL = ((fast_keypoint_model, "match_global", _global),)

FORMS = {
    "step: ops/channels_last": Form(command="step", patches=_IDENTITY),
    "step: descriptors": Form(command="step", patches=_DESCRIPTORS),
    "step: tiled_matching": Form(command="step", patches=_GLOBAL),
    "drive: ops/inference": Form(command="drive", patches=((unet, "blurred_maxima", blurred_max_pool),)),
    "drive: bilinear interpolation": Form(command="drive", patches=_BILINEAR),
    "drive: descriptors": Form(command="drive", patches=_DESCRIPTORS),
    "drive: local_matching": Form(command="drive", patches=((fast_keypoint_model, "match_local", _local),)),
    "drive: folded normalisation, channels last": Form(
        command="drive", patches=((scan_matcher, "folded", _unfolded),)
    ),
    "pairs: tiled_matching": Form(command="pairs", patches=_GLOBAL),
}


# ---------------------------------------------------------------------- commands


def training_step(size: int = 320) -> Callable[[], None]:
    """Return one step of training as the bundled weights were trained: every 2nd pixel, bfloat16 network."""
    settings = ModelSettings(image=ImageSettings(size=size), pooling="blurred")
    model = initial_model(settings, seed=1).train()
    optimiser = torch.optim.Adam(model.parameters(), 1e-3)
    source, destination = torch.rand(2, 1, 1, size, size)
    truth = to_motion([SE2(x_m=1.0, y_m=0.0, yaw_rad=0.1)])

    def step() -> None:
        optimiser.zero_grad()
        matches = model(source, destination, Matching(stride=2), torch.bfloat16, partial(moved, motion=truth))
        (pose_loss(matches.motion(), truth, alpha_m=10.0) + likelihood_loss(matches)).mean().backward()
        optimiser.step()

    return step


def drive(folder: ScanFolder, resolution_m: float | None, *, solver: Solver) -> Callable[[], None]:
    """Return odometry over the first scans of a folder, as the command runs it, reading included."""
    doppler_s = -float(folder.sensor.doppler_shift_s.mean())
    odometry = learned_odometry(
        chosen_weights(resolution_m), solver=solver, device="cpu", doppler_beta_s=doppler_s
    )

    def run() -> None:
        state = odometry.start(folder.read(0))
        for index in range(1, min(_SCANS, len(folder))):
            _, state = odometry.follow(state, folder.read(index))

    return run


def compare(make: Callable[[], Callable[[], None]], form: Form, repeats: int) -> tuple[float, float]:
    """Return the medians of seconds with and without a form, timed in turn."""
    fast = make()
    with form.without():
        plain = make()
        plain()
    fast()
    seconds: tuple[list[float], list[float]] = ([], [])
    for _ in range(repeats):
        began = time.perf_counter()
        fast()
        seconds[0].append(time.perf_counter() - began)
        with form.without():
            began = time.perf_counter()
            plain()
            seconds[1].append(time.perf_counter() - began)
    return statistics.median(seconds[0]), statistics.median(seconds[1])


def main() -> None:
    """Measure and print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, required=True, help="a folder of 3 scans or more")
    parser.add_argument("--resolution", type=float, help="pixel width of the bundled weights [m]")
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--forms", nargs="+", choices=list(FORMS), default=list(FORMS))
    options = parser.parse_args()
    keep_freed_memory()
    torch.set_num_threads(options.threads)
    folder = open_folder(options.data)
    makers = {
        "step": training_step,
        "drive": partial(drive, folder, options.resolution, solver="keyframe"),
        "pairs": partial(drive, folder, options.resolution, solver="robust"),
    }
    print(f"{description()}, torch {torch.__version__}, {options.threads} thread(s)")
    print("| form | with [s] | without [s] | saved |\n|---|---:|---:|---:|")
    for name in options.forms:
        fast, plain = compare(makers[FORMS[name].command], FORMS[name], options.repeats)
        print(f"| {name} | {fast:.3f} | {plain:.3f} | {100 * (1 - fast / plain):.0f} % |", flush=True)


if __name__ == "__main__":
    main()
