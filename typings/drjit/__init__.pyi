"""Dr.Jit as the checker sees it: all dynamic.

Its own stubs call the indices of `compress` an object, and take Mitsuba's arrays for unrelated types.
"""

from typing import Any

def __getattr__(name: str) -> Any: ...
