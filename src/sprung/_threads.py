"""One thread and kept memory for the linear algebra of many small matrices: more threads would wait for each other."""

import ctypes
import os
from contextlib import ContextDecorator
from functools import cache
from importlib import import_module
from threading import Lock
from typing import Any


class _OneThread(ContextDecorator):
    """Context, or decorator of functions, in which BLAS uses one thread; the outermost one sets and restores.

    Memory that is freed stays with the process, up to 64 MiB: a fit makes and drops arrays of some 100 kB thousands of
    times, and getting their pages from the system anew takes a third of the processor time with 18 sensors.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        self._depth = 0
        self._limited: Any = None

    def __enter__(self) -> None:
        _keep_freed_memory()
        with self._lock:
            self._depth += 1
            if self._depth == 1 and os.environ.get("OPENBLAS_NUM_THREADS") != "1":
                self._limited = _libraries().limit(limits=1, user_api="blas")

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._depth -= 1
            if not self._depth and self._limited is not None:
                self._limited.restore_original_limits()
                self._limited = None


@cache
def _keep_freed_memory() -> None:
    """Let the allocator keep freed memory; only that of glibc can."""
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(-3, 2**25)  # the size of arrays up to which memory is not mapped anew
        mallopt(-1, 2**26)  # the size up to which freed memory is kept


@cache
def _libraries() -> Any:
    """Return the libraries of linear algebra of this process."""
    from threadpoolctl import ThreadpoolController

    import_module("scipy.linalg")  # has a BLAS of its own, which must be there to be found
    return ThreadpoolController()


one_thread = _OneThread()
