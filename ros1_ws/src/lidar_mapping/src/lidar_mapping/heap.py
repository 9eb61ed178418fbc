"""Give memory back: large arrays of a sweep lie between what is kept, and where they are freed the heap would keep their places."""

from __future__ import annotations

import ctypes

LARGE_BYTES = 1 << 20
FREE_BYTES = 1 << 23
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3  # malloc.h


def give_back() -> bool:
    """Give arrays of `LARGE_BYTES` and more back when they are freed, and `FREE_BYTES` and more that are free at the heap's end.

    By itself glibc raises the first bound to 32 MiB as such arrays are freed, and the second to twice that. Return whether the bounds were
    taken: False where the C library has none.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    return mallopt is not None and bool(mallopt(_M_MMAP_THRESHOLD, LARGE_BYTES) and mallopt(_M_TRIM_THRESHOLD, FREE_BYTES))
