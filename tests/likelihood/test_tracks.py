"""Level of the right track over the left one."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.likelihood import TrackLevels, rigid_layout
from sprung.likelihood.terms import nominal_terms
from sprung.vehicles import structure


def test_a_level_scales_right_up_and_left_down(car, classes) -> None:
    """Amplitudes e^(p/2) and e^(-p/2): the power of the right is e^(2p) that of the left, the cross spectrum stays."""
    nominal = structure(car)
    terms = nominal_terms(nominal, rigid_layout(nominal), classes(3, n_classes=2))
    terms = replace(terms, inputs=np.ones_like(terms.inputs))
    block = TrackLevels(np.array([1.0, -1.0, 1.0, -1.0]))
    inputs = block.contribute(np.array([0.2]), terms).inputs[0, 0].real
    assert inputs[1, 1] / inputs[0, 0] == pytest.approx(np.exp(0.4))
    assert inputs[[0, 2, 1], [1, 3, 2]] == pytest.approx(1.0)
    assert inputs[0, 2] == pytest.approx(np.exp(-0.2))
    assert block.values(np.array([0.2])) == pytest.approx({"right_over_left": np.exp(0.2)})
