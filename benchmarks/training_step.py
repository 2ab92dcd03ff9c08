"""Seconds of a training step of one pair, forward, backward and Adam, of the plain and the fast model.

    python -m benchmarks.training_step [--sizes 160 320] [--threads 2] [--repeats 5]

Images are random numbers: the cost does not depend on them. Processor time says what a busy machine hides.
"""

import argparse
import statistics
import time
from collections.abc import Callable

import torch

from benchmarks.machine import description
from echoscape.learn.data.image_settings import ImageSettings
from echoscape.learn.geometry.se2 import to_motion
from echoscape.learn.model.fast_keypoint_model import Matching
from echoscape.learn.model.keypoint_model import KeypointModel, pose_loss
from echoscape.learn.model.model_settings import ModelSettings
from echoscape.learn.training.checkpoint import initial_model
from echoscape.sim.datasets.se2 import SE2
from echoscape.sim.numerics.malloc import keep_freed_memory

FORMS = {
    "plain, float32": (None, torch.float32),
    "fast, float32": (Matching(), torch.float32),
    "fast, every 2nd pixel": (Matching(stride=2), torch.float32),
    "fast, every 2nd pixel, bfloat16 network": (Matching(stride=2), torch.bfloat16),
    "fast, every 2nd pixel, all bfloat16": (Matching(stride=2, dtype=torch.bfloat16), torch.bfloat16),
}


def step_of(size: int, matching: Matching | None, network: torch.dtype) -> Callable[[], None]:
    """Return one step of training; without `matching` that of the plain `KeypointModel`."""
    settings = ModelSettings(image=ImageSettings(size=size))
    fast = initial_model(settings, seed=1)
    plain = KeypointModel(settings)
    plain.load_state_dict(fast.state_dict())
    model = (fast if matching else plain).train()
    optimiser = torch.optim.Adam(model.parameters(), 1e-3)
    source, destination = torch.rand(2, 1, 1, size, size)
    truth = to_motion([SE2(x_m=1.0, y_m=0.0, yaw_rad=0.1)])

    def step() -> None:
        optimiser.zero_grad()
        if matching:
            motion = fast(source, destination, matching, network).motion()
        else:
            motion, _ = plain(source, destination)
        pose_loss(motion, truth, alpha_m=10.0).mean().backward()
        optimiser.step()

    return step


def medians(step: Callable[[], None], repeats: int) -> tuple[float, float]:
    """Return the medians of seconds and of processor seconds over `repeats`, after one to warm up."""
    step()
    found = []
    for _ in range(repeats):
        begun, used = time.perf_counter(), time.process_time()
        step()
        found.append((time.perf_counter() - begun, time.process_time() - used))
    seconds, processor_seconds = zip(*found, strict=True)
    return statistics.median(seconds), statistics.median(processor_seconds)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--sizes", type=int, nargs="+", default=[160, 320])
    parser.add_argument("--threads", type=int, default=torch.get_num_threads())
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args()
    keep_freed_memory()
    torch.set_num_threads(options.threads)
    print(f"{description()}, torch {torch.__version__}, {options.threads} thread(s)")
    for size in options.sizes:
        for name, (matching, network) in FORMS.items():
            seconds, used = medians(step_of(size, matching, network), options.repeats)
            print(f"{size} px, {name}: {seconds:.3f} s ({used:.3f} s of processor time)", flush=True)


if __name__ == "__main__":
    main()
