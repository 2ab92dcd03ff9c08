"""The figure of a training run: loss and errors over steps, and the matches of one pair."""

import json
from pathlib import Path

import numpy as np
import torch
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from echoscape.learn.data.pair_batch import Pair
from echoscape.learn.data.scan_pairs import ScanPairs
from echoscape.learn.geometry.procrustes import moved
from echoscape.learn.model.fast_keypoint_model import FastKeypointModel, Matching
from echoscape.sim.datasets.files.atomic_write import read_text, temporary_beside

_MATCHES = 150
"""Matches that are drawn, those with the largest weights."""
_DOT, _LINE = "tab:green", "tab:orange"


def draw_training(log: Path, out: Path, model: FastKeypointModel, example: tuple[ScanPairs, Pair]) -> None:
    """Draw a training run into a PNG file, whole or not at all.

    Args:
        log: The log of the run.
        out: The file to write.
        model: The model, on any device.
        example: A pair whose matches are drawn, and where it is from.
    """
    figure = Figure(figsize=(17, 5), layout="constrained")
    FigureCanvasAgg(figure)
    losses, errors, matches = figure.subplots(1, 3, width_ratios=(5, 5, 6))
    entries = [json.loads(line) for line in read_text(log).splitlines()]
    validated = any("validation" in entry for entry in entries)
    loss = "loss [m]; validation: of the pose only" if validated else "loss [m]"
    _draw_curves(losses, entries, "loss_m", loss)
    _draw_curves(errors, entries, "median_m", "median error of a pair's translation [m]")
    _draw_matches(matches, model, *example)
    temporary = temporary_beside(out)
    figure.savefig(temporary, format="png", dpi=80)
    temporary.replace(out)


def _draw_curves(axes: Axes, entries: list[dict], name: str, label: str) -> None:
    training = [entry for entry in entries if "validation" not in entry]
    validation = [entry for entry in entries if "validation" in entry]
    axes.plot([x["step"] for x in training], [x[name] for x in training], ".", label="training")
    if validation:
        held_out = [x["validation"][name] for x in validation]
        axes.plot([x["step"] for x in validation], held_out, "o-", label="validation")
    if entries:
        axes.set_yscale("log")
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.yaxis.set_minor_locator(NullLocator())
    axes.set(xlabel="step", ylabel=label)
    axes.legend()


@torch.no_grad()
def _draw_matches(axes: Axes, model: FastKeypointModel, pairs: ScanPairs, pair: Pair) -> None:
    """Draw keypoints of the source, moved by the estimate, and lines from there to their matches."""
    training, device = model.training, next(model.parameters()).device
    batch = pairs.batch([pair]).to(device)
    model.eval()
    matches = model(batch.source, batch.destination, Matching(stride=2), torch.float32)
    model.train(training)
    start_m = moved(matches.source_m, matches.motion())[0].cpu().numpy()
    found_m, weight = matches.destination_m[0].cpu().numpy(), matches.weights[0].cpu().numpy()
    half = model.settings.image.size * model.settings.image.pixel_m / 2
    image = batch.destination[0, 0].cpu().numpy()
    axes.imshow(image, cmap="gray", extent=(-half, half, -half, half), vmax=0.6)
    best = np.argsort(weight)[-_MATCHES:]
    for start, end in zip(start_m[best], found_m[best], strict=True):
        axes.plot([start[1], end[1]], [start[0], end[0]], color=_LINE, linewidth=0.7)
    axes.scatter(found_m[best, 1], found_m[best, 0], s=4, color=_DOT)
    axes.plot([], [], ".", color=_DOT, label="matched point of the destination (background)")
    axes.plot([], [], color=_LINE, label="error: to the keypoint of the source, moved by the estimate")
    axes.legend(loc="upper left", fontsize=8)
    axes.set(xlim=(-half, half), ylim=(-half, half), xlabel="right [m]", ylabel="forward [m]")
    axes.set_title(f"the {len(best)} matches of a pair with the largest weights")
