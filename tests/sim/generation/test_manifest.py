"""Manifests name the first entry in which they differ."""

from dataclasses import replace

from echoscape.scenes.core.targets import Target
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.manifest import difference, manifest, version_difference


def test_of_lists_the_first_entry_and_field_that_differ_are_named() -> None:
    near = Target(kind="sphere", position_m=(20.0, 1.0, 2.0), size_m=(0.3,))
    far = Target(kind="point", position_m=(60.0, 0.0, 2.0))
    moved = replace(far, position_m=(60.0, 0.5, 2.0))

    def found(before: tuple[Target, ...], after: tuple[Target, ...]) -> str | None:
        return difference(*(manifest(SimulationConfig(targets=each)) for each in (before, after)))

    assert found((near, far), (near, moved)) == "targets[1].position_m[1] was 0.0, now it is 0.5"
    assert found((near, far), (replace(near, kind="point", size_m=()), far)) == (
        "targets[0].kind was 'sphere', now it is 'point'"
    )
    assert found((near,), (near, far, moved)) == "targets had 1 entry, now it has 3"
    assert found((near, far), ()) == "targets had 2 entries, now it has 0"
    assert found((near, far), (near, far)) is None


def test_equal_manifests_do_not_differ_and_settings_are_named() -> None:
    config = SimulationConfig(preset="empty")
    assert difference(manifest(config), manifest(config)) is None
    assert difference(manifest(config), manifest(replace(config, seed=4))) == "seed was 0, now it is 4"


def test_another_version_of_a_package_is_named() -> None:
    content = manifest(SimulationConfig())
    assert version_difference(content) is None
    content["versions"]["numpy"] = "0.1"
    found = version_difference(content)
    assert found is not None
    assert found.startswith("numpy was '0.1', now it is '")
    assert version_difference({}) is not None
