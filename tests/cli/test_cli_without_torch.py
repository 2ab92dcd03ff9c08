"""Without PyTorch all commands work; only training and learned odometry ask for it, in one line."""

import subprocess
import sys
from pathlib import Path

import pytest

_WITHOUT_TORCH = """
import importlib.machinery, sys

class Finder(importlib.machinery.PathFinder):
    @classmethod
    def find_spec(cls, name, *arguments):
        return None if name.partition(".")[0] == "torch" else super().find_spec(name, *arguments)

sys.meta_path[sys.meta_path.index(importlib.machinery.PathFinder)] = Finder
from echoscape.cli.__main__ import main
code = main(sys.argv[1:])
assert "torch" not in sys.modules
sys.exit(code)
"""
"""Runs a command in a process that finds no PyTorch, as one in which it is not installed."""

YARD = ["--worlds", "yard:1", "--scans", "2", "--radar", "cts_small", "--artefact", "ghosts=0"]


def run(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", _WITHOUT_TORCH, *words],
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("data") / "set"
    words = ["--preset", "empty", "--seed", "3", "--scans", "2", "--trace.rays", "16", "--radar", "cir304"]
    done = run("simulate", str(out), *words)
    assert done.returncode == 0, done.stderr
    assert (out / "preview.png").is_file()
    return out


@pytest.mark.parametrize(
    ("words", "file"),
    [
        (["scene", "{out}", "--preset", "empty", "--scans", "2"], "{out}/plan.png"),
        (["view", "{data}", "--out", "{out}.html"], "{out}.html"),
        (["fidelity", "{data}", "--out", "{out}"], "{out}/fidelity.json"),
        (["odometry", "{data}", "--out", "{out}", "--method", "fourier"], "{out}/metrics.json"),
        (
            ["detections", "{data}", "--out", "{out}", "--methods", "cfar,kstrongest,cen2018,cen2019"],
            "{out}/detections.json",
        ),
        (
            ["artefacts", "{out}", "--preset", "empty", "--scans", "2", "--only", "leakage"],
            "{out}/leakage.png",
        ),
        (["ablate", "--out", "{out}", *YARD, "--methods", "fourier"], "{out}/report.html"),
    ],
)
def test_a_command_works(words: list[str], file: str, dataset: Path, tmp_path: Path) -> None:
    done = run(*[word.format(data=dataset, out=tmp_path / "out") for word in words])
    assert done.returncode == 0, done.stderr
    assert Path(file.format(out=tmp_path / "out")).is_file()


def test_drift_works(tmp_path: Path) -> None:
    path = tmp_path / "trajectory.txt"
    path.write_text("1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 1 0 1 0 0 0 0 1 0\n")
    done = run("drift", "--estimate", str(path), "--truth", str(path), "--json")
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("command", ["odometry", "train"])
def test_help_works(command: str) -> None:
    done = run(command, "--help")
    assert done.returncode == 0, done.stderr
    assert "--device" in done.stdout


@pytest.mark.parametrize(
    "words",
    [
        ["odometry", "{data}", "--out", "{out}"],
        ["train", "--data", "{data}", "--out", "{out}"],
        ["detections", "{data}", "--out", "{out}", "--methods", "cfar,learned"],
        ["ablate", "--out", "{out}", *YARD],
    ],
    ids=["odometry", "train", "detections", "ablate"],
)
def test_what_needs_it_says_in_one_line_how_to_get_it(
    words: list[str], dataset: Path, tmp_path: Path
) -> None:
    done = run(*[word.format(data=dataset, out=tmp_path / "out") for word in words])
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"echoscape {words[0]}: ")
    assert line.endswith('needs PyTorch: pip install "echoscape[learn]"')
    assert not (tmp_path / "out").exists()
