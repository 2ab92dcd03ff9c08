import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from echoscape.scenes.core.scene import CLASSES, Mover, Scene, remove_instances
from echoscape.scenes.core.target_meshes import with_targets
from echoscape.scenes.core.targets import Target
from echoscape.sim.datasets.polar_scan import Component
from echoscape.sim.echoes import Echoes, point_echoes
from echoscape.sim.effects.echo_filter import EchoFilter, selection
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.sim.settings.tracing import TraceSettings
from echoscape.sim.simulator import Simulator
from tests.sim.worlds import box_prototype, mover, plate, quad, standing, straight, world

SETTINGS = TraceSettings(rays=128)
STEADY = replace(CTS350X, rotation_jitter_s=1e-9, encoder_first=0)
WALL, ROAD, POST, VAN = 1, 2, 3, 4
DIRECT_ONLY = EchoFilter(bounces=(1,))


@pytest.fixture(scope="module")
def street() -> Scene:
    ground = quad([[-80, -80, 0], [80, -80, 0], [80, 80, 0], [-80, 80, 0]])
    return with_targets(
        world(("metal", "wall", plate([25, 0, 5], [-1, 0], 60, 10)), ("asphalt", "road", ground)),
        [Target(kind="cylinder", position_m=(15.0, 6.0, 1.5), size_m=(0.1, 3.0))],
    )


@pytest.fixture(scope="module")
def movers() -> tuple[Mover, ...]:
    return (
        mover(VAN, box_prototype("van", (5.0, 2.0, 2.2), "metal", "van"), straight([14.0, -4.0], [0.0, 5.0])),
    )


def simulator(town: Scene, movers: tuple[Mover, ...], **artefacts: bool) -> Simulator:
    return Simulator(
        town, standing(), movers, seed=2, sensor=STEADY, settings=SETTINGS, artefacts=Artefacts(**artefacts)
    )


@pytest.fixture(scope="module")
def whole(street: Scene, movers: tuple[Mover, ...]) -> Simulator:
    return simulator(street, movers)


@pytest.fixture(scope="module")
def traced(whole: Simulator) -> Echoes:
    return whole.echoes(0)


def test_first_order_alone_is_the_scan_without_ghosts(
    street: Scene, movers: tuple[Mover, ...], whole: Simulator, traced: Echoes
) -> None:
    filtered = whole.scan(0, echoes=traced, only=DIRECT_ONLY)
    traced_so = simulator(street, movers, ghosts=False).scan(0)
    np.testing.assert_array_equal(filtered.codes, traced_so.codes)
    assert (filtered.codes != whole.scan(0, echoes=traced).codes).any()


@pytest.mark.parametrize(
    ("component", "switches"),
    [
        ("noise", ("thermal_noise",)),
        ("leakage", ("leakage",)),
        ("spoke", ("saturation", "phase_noise", "quantisation")),
        ("sidelobe", ("sidelobes",)),
    ],
)
def test_a_component_left_out_is_its_switch(
    component: str,
    switches: tuple[str, ...],
    street: Scene,
    movers: tuple[Mover, ...],
    whole: Simulator,
    traced: Echoes,
) -> None:
    filtered = whole.scan(0, echoes=traced, without=EchoFilter(components=(component,)))
    switched = simulator(street, movers, **{switch: False for switch in switches}).scan(0)
    np.testing.assert_array_equal(filtered.codes, switched.codes)


def test_echoes_of_another_scan_or_seed_are_refused(
    street: Scene, movers: tuple[Mover, ...], whole: Simulator, traced: Echoes
) -> None:
    with pytest.raises(ValueError, match=r"echoes must be of scan 1 and seed 2, got scan 0 and seed 2"):
        whole.scan(1, echoes=traced.select(traced.bounces == 1))
    other = Simulator(street, standing(), movers, seed=3, sensor=STEADY, settings=SETTINGS)
    with pytest.raises(ValueError, match=r"echoes must be of scan 0 and seed 3, got scan 0 and seed 2"):
        other.scan(0, echoes=traced)
    made = point_echoes(
        azimuth=np.array([5]), range_m=np.array([30.0]), amplitude=np.array([1e-5]), azimuths=400
    )
    placed = whole.scan(1, echoes=made)  # echoes that were not traced belong to no scan
    assert placed.codes[5].argmax() == pytest.approx(30.0 / STEADY.bin_m, abs=2)


def test_every_surface_of_a_path_counts(traced: Echoes, whole: Simulator) -> None:
    van = EchoFilter(instances=(VAN,)).matches(traced, whole.instance_class)
    last = EchoFilter(instances=(VAN,), last_only=True).matches(traced, whole.instance_class)
    assert last.any()
    assert (van & ~last).any()  # over the van to another object
    assert not (last & ~van).any()
    assert (traced.bounces[van & ~last] > 1).all()
    by_class = EchoFilter(classes=("van",)).matches(traced, whole.instance_class)
    np.testing.assert_array_equal(by_class, van)
    surfaces = traced.returns.surfaces[traced.source]
    np.testing.assert_array_equal(van, (surfaces == VAN).any(axis=1))
    met = (surfaces > 0).sum(axis=1)
    assert (met[traced.bounces == 1] == 1).all()
    assert (met[traced.bounces > 1] >= 2).all()
    np.testing.assert_array_equal(
        traced.instance, np.take_along_axis(surfaces, met[:, None] - 1, axis=1)[:, 0]
    )


def test_conditions_are_met_together_and_their_values_apart(traced: Echoes, whole: Simulator) -> None:
    classes = whole.instance_class

    def named(**conditions: Any) -> np.ndarray:
        return EchoFilter(**conditions).matches(traced, classes)

    both = named(instances=(VAN,), components=("ghost",))
    np.testing.assert_array_equal(both, named(instances=(VAN,)) & named(components=("ghost",)))
    assert both.any()
    either = named(bounces=(2, 3))
    np.testing.assert_array_equal(either, named(bounces=(2,)) | named(bounces=(3,)))


