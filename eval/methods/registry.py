"""Extractors of keypoints by name. A further one is a module with a `KeypointExtractor` and an entry here."""

from collections.abc import Callable, Mapping

from echoscape.eval.methods.cen2018 import Cen2018
from echoscape.eval.methods.cen2019 import Cen2019
from echoscape.eval.methods.keypoints import KeypointExtractor

EXTRACTORS: Mapping[str, Callable[[], KeypointExtractor]] = {"cen2018": Cen2018, "cen2019": Cen2019}
"""Builds each extractor with its default settings."""
