"""Scans have the same bytes whichever vector instructions the processor offers."""

import os
import platform
import subprocess
import sys
from pathlib import Path

import pytest

from tests.paths import ROOT

# Dr.Jit has no Python call for the target; its C++ function is exported under its mangled name.
MAKE_SCAN = """
import ctypes, dataclasses, hashlib, pathlib, sys
import numpy as np
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
cpu, width = sys.argv[1], int(sys.argv[2])
if cpu != "native":
    import drjit
    core = ctypes.CDLL(str(pathlib.Path(drjit.__file__).parent / "libdrjit-core.so"))
    set_target = core["_Z19jit_llvm_set_targetPKcS0_j"]
    set_target.argtypes = [ctypes.c_char_p, ctypes.c_char_p, ctypes.c_uint32]
    set_target(cpu.encode(), None, width)
from echoscape.sim.simulator import Simulator
from tests.sim.worlds import box_prototype, mover, plate, quad, straight, world
town = world(
    ("metal", "wall", plate([30.0, 0, 5.0], [-1, 0.1], 120.0, 10.0)),
    ("brick", "wall", plate([-9.0, 14, 5.0], [0.2, -1], 80.0, 10.0)),
    ("asphalt", "road", quad([[-80.0, -80, 0], [80, -80, 0], [80, 80, 0], [-80, 80, 0]])),
    *[("metal", "fence", plate([-20.0, y, 1.2], [1, -y / 20], 0.05, 2.0)) for y in range(-9, 9)],
)
car = mover(22, box_prototype("box", (4.0, 2.0, 1.5), "metal"), straight([12.0, -4.0], [-5.0, 1.0]))
scan = Simulator(town, straight([0.0, 0.0], [9.0, 1.0]), (car,), seed=5).scan(3, keep_beat=True)
def arrays(name, value):
    if dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            yield from arrays(name + "." + field.name, getattr(value, field.name))
    elif isinstance(value, dict):
        for key, each in value.items():
            yield from arrays(f"{name}.{key}", each)
    elif isinstance(value, (tuple, list)):
        for number, each in enumerate(value):
            yield from arrays(f"{name}.{number}", each)
    elif value is not None:
        yield name, np.asarray(value)
assert len(scan.truth.boxes.instance) == 1 and scan.truth.cells.displaced.any()
made = {"scan": scan}
from echoscape.scenes.driving.ego_drive import plan_ego_drive
from echoscape.scenes.town.build import build_town
from echoscape.scenes.traffic.plan import plan_traffic
from echoscape.sim.settings.artefacts import Artefacts
for preset in ("open", "yard"):
    town = build_town(preset, seed=3)
    drive = plan_ego_drive(town, seed=3, duration_s=30.0)
    movers = plan_traffic(town, drive, seed=3)
    artefacts = Artefacts(rain=10, interference=10)
    scan = Simulator(town, drive, movers, seed=3, artefacts=artefacts).scan(2)
    made[preset] = {"town": town, "drive": drive, "movers": movers, "scan": scan}
for part, value in made.items():
    for name, array in arrays(part, value):
        print(name, hashlib.sha256(array.tobytes()).hexdigest())
"""


def digests(cpu: str, width: int, **environment: str) -> dict[str, str]:
    """Hash of every array of worlds, drives, moving objects, scans and truth, by name."""
    done = subprocess.run(
        [sys.executable, "-c", MAKE_SCAN, cpu, str(width)],
        capture_output=True,
        text=True,
        cwd=ROOT,
        env=os.environ | environment,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return dict(line.rsplit(maxsplit=1) for line in done.stdout.splitlines())


@pytest.mark.skipif(platform.machine() != "x86_64", reason="sets x86-64 targets")
def test_avx2_and_the_native_target_make_the_same_bytes() -> None:
    flags = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").exists() else ""
    if " avx2 " not in flags or " fma " not in flags:
        pytest.skip("needs a processor with AVX2 and FMA")
    native = digests("native", 0)
    assert {"scan.codes", "scan.truth.cells.displaced", "scan.truth.first_obstacle_m"} < set(native)
    assert {"scan.truth.boxes.centre", "scan.truth.boxes.row_centre", "scan.truth.attitude"} < set(native)
    # NumPy's names for its AVX-512 code; what a build does not know it only warns about.
    narrow = digests(
        "skylake",
        8,
        NPY_DISABLE_CPU_FEATURES="X86_V4 AVX512_ICL AVX512_SPR",
        OPENBLAS_CORETYPE="Haswell",
        PYTHONWARNINGS="ignore",
    )
    assert native == narrow
