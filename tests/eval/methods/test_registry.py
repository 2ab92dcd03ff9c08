"""Extractors are found by their own names."""

from echoscape.eval.methods.registry import EXTRACTORS


def test_names_are_those_of_the_extractors() -> None:
    assert {name: build().name for name, build in EXTRACTORS.items()} == {name: name for name in EXTRACTORS}
