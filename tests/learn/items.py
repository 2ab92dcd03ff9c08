"""Items of data sets, and batches of them, compared and stacked by hand."""

from typing import Any

import torch


def assert_same_items(first: Any, second: Any) -> None:
    """Compare items, or batches of them, to the bit."""
    assert type(first) is type(second)
    if isinstance(first, dict):
        assert list(first) == list(second)
        for name in first:
            assert_same_items(first[name], second[name])
    else:
        assert first.dtype == second.dtype
        assert torch.equal(first, second)


def stacked(items: list[Any]) -> Any:
    """Stack items by hand."""
    if isinstance(items[0], dict):
        return {name: stacked([item[name] for item in items]) for name in items[0]}
    return torch.stack(items)
