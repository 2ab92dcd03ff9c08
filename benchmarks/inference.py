"""Seconds of a trained model's work: a scan's image, its features, and the motion of a pair.

    python -m benchmarks.inference [--sizes 320 640] [--threads 2] [--repeats 5] [--data FOLDER]

A pair by itself costs a scan's features and a global search; of random numbers, with random weights. A scan
of a drive costs two local searches, and every few scans the features of a new keyframe: with a folder its
first 32 scans are followed with the bundled weights as well.
"""

import argparse
import time
from pathlib import Path

import numpy as np
import torch

from benchmarks.machine import description
from benchmarks.training_step import medians
from echoscape.eval.odometry.learned import learned_odometry
from echoscape.learn.data.image import Projector, range_cells
from echoscape.learn.data.image_settings import ImageSettings
from echoscape.learn.model.keypoint_model import KeypointModel
from echoscape.learn.model.model_settings import ModelSettings
from echoscape.learn.model.weights import shipped_weights
from echoscape.learn.odometry.scan_matcher import MatcherConfig, ScanMatcher, fast_config
from echoscape.learn.training.checkpoint import initial_model
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.datasets.scan_folder import open_folder
from echoscape.sim.numerics.malloc import keep_freed_memory
from echoscape.sim.sensor.cts350x import CTS350X


def _scan(codes: np.ndarray, bin_m: float) -> PolarScan:
    azimuths = len(codes)
    return PolarScan(
        codes=codes,
        timestamp_us=np.arange(azimuths, dtype=np.int64),
        encoder=np.arange(azimuths, dtype=np.uint16),
        valid=np.ones(azimuths, bool),
        bin_m=bin_m,
    )


def measure(label: str, size: int, config: MatcherConfig, repeats: int) -> None:
    """Print what each part takes at one size."""
    image = ImageSettings(size=size, pixel_m=0.6912 * 320 / size)
    matcher = ScanMatcher(initial_model(ModelSettings(image=image), seed=1), config)
    shape = (CTS350X.azimuths, CTS350X.bins)
    codes, bin_m = np.random.default_rng(1).integers(0, 120, shape, np.uint8), CTS350X.bin_m
    scan, projector = _scan(codes, bin_m), Projector(image, len(codes))
    features = matcher.features(scan)
    parts = {
        "image": lambda: projector.image(range_cells(codes, bin_m, image), first_rad=0.0),
        "image and features": lambda: matcher.features(scan),
        "pair": lambda: matcher.estimate(features, features),
    }
    found = {name: medians(part, repeats) for name, part in parts.items()}
    for name, (seconds, used) in found.items():
        print(f"{label}, {name}: {seconds:.3f} s ({used:.3f} s of processor time)", flush=True)
    rate = 1 / (found["image and features"][0] + found["pair"][0])
    print(f"{label}, pairs a second, each by itself: {rate:.1f}", flush=True)


@torch.inference_mode()
def measure_plain(size: int, repeats: int) -> None:
    """Print what the plain form takes for a pair: `KeypointModel`, both images through the network."""
    image = ImageSettings(size=size, pixel_m=0.6912 * 320 / size)
    settings = ModelSettings(image=image)
    model = KeypointModel(settings).eval()
    model.load_state_dict(initial_model(settings, seed=1).state_dict())
    source, destination = torch.rand(2, 1, 1, size, size)
    seconds, used = medians(lambda: model(source, destination), repeats)
    print(f"{size} px, plain, a pair: {seconds:.3f} s ({used:.3f} s of processor time)")


def measure_drive(folder: Path) -> None:
    """Print pairs a second over a folder's first scans, keyframes included."""
    scans = open_folder(folder)
    doppler_s = -float(scans.sensor.doppler_shift_s.mean())
    seen = [scans.read(index) for index in range(min(len(scans), 32))]
    for pixel_m, weights in shipped_weights().items():
        odometry = learned_odometry(weights, doppler_beta_s=doppler_s)
        state = odometry.start(seen[0])
        _, state = odometry.follow(state, seen[1])  # pays for the start
        begun = time.perf_counter()
        for scan in seen[2:]:
            _, state = odometry.follow(state, scan)
        rate = (len(seen) - 2) / (time.perf_counter() - begun)
        print(f"{pixel_m} m, {folder.name}, pairs a second, followed: {rate:.1f}", flush=True)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--sizes", type=int, nargs="+", default=[320, 640])
    parser.add_argument("--threads", type=int, default=torch.get_num_threads())
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--data", type=Path, help="a folder of 3 scans or more")
    options = parser.parse_args()
    keep_freed_memory()
    torch.set_num_threads(options.threads)
    print(f"{description()}, torch {torch.__version__}, {options.threads} thread(s)")
    for size in options.sizes:
        for name, config in {
            "every pixel, float32": MatcherConfig(),
            "as odometry has it": fast_config(torch.device("cpu")),
        }.items():
            measure(f"{size} px, {name}", size, config, options.repeats)
        measure_plain(size, options.repeats)
    if options.data is not None:
        measure_drive(options.data)


if __name__ == "__main__":
    main()
