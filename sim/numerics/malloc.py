"""Makes the C library keep freed memory: every scan frees and takes the same hundred megabytes.

Where the C library returns large blocks to the system immediately, each scan pays for fresh pages again; on
some machines that costs a tenth of its time. Results do not depend on it.
"""

import ctypes
import sys

# Parameters of mallopt(3), glibc.
_TRIM_THRESHOLD, _TOP_PAD, _MMAP_MAX = -1, -2, -4
_TOP_PAD_BYTES = 256 << 20


def keep_freed_memory() -> bool:
    """Ask the C library to keep freed memory.

    Returns:
        Whether it supports that, as glibc on Linux does.
    """
    if not sys.platform.startswith("linux"):
        return False
    library = ctypes.CDLL(None)
    if not hasattr(library, "mallopt"):
        return False
    settings = ((_MMAP_MAX, 0), (_TRIM_THRESHOLD, 2**31 - 1), (_TOP_PAD, _TOP_PAD_BYTES))
    return all([library.mallopt(parameter, value) for parameter, value in settings])
