"""Ablations: the same bytes however interrupted and shared out, failures counted, other settings refused."""

import csv
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from echoscape.eval.ablation.study.report import write_ablation_report
from echoscape.eval.ablation.study.run import run_ablation
from echoscape.eval.ablation.study.settings import AblationStudy, ablation_drive
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.generation.config import SimulationConfig
from tests.eval.ablation.study.studies import small_study

LEVELS = ("ghosts=0,1", "blank_azimuths=1", "dropped_scans=0.5")
STUDY = small_study(*LEVELS, seeds=(1, 2), scans=3)
KEPT = small_study("ghosts=0", "dropped_scans=0.5", keep_scans=True)


def finished(out: Path, study: AblationStudy = STUDY, *, workers: int = 1) -> dict[str, bytes]:
    """Run an ablation and return its tables."""
    run_ablation(out, study, workers=workers)
    write_ablation_report(out, study)
    return {name: (out / name).read_bytes() for name in ("table.csv", "drives.csv", "table.md")}


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("ablation") / "res"
    finished(out)
    return out


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("kept") / "res"
    run_ablation(out, KEPT)
    return out


def contents(out: Path) -> dict[Path, bytes]:
    """Return all files of a folder by their path in it."""
    return {path.relative_to(out): path.read_bytes() for path in out.rglob("*") if path.is_file()}


def rows(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(path.read_text().splitlines()))


def test_scans_are_thrown_away_and_results_stay(done: Path) -> None:
    files = {path.name for path in done.iterdir()}
    tables = {"table.csv", "drives.csv", "table.md", "summary.png", "curves.png", "report.html"}
    assert files == {*tables, "ablation.json", "results"}
    assert len([*done.glob("results/*/*/fourier.json")]) == 2 * 4  # ghosts=1 is the default
    assert (done / "curves.png").read_bytes().startswith(b"\x89PNG")
    page = (done / "report.html").read_text()
    assert "ghosts off" in page
    assert "2 drives are too few for 95 %" in page
    assert "http" not in page


def test_differences_are_those_of_the_values_of_each_drive(done: Path) -> None:
    drives = rows(done / "drives.csv")
    for row in rows(done / "table.csv"):
        values, defaults = (
            np.array([float(each[row["metric"]]) for each in drives if each["condition"] == condition])
            for condition in (row["condition"], "default")
        )
        assert len(values) == int(row["drives"]) == 2
        differences = values - defaults
        assert_allclose(float(row["difference"]), differences.mean(), rtol=1e-6, atol=1e-7)
        assert_allclose(float(row["value"]), values.mean(), rtol=1e-6)
        assert_allclose(float(row["low"]), differences.min(), rtol=1e-6, atol=1e-7)
        assert_allclose(float(row["high"]), differences.max(), rtol=1e-6, atol=1e-7)


def test_a_strength_that_is_the_default_makes_no_difference(done: Path) -> None:
    same = [row for row in rows(done / "table.csv") if row["condition"] == "ghosts=1"]
    assert len(same) == 5  # no drive has segments of 100 m, so that drift is unknown
    assert {row[name] for row in same for name in ("difference", "low", "high")} == {"0"}
    assert {(row["artefact"], row["strength"]) for row in same} == {("ghosts", "1")}


def test_pairs_that_fail_are_counted_as_no_motion(done: Path) -> None:
    """Scans without any echo cannot be compared: the error of a pair is then its whole true motion."""
    drives = {(row["drive"], row["condition"]): row for row in rows(done / "drives.csv")}
    for name in ("yard_1", "yard_2"):
        blank, plain = drives[name, "blank_azimuths=1"], drives[name, "default"]
        assert (blank["pairs"], blank["failed"], float(blank["failed_pairs"])) == ("2", "2", 100.0)
        assert float(blank["translation_error_mean"]) > float(plain["translation_error_mean"])
    (row,) = (
        row
        for row in rows(done / "table.csv")
        if (row["condition"], row["metric"]) == ("blank_azimuths=1", "failed_pairs")
    )
    assert (row["pairs"], row["failed"], row["difference"]) == ("4", "4", "100")


