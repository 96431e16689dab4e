"""Level of the right track over the left one."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.likelihood import CornerSettings, TrackLevels, rigid_layout, vehicle_model
from sprung.likelihood.payload import payload
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


@pytest.mark.slow
def test_a_rough_side_and_a_load_off_the_axes_leave_the_corners_alone(car, classes, recovered) -> None:
    """Exact spectra of a car with 100 kg behind on the right and a track 2.5 dB rougher there."""
    nominal = structure(car)
    layout = rigid_layout(nominal)
    model = vehicle_model(classes(len(layout.rows)), layout, car, nominal, settings=CornerSettings(), kind="road")
    model = replace(model, blocks=tuple(block for block in model.blocks if block.group != "unsprung"))  # the scale
    truth = model.start.copy()
    truth[model.names.index("right_over_left")] = np.log(10) * 2.5 / 20
    x, y = -1.3, -0.4
    point = 100.0 * np.array([1.0, -x, y, x**2, y**2, -x * y])
    truth[model.rows("payload")] = point / [part.unit for part in payload(nominal).parts]
    rows = model.rows("components", "payload", "tracks")
    assert recovered(model, truth)[rows] == pytest.approx(truth[rows], abs=1e-6)
