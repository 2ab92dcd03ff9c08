"""What reports progress has one type, defined once, where every layer may import it."""

from tests.layering import sources_of
from tests.paths import ROOT


def test_the_type_of_progress_is_defined_once() -> None:
    kind = "Callable[[str, int, int], None]"
    assert [name for name, text in sources_of(ROOT).items() if kind in text] == ["scenes.core.progress"]