@pytest.mark.parametrize("stage", ["worlds", "scans", "odometry"])
def test_an_interrupted_run_goes_on_to_the_same_bytes(stage: str, done: Path, tmp_path: Path) -> None:
    class Stop(Exception):
        """Stands for the end of the process: no code of the run handles it."""

    steps = {"worlds": 2, "scans": 4, "odometry": 3}

    def stopping(at: str, count: int, total: int) -> None:
        if at == stage and count == steps[stage]:
            raise Stop

    out = tmp_path / "res"
    with pytest.raises(Stop):
        run_ablation(out, STUDY, progress=stopping)
    (out / "results").mkdir(exist_ok=True)
    (out / "results" / ".half.json.1.part").write_text("{")
    counted: list[tuple[str, int, int]] = []
    run_ablation(out, STUDY, progress=lambda *step: counted.append(step))
    assert counted[-1] == ("odometry", 8, 8)
    assert ("scans", 6, 6) in counted
    write_ablation_report(out, STUDY)
    for name in ("table.csv", "drives.csv", "table.md"):
        assert (out / name).read_bytes() == (done / name).read_bytes()
    assert not [*out.rglob("*.part")]
    assert not (out / "scans").exists()


def test_workers_and_the_order_of_conditions_change_no_value(done: Path, tmp_path: Path) -> None:
    study = small_study(*reversed(LEVELS), seeds=(1, 2), scans=3)
    finished(tmp_path / "res", study, workers=2)
    for name in ("table.csv", "drives.csv"):
        assert sorted((tmp_path / "res" / name).read_text().splitlines()) == sorted(
            (done / name).read_text().splitlines()
        )


def test_a_finished_run_is_not_repeated(done: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*arguments: object) -> None:
        raise AssertionError("a world is built")

    monkeypatch.setattr("echoscape.eval.ablation.study.run.build_scene", refused)
    before = (done / "table.csv").read_bytes()
    assert finished(done)["table.csv"] == before


def test_a_damaged_result_is_made_again(done: Path, tmp_path: Path) -> None:
    out = tmp_path / "res"
    shutil.copytree(done, out)
    damaged = out / "results" / "yard_2" / "ghosts=0" / "fourier.json"
    damaged.write_bytes(damaged.read_bytes()[:50])
    counted: list[tuple[str, int, int]] = []
    run_ablation(out, STUDY, progress=lambda *step: counted.append(step))
    assert ("odometry", 7, 8) in counted  # the other results stay
    same = damaged.relative_to(out)
    assert damaged.read_bytes() == (done / same).read_bytes()
    assert not (out / "scans").exists()


@pytest.mark.parametrize("lost", ["", "dropped_scans=0.5", "default/radar", "ghosts=0/truth", "one image"])
def test_kept_scans_that_were_lost_are_simulated_again(lost: str, kept: Path, tmp_path: Path) -> None:
    out = tmp_path / "res"
    shutil.copytree(kept, out)
    drive = out / "scans" / "yard_1"
    if lost == "one image":
        next(iter((drive / "default").glob("radar/*.png"))).write_bytes(b"half")
    else:
        shutil.rmtree(drive / lost)
    run_ablation(out, KEPT)
    assert contents(out) == contents(kept)


