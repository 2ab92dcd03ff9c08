"""The picture of a training run: how its errors fell, and the matches of one pair."""

import json
from pathlib import Path

import numpy as np
import torch
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from echoscape.learn.data.scan_pairs import Pair, PairSet
from echoscape.learn.geometry.procrustes import moved
from echoscape.learn.model.keypoint_model import KeypointModel, Matching
from echoscape.sim.datasets.files.atomic_write import read_text, temporary_beside


def draw_training(log: Path, out: Path, model: KeypointModel, shown: tuple[PairSet, Pair]) -> None:
    """Draw the lines of a log and the matches of the pair `shown` into the PNG `out`, whole or not at all."""
    figure = Figure(figsize=(17, 5), layout="constrained")
    FigureCanvasAgg(figure)
    losses, errors, matches = figure.subplots(1, 3, width_ratios=(5, 5, 6))
    lines = [json.loads(line) for line in read_text(log).splitlines()]
    _draw_curves(losses, lines, "loss_m", "loss [m]; validation: that of the pose alone")
    _draw_curves(errors, lines, "median_m", "median error of a pair's translation [m]")
    _draw_matches(matches, model, *shown)
    temporary = temporary_beside(out)
    figure.savefig(temporary, format="png", dpi=80)
    temporary.replace(out)


def _draw_curves(axes: Axes, lines: list[dict], name: str, label: str) -> None:
    training = [line for line in lines if "validation" not in line]
    validation = [line for line in lines if "validation" in line]
    axes.plot([x["step"] for x in training], [x[name] for x in training], ".", label="training")
    held_out = [x["validation"][name] for x in validation]
    axes.plot([x["step"] for x in validation], held_out, "o-", label="validation")
    if lines:
        axes.set_yscale("log")
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.yaxis.set_minor_locator(NullLocator())
    axes.set(xlabel="step", ylabel=label)
    axes.legend()


@torch.no_grad()
def _draw_matches(axes: Axes, model: KeypointModel, pairs: PairSet, pair: Pair) -> None:
    """Draw keypoints of the source, moved by the estimate, and lines from there to their matches."""
    batch = pairs.batch([pair])
    training = model.training
    model.eval()
    matches = model(batch.source, batch.destination, Matching(stride=2), torch.float32)
    model.train(training)
    start_m = moved(matches.source_m, matches.motion())[0].numpy()
    found, weight = matches.destination_m[0].numpy(), matches.weights[0].numpy()
    half = model.settings.image.size * model.settings.image.pixel_m / 2
    axes.imshow(batch.destination[0, 0].numpy(), cmap="gray", extent=(-half, half, -half, half), vmax=0.6)
    best = np.argsort(weight)[-150:]
    for start, end in zip(start_m[best], found[best], strict=True):
        axes.plot([start[1], end[1]], [start[0], end[0]], color="tab:orange", linewidth=0.7)
    axes.scatter(found[best, 1], found[best, 0], s=4, color="tab:green")
    axes.set(xlim=(-half, half), ylim=(-half, half), title="a pair's 150 heaviest matches: place and error")
