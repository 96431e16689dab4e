"""Services stop cleanly on a signal, and within a stated time whatever hangs."""

import os
import signal
import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(os.name != "posix", reason="needs signals of POSIX")

HANGING = """
import multiprocessing, threading, time
from sprung.cli.output import log_to
from sprung.cli.output import stop_on_signals

if __name__ == "__main__":
    log_to("text")
    child = multiprocessing.get_context("fork").Process(target=time.sleep, args=(1000,), daemon=True)
    child.start()
    stopping = stop_on_signals(within={within})
    print(child.pid, flush=True)
    stopping.wait() if {is_valid} else threading.Event().wait()
    child.kill()
"""


def ended(within, *, is_valid):
    """Status, log and child of a service that got SIGTERM twice."""
    code = HANGING.format(within=within, is_valid=is_valid)
    with subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        child = int(process.stdout.readline())
        for _ in range(2):
            process.send_signal(signal.SIGTERM)
        _, log = process.communicate(timeout=60)
        return process.returncode, log, child


def test_a_service_that_hangs_ends_with_its_children() -> None:
    status, log, child = ended(0.2, is_valid=False)
    assert status == 1
    assert "no clean stop within 0.2 s, as the store or a disk does not answer: process ended" in log
    with pytest.raises(ProcessLookupError):
        os.kill(child, 0)


def test_a_service_that_stops_is_left_alone() -> None:
    status, log, _ = ended(60.0, is_valid=True)
    assert (status, log) == (0, "")