def test_kept_scans_that_are_there_are_not_simulated_again(
    kept: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("echoscape.eval.ablation.study.run.build_scene", None)
    before = contents(kept)
    run_ablation(kept, KEPT)
    assert contents(kept) == before


def test_other_code_is_refused_by_its_digest(
    done: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "res"
    shutil.copytree(done, out)
    before = contents(out)
    asked: list[tuple[str, ...]] = []

    def other(packages: tuple[str, ...]) -> str:
        asked.append(packages)
        return "0ther"

    monkeypatch.setattr("echoscape.eval.ablation.study.settings.code_digest", other)
    with pytest.raises(DatasetError, match=r"by other code of echoscape \(code_sha256 \w+.*, now 0ther\)"):
        run_ablation(out, STUDY)
    assert asked == [("scenes", "sim", "learn", "eval")]
    with pytest.raises(DatasetError, match="scans was 3, now it is 4"):  # settings are named first
        run_ablation(out, small_study(*LEVELS, seeds=(1, 2), scans=4))
    assert contents(out) == before


def test_code_that_is_edited_meanwhile_is_continued_by_the_same_process_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = "echoscape.eval.ablation.study.settings"
    study = small_study("ghosts=0")
    monkeypatch.setattr(f"{settings}.code_digest", lambda _: None)
    run_ablation(tmp_path / "res", study)
    run_ablation(tmp_path / "res", study)
    monkeypatch.setattr(f"{settings}._UNKNOWN_CODE", "that of another process")
    with pytest.raises(DatasetError, match=r"code_sha256 unknown: edited while .*, now that of another"):
        run_ablation(tmp_path / "res", study)


@pytest.mark.parametrize(
    ("study", "message"),
    [
        (small_study(*LEVELS, seeds=(1, 2), scans=4), "scans was 3, now it is 4"),
        (small_study(*LEVELS, seeds=(1, 3), scans=3), "it lacks the world yard:3"),
        (small_study("ghosts=0", seeds=(1, 2), scans=3), "it also has the condition ghosts=1"),
        (
            small_study(*LEVELS, seeds=(1, 2), scans=3, keep_scans=True),
            "keep_scans was False, now it is True",
        ),
    ],
)
def test_other_settings_are_refused_by_name(done: Path, study: AblationStudy, message: str) -> None:
    before = {path: path.read_bytes() for path in done.rglob("*.*") if path.is_file()}
    with pytest.raises(DatasetError, match=f"OUT holds another ablation, .*: {message}"):
        run_ablation(done, study)
    assert {path: path.read_bytes() for path in done.rglob("*.*") if path.is_file()} == before


def test_folders_of_others_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "letter.txt").write_text("dear")
    with pytest.raises(DatasetError, match="OUT must be empty or new"):
        run_ablation(tmp_path, STUDY)
    (tmp_path / "ablation.json").write_text("[")
    with pytest.raises(DatasetError, match=r"ablation.json: cannot be read"):
        run_ablation(tmp_path, STUDY)
    assert {path.name for path in tmp_path.iterdir()} == {"letter.txt", "ablation.json"}


def test_kept_scans_are_data_sets_with_truth(kept: Path) -> None:
    from echoscape.sim.datasets.scan_folder import open_folder

    folder = open_folder(kept / "scans" / "yard_1" / "ghosts=0")
    truth = folder.truth(1)
    assert truth is not None
    assert not (truth.cells.component == 3).any()


@pytest.mark.parametrize("word", ["yard", "yard:", ":3", "yard:x", "yard:-1", "yard:1.5"])
def test_words_that_name_no_world_are_refused(word: str) -> None:
    with pytest.raises(ValueError, match=f"a world must be PRESET:SEED, .*, got '{word}'"):
        ablation_drive(word, SimulationConfig(scans=2))


@pytest.mark.slow
def test_a_killed_run_goes_on_to_the_same_bytes(done: Path, tmp_path: Path) -> None:
    out, words = tmp_path / "res", ["--worlds", "yard:1", "yard:2", "--scans", "3", "--radar", "cts_small"]
    words += ["--trace.rays", "16", "--methods", "fourier", "--workers", "2"]
    words += [each for level in LEVELS for each in ("--artefact", level)]
    command = [sys.executable, "-m", "echoscape.cli", "ablate", "--out", str(out), *words]
    for seconds in (6.0, 9.0):
        with subprocess.Popen(command, stderr=subprocess.DEVNULL) as process:
            time.sleep(seconds)
            process.send_signal(signal.SIGKILL)
    subprocess.run(command, check=True, capture_output=True, timeout=300)
    assert (out / "table.csv").read_bytes() == (done / "table.csv").read_bytes()
