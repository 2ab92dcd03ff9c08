"""What a scan owes to the draw of its rays: two scans that differ in the draw of directions alone.

    python -m benchmarks.draws [--presets town suburb industrial motorway] [--draws 0 1] [--scan 1]

World, speckle and receiver are the same in both scans (`--trace.draw` of `echoscape simulate`), and all
effects are on. A value is that between two draws, each as far from the mean of many as the other: the error
of one scan is smaller by the root of 2.
"""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.machine import description
from echoscape.eval.fidelity.scan_statistics import far_medians, spoke_azimuths
from echoscape.scenes.town.presets import PRESETS
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.setup import add_traffic, build_scene
from echoscape.sim.settings.tracing import TraceSettings
from echoscape.sim.simulator import Simulator

RANGES_M = ((10, 20), (20, 40), (40, 80), (80, 160))
AZIMUTHS = 5
"""Azimuths of a cell of the averaged maps, which is 1 m deep."""
LEAST_DB = 6.0
"""Level above the unit of power from which averaged power counts in one of the scans [dB]."""
STRONG_DB = 30.0
"""The same for single cells [dB]."""
_FLOOR = 1e-3


@dataclass(frozen=True, kw_only=True)
class DrawStatistics:
    """How two scans differ, by ranges (R,) float64.

    Attributes:
        power_db: Root mean square difference of averaged power [dB].
        cells_db: The same of single strong cells [dB].
        correlation: Correlation of the averaged maps in dB.
        mean_db: Difference of the mean power [dB].
        spokes: Number of spoke azimuths of either scan, and of both.
    """

    power_db: NDArray[np.float64]
    cells_db: NDArray[np.float64]
    correlation: NDArray[np.float64]
    mean_db: NDArray[np.float64]
    spokes: tuple[int, int, int]

    @property
    def spokes_in_common(self) -> float:
        """Share of the spokes of the scan with fewer that the other one has as well, 1 without any."""
        fewer = min(self.spokes[:2])
        return self.spokes[2] / fewer if fewer else 1.0


def averaged(power: NDArray[np.float64], *, bin_m: float) -> NDArray[np.float64]:
    """Return power averaged over cells of five azimuths and 1 m.

    Args:
        power: Power of the cells of a scan (azimuths, bins).
        bin_m: Length of a range bin [m].

    Returns:
        Means (azimuths // 5, whole metres).
    """
    azimuths, deep = len(power) // AZIMUTHS, round(1 / bin_m)
    metres = power.shape[1] // deep
    whole = power[: azimuths * AZIMUTHS, : metres * deep]
    return whole.reshape(azimuths, AZIMUTHS, metres, deep).mean(axis=(1, 3))


def difference(
    first: NDArray[np.uint8],
    second: NDArray[np.uint8],
    *,
    bin_m: float,
    ranges_m: Sequence[tuple[float, float]] = RANGES_M,
) -> DrawStatistics:
    """Compare two scans.

    Args:
        first: Codes of a scan (azimuths, bins), half decibels.
        second: Codes of the other.
        bin_m: Length of a range bin [m].
        ranges_m: Ranges from and to [m].

    Returns:
        How they differ.
    """
    codes = np.stack([first, second]).astype(np.float64)
    power = 10 ** (codes / 20) * (codes > 0)
    maps = _decibels(np.stack([averaged(each, bin_m=bin_m) for each in power]))
    deep = round(1 / bin_m) * bin_m
    rows: list[tuple[float, float, float, float]] = []
    for low_m, high_m in ranges_m:
        blocks, bins = (
            slice(int(np.ceil(low_m / step - 0.5)), int(np.ceil(high_m / step - 0.5)))
            for step in (deep, bin_m)
        )
        near, cells, mean = (
            maps[:, :, blocks],
            codes[:, :, bins] / 2,
            _decibels(power[:, :, bins].mean((1, 2))),
        )
        rows.append(
            (
                _rms(near, LEAST_DB),
                _rms(cells, STRONG_DB),
                float(np.corrcoef(near[0].ravel(), near[1].ravel())[0, 1]),
                float(mean[0] - mean[1]),
            )
        )
    power_db, cells_db, correlation, mean_db = np.array(rows).T
    range_m = (np.arange(codes.shape[2]) + 0.5) * bin_m
    spokes = spoke_azimuths(np.stack([far_medians(each, range_m) for each in (first, second)]))
    counts = (int(spokes[0].sum()), int(spokes[1].sum()), int(spokes.all(axis=0).sum()))
    return DrawStatistics(
        power_db=power_db, cells_db=cells_db, correlation=correlation, mean_db=mean_db, spokes=counts
    )


