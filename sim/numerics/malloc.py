"""Keeps freed memory in the process: scans free and take the same hundred megabytes over and over.

Where the C library gives large blocks back to the system at once, each scan pays for fresh pages again; on
some machines that costs a tenth of its time. Results do not depend on it.
"""

import ctypes
import sys

# Parameters of mallopt(3), glibc.
_TRIM_THRESHOLD, _TOP_PAD, _MMAP_MAX = -1, -2, -4
_TOP_PAD_BYTES = 256 << 20


def keep_freed_memory() -> bool:
    """Ask the C library to keep what is freed; return whether it could be asked (glibc on Linux)."""
    if not sys.platform.startswith("linux"):
        return False
    library = ctypes.CDLL(None)
    if not hasattr(library, "mallopt"):
        return False
    settings = ((_MMAP_MAX, 0), (_TRIM_THRESHOLD, 2**31 - 1), (_TOP_PAD, _TOP_PAD_BYTES))
    return all([library.mallopt(parameter, value) for parameter, value in settings])
