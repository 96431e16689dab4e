"""BLAS uses one thread in fits and identifications, and as many as before after them; freed memory is kept."""

import ctypes
import subprocess
import sys
from threading import Thread

import numpy as np
import pytest
from threadpoolctl import ThreadpoolController, threadpool_limits

from sprung import _threads, bounce, bounce_tests
from sprung._threads import one_thread
from sprung.diagnosis import Observation, changes, diagnose, learn, learning
from sprung.identification import cov_ssi, free_response, steps, transients
from sprung.identification.free_response import fit_free_response
from sprung.identification.transients import find_transients
from sprung.recording import Channel, Recording
from sprung.simulation import RoadDrive, drives, simulate, simulate_drive, usual_excitation
from sprung.vehicles import chain, read_vehicle, structure


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


def of_chain() -> Recording:
    """Return the motion of the chain of three masses."""
    return simulate(chain(), usual_excitation(chain()), duration=60.0, sampling_rate=500.0, seed=1)


def push() -> Recording:
    """Return a body that is pushed and swings."""
    time = np.arange(300) / 100
    swing = np.exp(-1.9 * time) * np.sin(9.2 * time)
    motion = np.concatenate([0 * time, swing, 0 * time]) + 0.01 * np.random.default_rng(1).standard_normal(900)
    return Recording(motion[None], 100.0, (Channel("acc", "acceleration"),))


def healthy(count: int, first: int = 0) -> list[Observation]:
    """Return windows of a healthy car."""
    parts = tuple(structure(read_vehicle("zafira")).components())
    values = 0.02 * np.random.default_rng(first).standard_normal((count, len(parts)))
    covariance = 0.02**2 * np.eye(len(parts))
    return [Observation(600.0 * (first + k), parts, x, covariance, {}, {}, ()) for k, x in enumerate(values)]


@pytest.mark.parametrize(
    ("inner", "call"),
    [
        ((steps, "finished"), lambda: cov_ssi(of_chain())),
        ((learning, "_estimated"), lambda: learn(healthy(8))),
        ((changes, "scores_of"), lambda: diagnose(healthy(2, 8), learn(healthy(8)))),
        ((transients, "unexplained"), lambda: find_transients(push())),
        ((free_response, "free_lines"), lambda: fit_free_response(push())),
        ((bounce_tests, "tested"), lambda: bounce(push())),
        ((drives, "structure"), lambda: simulate_drive(read_vehicle("zafira"), RoadDrive(duration=5.0))),
    ],
    ids=lambda value: value[1] if isinstance(value, tuple) else "",
)
def test_functions_that_invert_matrices_use_one_thread(several, monkeypatch, inner, call):
    """On two busy cores `learn` took 10 times the processor time with two threads, and `diagnose` 16 times."""
    seen: list[set[int]] = []
    function = getattr(*inner)

    def watched(*arguments, **named):
        seen.append(n_threads())
        return function(*arguments, **named)

    monkeypatch.setattr(*inner, watched)
    call()
    assert seen == [{1}] * len(seen)
    assert seen
    assert n_threads() == {2}


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
