"""Settings of models are checked."""

import pytest

from echoscape.learn.model.model_settings import ModelSettings


@pytest.mark.parametrize(
    ("wrong", "name"),
    [({"cells": 1}, "cells"), ({"cells": 400}, "cells"), ({"temperature": 0.0}, "temperature")],
)
def test_settings_out_of_their_range_are_refused(wrong: dict, name: str) -> None:
    with pytest.raises(ValueError, match=f"{name} must"):
        ModelSettings(**wrong)
