"""Samples of excitations at one rate."""

import numpy as np
import pytest

#: Sampling rate of the tests [Hz].
RATE = 1000.0


@pytest.fixture(scope="session")
def drawn():
    """Return a function that draws samples of an excitation at `RATE`."""

    def draw(excitation, n_samples=20_000, seed=1, start=0.0):
        return excitation.samples(n_samples, sampling_rate=RATE, generator=np.random.default_rng(seed), start=start)

    return draw