def _decibels(power: NDArray[np.float64]) -> NDArray[np.float64]:
    return 10 * np.log10(np.maximum(power, _FLOOR))


def _rms(levels_db: NDArray[np.float64], least_db: float) -> float:
    """Return the root mean square difference of two maps (2, A, R) where one is above a level [dB]."""
    first, second = levels_db[:, levels_db.max(axis=0) > least_db]
    return float(np.sqrt(np.mean(np.square(first - second)))) if len(first) else 0.0


def drawn_codes(
    simulator: Callable[[TraceSettings], Simulator],
    *,
    scan: int,
    draws: Sequence[int],
    rays: int = TraceSettings.rays,
) -> list[NDArray[np.uint8]]:
    """Simulate a scan with several draws of ray directions.

    Args:
        simulator: Makes the simulator with given settings of rays.
        scan: Number of the scan.
        draws: Numbers of the draws.
        rays: Rays an azimuth.

    Returns:
        Codes (azimuths, bins) of each.
    """
    found: list[NDArray[np.uint8]] = []
    for draw in draws:
        made = simulator(TraceSettings(rays=rays, draw=draw))
        found.append(made.scans(scan, [made.artefacts], truth=False)[0].codes)
    return found


def preset_difference(
    preset: str,
    *,
    seed: int = 11,
    scan: int = 1,
    draws: Sequence[int] = (0, 1),
    rays: int = TraceSettings.rays,
) -> DrawStatistics:
    """Compare two draws of a scan of a preset, with its traffic and all effects.

    Args:
        preset: Name of the preset.
        seed: Seed of town, drive, traffic and simulation.
        scan: Number of the scan.
        draws: Numbers of the two draws.
        rays: Rays an azimuth.

    Returns:
        How the scans differ.
    """
    config = SimulationConfig(preset=preset, seed=seed, scans=scan + 1)
    setup = add_traffic(build_scene(config), config)
    first, second = drawn_codes(
        lambda settings: Simulator(setup.scene, setup.drive, setup.movers, seed=seed, settings=settings),
        scan=scan,
        draws=draws,
        rays=rays,
    )
    return difference(first, second, bin_m=config.sensor.bin_m)


def table_row(preset: str, found: DrawStatistics) -> str:
    """Return a row of the table.

    Args:
        preset: Name of the preset.
        found: How its scans differ.

    Returns:
        The row in Markdown.
    """
    columns = [
        " ".join(f"{value:.{digits}f}" for value in values)
        for values, digits in (
            (found.power_db, 1),
            (found.correlation, 3),
            (found.cells_db, 1),
            (found.mean_db, 2),
        )
    ]
    columns.append(f"{found.spokes[2]} of {found.spokes[0]} and {found.spokes[1]}")
    return f"| {preset} | {' | '.join(columns)} |"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    presets = ("town", "suburb", "industrial", "motorway")
    parser.add_argument("--presets", nargs="+", choices=list(PRESETS), default=presets)
    parser.add_argument("--seed", type=int, default=11)
    parser.add_argument("--scan", type=int, default=1)
    parser.add_argument("--draws", type=int, nargs=2, default=[0, 1])
    parser.add_argument("--rays", type=int, default=TraceSettings.rays)
    options = parser.parse_args()
    print(description())
    ranges = ", ".join(f"{low}-{high}" for low, high in RANGES_M)
    print(f"Each figure at {ranges} m.")
    print("| preset | power, rms [dB] | correlation | cells, rms [dB] | mean power [dB] | spokes in common |")
    print("|---|---|---|---|---|---|")
    for preset in options.presets:
        found = preset_difference(
            preset, seed=options.seed, scan=options.scan, draws=options.draws, rays=options.rays
        )
        print(table_row(preset, found), flush=True)


if __name__ == "__main__":
    main()
