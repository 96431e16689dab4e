"""Signals that stop a service: cleanly if possible, and within a stated time in any case."""

import logging
import multiprocessing
import os
import signal
import threading

LOG = logging.getLogger("sprung")


def stop_on_signals(*, within: float | None = None) -> threading.Event:
    """Return an event that SIGINT and SIGTERM set.

    Parameters
    ----------
    within
        Longest time from the first signal to the end of the process [s], after which it ends with status 1, its child
        processes first; None: no limit.
    """
    stopping = threading.Event()

    def stop() -> None:
        if stopping.is_set():
            return
        stopping.set()
        if within is not None:
            timer = threading.Timer(within, _end, (within,))
            timer.daemon = True
            timer.start()

    for number in (signal.SIGINT, signal.SIGTERM):
        # In a thread: if this one holds the lock of the event when the signal comes, it would deadlock.
        signal.signal(number, lambda *_: threading.Thread(target=stop).start())
    return stopping


def _end(within: float) -> None:
    """End the process whatever its threads wait for: results are in the store, transaction by transaction."""
    LOG.error(f"no clean stop within {within:g} s, as the store or a disk does not answer: process ended")
    for child in multiprocessing.active_children():
        child.kill()
        child.join(1.0)
    os._exit(1)
