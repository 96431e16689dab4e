"""Stable rates over frequency."""

import numpy as np
import pytest

from sprung.results.figures import (
    alignment_rates,
    stable_rates_figure,
)


def test_rates_are_those_of_the_modes(chain) -> None:
    frequency, rate = alignment_rates(chain.subsets[0])
    for mode in range(len(chain.modes)):
        near = np.argmin(np.abs(frequency - chain.modes.natural_frequency[mode]))
        assert rate[near] == pytest.approx(chain.modes.stable_rate[mode], abs=0.05)
    figure = stable_rates_figure(chain, threshold=0.5)
    assert figure.axes[0].get_ylim()[0] == 0
