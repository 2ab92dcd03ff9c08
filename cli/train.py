"""`echoscape train`: parse the settings, open the data, train a model, and say where it is."""

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import torch
import tyro
from rich.console import Console

from echoscape.cli.arguments import parse
from echoscape.cli.progress import ProgressBars
from echoscape.learn.data.image import ImageSettings
from echoscape.learn.data.scan_pairs import PairSet
from echoscape.learn.model.keypoint_model import ModelSettings
from echoscape.learn.training.config import TrainSettings
from echoscape.learn.training.trainer import Data, train
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.numerics import malloc as heap


@dataclass(frozen=True, kw_only=True)
class Options:
    """Learn keypoint odometry from folders of scans that tell poses, simulated or real.

    torchrun --nproc-per-node N -m echoscape.cli.train ... trains with N processes.
    """

    data: tuple[Path, ...]
    """Folders to learn from."""
    out: Path
    """Folder of the run; it must be empty or new, unless --resume."""
    validate: tuple[Path, ...] = ()
    """Folders to validate on; the best model on them is kept."""
    resolution: float = ImageSettings.pixel_m
    """Width of a picture's pixel [m]; the paper has 0.6912 and 0.3456."""
    size: int = ImageSettings.size
    """Pixels a side of a picture, even; multiples of 80 need no margin."""
    near_m: float = ImageSettings.near_m
    """Range below which pictures are empty [m]."""
    location_head: bool = True
    """Learn where keypoints are; without, they are the cells' middles."""
    score_head: bool = True
    """Learn how far to trust keypoints; without, descriptors alone weigh matches."""
    temperature: float = 100.0
    """T of the matching softmax."""
    pooling: Literal["max", "blurred"] = "max"
    """How the encoder halves its maps: by plain maxima, as in the paper, or by maxima that are low-passed, so
    that small motions are not found too short."""
    start: Path | None = None
    """Weights to begin with, of any resolution; without, --seed draws them."""
    cache: Path | None = None
    """Folder for prepared scans; by default the folder `cache` in each data folder."""
    threads: int | None = None
    """Threads of the process; by default all processors. Another number changes the last digits."""
    resume: bool = False
    """Go on with the run in OUT."""
    train: Annotated[TrainSettings, tyro.conf.arg(name="")] = field(default_factory=TrainSettings)
    """How to train."""

    @property
    def model(self) -> ModelSettings:
        """The model to train."""
        return ModelSettings(
            image=ImageSettings(pixel_m=self.resolution, size=self.size, near_m=self.near_m),
            temperature=self.temperature,
            location_head=self.location_head,
            score_head=self.score_head,
            pooling=self.pooling,
        )


def main(arguments: Sequence[str]) -> int:
    """Run the subcommand and return its exit code."""
    try:
        options = parse(Options, prog="echoscape train", words=arguments)
        model_settings = options.model
        if options.threads is not None and options.threads < 1:
            raise ValueError(f"threads must be 1 or more, got {options.threads}")
        if not options.data:
            raise ValueError("data must name one folder or more")
    except ValueError as error:
        return _refused(str(error), 2)
    return _train(options, model_settings)


def _train(options: Options, model_settings: ModelSettings) -> int:
    heap.keep_freed_memory()
    if options.threads is not None:
        torch.set_num_threads(options.threads)
    console, since = Console(stderr=True), time.monotonic()
    try:
        with ProgressBars(console) as stages:
            data = _data(options, model_settings.image, stages)
            train(
                options.out,
                model_settings,
                options.train,
                data,
                start=options.start,
                resume=options.resume,
                report=lambda line: _report(stages, options.train.steps, line),
            )
    except KeyboardInterrupt:
        return _refused("interrupted; add --resume to go on from the last checkpoint", 130)
    except (DatasetError, ValueError) as error:
        return _refused(str(error), 2)
    except OSError as error:
        return _refused(f"{error.filename or options.out}: {error.strerror or error}", 1)
    Console().print(
        f"{options.out}: trained in {time.monotonic() - since:.0f} s; last.safetensors, log.jsonl, loss.png"
    )
    return 0


def _data(options: Options, image: ImageSettings, stages: ProgressBars) -> Data:
    training = PairSet(options.data, image, cache=options.cache, report=stages.report)
    if not options.validate:
        return Data(training=training)
    learned = {folder.resolve() for folder in options.data}
    if both := [str(folder) for folder in options.validate if folder.resolve() in learned]:
        raise ValueError(f"validate must be folders that are not learned from, got {', '.join(both)} in both")
    return Data(
        training=training,
        validation=PairSet(options.validate, image, cache=options.cache, report=stages.report),
    )


def _report(stages: ProgressBars, steps: int, line: dict[str, Any]) -> None:
    stages.report("steps", line["step"], steps)
    if "validation" in line:
        errors = line["validation"]
        told = f"validation: median {errors['median_m']:.3f} m, mean {errors['mean_m']:.3f} m"
        print(f"step {line['step']}: {told}", file=sys.stderr)


def _refused(message: str, code: int) -> int:
    print(f"echoscape train: {message}", file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
