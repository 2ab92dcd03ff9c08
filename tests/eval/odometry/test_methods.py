"""Methods are found by their names, and built as `echoscape odometry` builds them."""

import hashlib
from pathlib import Path

import pytest

from echoscape.eval.odometry.fourier_mellin import FourierOdometry
from echoscape.eval.odometry.keypoint_odometry import KeypointOdometry
from echoscape.eval.odometry.methods import METHODS, build_method, method_choice
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.sensor.cts350x import CTS350X


def test_every_name_is_a_method_of_its_own() -> None:
    choices = [method_choice(name) for name in METHODS]
    assert [each.name for each in choices] == list(METHODS)
    assert len(set(choices)) == len(METHODS)
    assert [each.name for each in choices if not each.learned] == ["fourier", "cen2018", "cen2019"]


@pytest.mark.parametrize(
    "name", ["surf", "learned-fast", "learned:", "learned-fine:x.safetensors", "Fourier", ""]
)
def test_other_names_are_refused(name: str) -> None:
    with pytest.raises(
        ValueError, match=rf"a method must be one of fourier, cen2018, cen2019, learned, .*, got {name!r}"
    ):
        method_choice(name)


def test_phase_correlation_is_built_without_weights() -> None:
    choice = method_choice("fourier")
    method = build_method(choice, CTS350X, range_offset_m=0.5)
    assert isinstance(method, FourierOdometry)
    assert method.range_offset_m == 0.5
    assert choice.weights_sha256() is None


@pytest.mark.parametrize("name", ["cen2018", "cen2019"])
def test_hand_made_keypoints_are_built_without_weights(name: str) -> None:
    choice = method_choice(name)
    method = build_method(choice, CTS350X, range_offset_m=0.5)
    assert isinstance(method, KeypointOdometry)
    assert (method.name, method.matcher.range_offset_m) == (name, 0.5)
    assert choice.weights_sha256() is None


def test_learned_methods_take_the_weights_and_the_solver_of_their_name() -> None:
    pytest.importorskip("torch")
    from echoscape.learn.model.weights import shipped_weights

    by_width = shipped_weights()
    assert method_choice("learned").weights_file == by_width[max(by_width)]
    assert method_choice("learned-fine-paper").weights_file == by_width[min(by_width)]
    names = [build_method(method_choice(f"learned{end}"), CTS350X).name for end in ("", "-robust", "-paper")]
    assert names == ["learned", "learned, robust", "learned, paper"]


def test_weights_come_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "mine.safetensors"
    path.write_bytes(b"weights")
    choice = method_choice(f"learned-robust:{path}")
    assert (choice.name, choice.solver, choice.weights_file) == ("learned-robust:mine", "robust", path)
    assert choice.weights_sha256() == hashlib.sha256(b"weights").hexdigest()
    with pytest.raises(DatasetError, match=r"none.safetensors: cannot be read \(No such file"):
        method_choice(f"learned:{tmp_path}/none.safetensors").weights_sha256()
