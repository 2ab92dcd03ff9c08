"""`echoscape train`: train keypoint odometry on folders of scans with poses."""

import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro
from rich.console import Console

from echoscape.cli.arguments import in_option_names, parse, with_config_file
from echoscape.cli.progress import ProgressBars
from echoscape.cli.torch_setup import check_threads, idle_cores, require_torch, use_threads
from echoscape.learn.data.image_settings import ImageSettings
from echoscape.learn.training.config import TrainingConfig

if TYPE_CHECKING:
    from echoscape.learn.training.trainer import TrainingData


@dataclass(frozen=True, kw_only=True)
class Options:
    """Train keypoint odometry on folders of scans with poses, simulated or real.

    torchrun --nproc-per-node N -m echoscape.cli.train ... trains with N processes.
    """

    data: tuple[Path, ...]
    """Folders to train on."""
    out: Path
    """Folder of the run; it must be empty or new, unless --resume."""
    validate: tuple[Path, ...] = ()
    """Folders to validate on; the model that is best on them is kept."""
    resolution: float = ImageSettings.pixel_m
    """Width of an image's pixel [m]; the paper has 0.6912 and 0.3456."""
    size: int = ImageSettings.size
    """Pixels a side of an image, even; multiples of 80 need no margin."""
    near_m: float = ImageSettings.near_m
    """Range below which images are empty [m]."""
    location_head: bool = True
    """Learn the positions of keypoints; without, they are at the centres of the cells."""
    score_head: bool = True
    """Learn scores of keypoints; without, matches are weighted by descriptors alone."""
    temperature: float = 100.0
    """T of the matching softmax."""
    pooling: Literal["max", "blurred"] = "max"
    """How the encoder halves its maps: by maxima, as in the paper, or by low-passed maxima, so that small
    motions are not underestimated."""
    init_weights: Path | None = None
    """Weights to start from, of any resolution; without, --seed draws them."""
    cache: Path | None = None
    """Folder for prepared scans; by default the folder `cache` in each data folder."""
    device: Literal["auto", "cpu", "cuda"] = "auto"
    """Where to train; auto takes a GPU where PyTorch finds one."""
    threads: int | None = None
    """Threads on the CPU. By default as many as the run to --resume had; else OMP_NUM_THREADS; else the
    physical cores less the load of the last minute. Another number changes the last digits of the weights."""
    resume: bool = False
    """Continue the run in OUT."""
    config: Path | None = None
    """TOML file of options: keys are their names, dotted options are keys in tables
    (--augmentation.max-shift-m is max-shift-m in [augmentation]), booleans are written as
    location-head = false. Options on the command line override it."""
    training: Annotated[TrainingConfig, tyro.conf.arg(name="")] = field(default_factory=TrainingConfig)
    """How to train."""

    @property
    def image(self) -> ImageSettings:
        """How scans become images."""
        return ImageSettings(pixel_m=self.resolution, size=self.size, near_m=self.near_m)


def main(arguments: Sequence[str]) -> int:
    """Run the subcommand.

    Args:
        arguments: The words after `echoscape train`.

    Returns:
        The exit code: 0 done, 1 a file could not be written, 2 bad input, 130 interrupted.
    """
    try:
        words = with_config_file(Options, arguments)
        options = parse(Options, prog="echoscape train", words=words)
        if not options.data:
            raise ValueError("data must name one folder or more")
        check_threads(options.threads)
        require_torch("train")
        return _train(options)
    except KeyboardInterrupt:
        return _refuse("interrupted; add --resume to continue from the last checkpoint", 130)
    except ValueError as error:  # errors of a data set among them
        return _refuse(in_option_names(Options, str(error)), 2)
    except OSError as error:
        return _refuse(f"{error.filename or 'OUT'}: {error.strerror or error}", 1)


def _train(options: Options) -> int:
    from echoscape.learn.model.model_settings import ModelSettings
    from echoscape.learn.training.trainer import train
    from echoscape.sim.numerics.malloc import keep_freed_memory

    model = ModelSettings(
        image=options.image,
        temperature=options.temperature,
        location_head=options.location_head,
        score_head=options.score_head,
        pooling=options.pooling,
    )
    keep_freed_memory()
    use_threads(_threads(options))
    since = time.monotonic()
    with ProgressBars(Console(stderr=True)) as bars:
        train(
            options.out,
            model,
            options.training,
            _data(options, bars),
            init_weights=options.init_weights,
            resume=options.resume,
            device=options.device,
            callback=lambda entry: _report(bars, options.training.steps, entry),
        )
    Console().print(
        f"{options.out}: trained in {time.monotonic() - since:.0f} s; last.safetensors, log.jsonl, loss.png"
    )
    return 0


def _threads(options: Options) -> int:
    """Return the number of threads: as given, as the run to resume had, or as many as cores are idle."""
    from echoscape.learn.training.trainer import recorded_threads

    recorded = recorded_threads(options.out) if options.resume else None
    return options.threads or recorded or idle_cores()


def _data(options: Options, bars: ProgressBars) -> "TrainingData":
    from echoscape.learn.data.scan_pairs import TRAINING_STRIDES, ScanPairs
    from echoscape.learn.training.trainer import TrainingData

    def pairs(folders: Sequence[Path]) -> ScanPairs:
        return ScanPairs(
            folders,
            **asdict(options.image),
            stride=TRAINING_STRIDES,
            codes=False,
            labels=False,
            cache=options.cache or True,
            progress=bars.report,
        )

    training = pairs(options.data)
    if not options.validate:
        return TrainingData(training=training)
    trained_on = {folder.resolve() for folder in options.data}
    if both := [str(folder) for folder in options.validate if folder.resolve() in trained_on]:
        raise ValueError(f"validate must be other folders than data, got {', '.join(both)} in both")
    return TrainingData(training=training, validation=pairs(options.validate))


def _report(bars: ProgressBars, steps: int, entry: dict[str, Any]) -> None:
    bars.report("steps", entry["step"], steps)
    if "validation" in entry:
        errors = entry["validation"]
        means = f"median {errors['median_m']:.3f} m, mean {errors['mean_m']:.3f} m"
        print(f"step {entry['step']}: validation: {means}", file=sys.stderr)


def _refuse(message: str, code: int) -> int:
    print(f"echoscape train: {message}", file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