def test_only_and_without_part_the_echoes(traced: Echoes, whole: Simulator) -> None:
    ghosts = EchoFilter(components=(Component.GHOST,))
    silent = EchoFilter(components=("noise",))
    van = EchoFilter(classes=("van",), last_only=True)
    kept = whole.scan(0, echoes=traced, only=van, without=ghosts)
    assert kept.truth is not None
    assert set(np.unique(kept.truth.cells.class_id)) <= {0, CLASSES.index("van")}
    assert not (kept.truth.cells.component == Component.GHOST).any()
    nothing = whole.scan(0, echoes=traced, only=EchoFilter(classes=("bus",)), without=silent)
    assert nothing.truth is not None
    assert not np.isin(nothing.truth.cells.component, [Component.DIRECT, Component.GHOST]).any()


def test_displaced_echoes_are_left_out_or_kept_by_their_flag(whole: Simulator, traced: Echoes) -> None:
    chosen, others = (
        EchoFilter(displaced=flag).matches(traced, whole.instance_class) for flag in (True, False)
    )
    np.testing.assert_array_equal(chosen, traced.displaced)
    np.testing.assert_array_equal(others, ~chosen)
    assert 0 < chosen.sum() < (traced.bounces > 1).sum()  # ghosts, but not all paths of several bounces
    truth = whole.scan(0, echoes=traced, without=EchoFilter(displaced=True)).truth
    assert truth is not None
    assert truth.cells.displaced is not None
    assert not truth.cells.displaced.any()
    assert (truth.cells.component == Component.GHOST).any()


def test_removed_object_leaves_no_trace(street: Scene, movers: tuple[Mover, ...]) -> None:
    town, left = remove_instances(street, movers, {VAN})
    assert left == ()
    gone = simulator(town, left).echoes(0)
    assert not np.isin(gone.returns.surfaces, [VAN]).any()
    never = simulator(street, ()).echoes(0)
    np.testing.assert_array_equal(gone.amplitude, never.amplitude)
    # What it hid is there again, which a filter cannot know.
    wall_behind = (gone.instance == WALL).sum()
    filtered = simulator(street, movers).echoes(0)
    assert wall_behind > (filtered.instance == WALL).sum()


def test_static_things_and_targets_can_be_removed(street: Scene) -> None:
    town, _ = remove_instances(street, (), {WALL, POST})
    echoes = simulator(town, ()).echoes(0)
    assert set(np.unique(echoes.returns.surfaces)) <= {0, ROAD}
    assert town.targets == ()
    with pytest.raises(ValueError, match="instances must be of the scene or its movers, got 99"):
        remove_instances(street, (), {99})


@pytest.mark.parametrize(
    ("conditions", "message"),
    [
        ({}, "a filter needs"),
        ({"bounces": (0,)}, "bounces must be whole numbers of 1 or more, got 0"),
        ({"components": ("echo",)}, "components must be among"),
        ({"classes": ("tree house",)}, "classes must be among"),
        ({"instances": (0,)}, "instances must be whole numbers of 1 or more, got 0"),
        ({"components": ("noise",), "bounces": (1,)}, "are no echoes"),
        ({"classes": "van"}, "classes must be a tuple, got 'van'"),
        ({"classes": (3,)}, "classes must be among .*, got 3"),
        ({"components": "ghost"}, "components must be a tuple, got 'ghost'"),
        ({"components": Component.GHOST}, "components must be a tuple, got <Component.GHOST"),
        ({"components": (8,)}, "components must be among .*, got 8"),
        ({"components": (True,)}, "components must be among .*, got True"),
        ({"components": (3.0,)}, "components must be among .*, got 3.0"),
        ({"components": (Path("noise"),)}, "components must be among"),
        ({"components": (None,)}, "components must be among .*, got None"),
        ({"bounces": 1}, "bounces must be a tuple, got 1"),
        ({"bounces": (1.5,)}, "bounces must be whole numbers of 1 or more, got 1.5"),
        ({"bounces": (True,)}, "bounces must be whole numbers of 1 or more, got True"),
        ({"bounces": ("1",)}, "bounces must be whole numbers of 1 or more, got '1'"),
        ({"instances": (-3,)}, "instances must be whole numbers of 1 or more, got -3"),
        ({"instances": (math.nan,)}, "instances must be whole numbers of 1 or more, got nan"),
        ({"instances": "7"}, "instances must be a tuple, got '7'"),
        ({"displaced": 1}, "displaced must be True, False or None, got 1"),
        ({"displaced": True, "components": ("noise",)}, "are no echoes"),
        ({"bounces": (1,), "last_only": "yes"}, "last_only must be True or False, got 'yes'"),
    ],
)
def test_refuses_filters_that_name_nothing(conditions: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        EchoFilter(**conditions)


def test_lists_and_numbers_of_components_name_the_same() -> None:
    listed: Any = {"components": [3, "sidelobe"], "bounces": [np.int64(2)]}
    given = EchoFilter(**listed)
    assert given == EchoFilter(components=(Component.GHOST, "SIDELOBE"), bounces=(2,))
    assert hash(given) == hash(replace(given))
    assert given.component_set == {Component.GHOST, Component.SIDELOBE}


@pytest.mark.parametrize("wrong", ["van", ("van",), 3])
def test_what_is_no_filter_is_refused_by_name(wrong: Any) -> None:
    with pytest.raises(ValueError, match="only must be an EchoFilter"):
        selection(only=wrong)
    with pytest.raises(ValueError, match="without must be an EchoFilter or several"):
        selection(without=wrong)
