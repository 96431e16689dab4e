"""BLAS uses one thread in fits and identifications, and as many as before after them; freed memory is kept."""

import ctypes
import subprocess
import sys
from threading import Thread

import numpy as np
import pytest
from threadpoolctl import ThreadpoolController, threadpool_limits

from sprung import _threads
from sprung._threads import one_thread
from sprung.identification import Identification, cov_ssi, steps
from sprung.simulation import simulate, usual_excitation
from sprung.vehicles import chain


def n_threads() -> set[int]:
    """Return the numbers of threads of the libraries of linear algebra."""
    return {library["num_threads"] for library in ThreadpoolController().select(user_api="blas").info()}


@pytest.fixture
def several(monkeypatch):
    """BLAS with two threads, in a process that does not limit them."""
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    with threadpool_limits(2, user_api="blas"):
        if n_threads() != {2}:
            pytest.skip("this BLAS has one thread")
        yield


def test_only_the_outermost_restores(several):
    with one_thread:
        with one_thread:
            assert n_threads() == {1}
        assert n_threads() == {1}
    assert n_threads() == {2}


def test_restored_after_errors(several):
    with pytest.raises(np.linalg.LinAlgError), one_thread:
        np.linalg.inv(np.zeros((2, 2)))
    assert n_threads() == {2}


def test_restored_by_the_last_of_several_threads(several):
    other = Thread(target=one_thread(lambda: None))
    with one_thread:
        other.start()
        other.join()
        assert n_threads() == {1}
    assert n_threads() == {2}


def test_a_limited_process_needs_no_search_for_libraries(monkeypatch):
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "1")
    monkeypatch.setattr(_threads, "_libraries", lambda: pytest.fail("libraries were searched for"))
    with one_thread:
        pass


def test_identification_uses_one_thread(several, monkeypatch):
    seen: list[set[int]] = []
    finished = steps.finished

    def watched(draft: steps.Draft) -> Identification:
        seen.append(n_threads())
        return finished(draft)

    monkeypatch.setattr(steps, "finished", watched)
    masses = chain()
    cov_ssi(simulate(masses, usual_excitation(masses), duration=60.0, sampling_rate=500.0, seed=1))
    assert (seen, n_threads()) == ([{1}], {2})


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "mallopt"), reason="the allocator is not that of glibc")
def test_memory_of_arrays_is_not_mapped_anew():
    """Two hundred times 8 MB are 400,000 pages, and were as many faults."""
    code = """
import resource, numpy as np
from sprung._threads import one_thread
with one_thread:
    total = 0.0
    for _ in range(200):
        total += sum(np.ones(500_000) for _ in range(2))[0]
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt)
"""
    outcome = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert int(outcome.stdout) < 40_000
