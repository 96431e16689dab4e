"""Rollers of a rig: inputs of each wheel, of an axle and of all wheels together."""

import numpy as np
import pytest

from sprung.likelihood import RigInputs, rigid_layout
from sprung.likelihood.terms import nominal_terms
from sprung.vehicles import read_vehicle, structure


def test_parts_of_the_rollers_add_up(classes) -> None:
    """Wheels of one axle share the parts of axle and rig, wheels of different axles that of the rig; -6 dB at 2 f."""
    nominal = structure(read_vehicle("scale-bogie"))
    spectra = classes(3, n_classes=2)
    rig = RigInputs(spectra, nominal.inputs)
    assert rig.names[4:] == ("level_axle_1", "level_axle_2", "level_all", "exponent")
    levels = np.array([1.0, 2.0, 3.0, 4.0, 10.0, 20.0, 100.0]) * 1e-12
    terms = nominal_terms(nominal, rigid_layout(nominal), spectra)
    matrix = rig.contribute(np.append(np.log(levels), 2.0), terms).inputs
    expected = np.full((4, 4), 100.0)
    expected[:2, :2] += 10.0
    expected[2:, 2:] += 20.0
    expected += np.diag([1.0, 2.0, 3.0, 4.0])
    at = int(np.argmin(np.abs(spectra.grid - 10.0)))
    reference = (spectra.grid[at] / 10.0) ** -2.0 * 1e-12
    assert matrix[0, at] == pytest.approx(reference * expected)
    assert np.array_equal(matrix[0], matrix[1])
    values = rig.values(np.append(np.log(levels), 2.0))
    assert values["level_axle_2"] == pytest.approx(20e-12)
    assert values["exponent"] == 2.0


def test_two_rollers_have_no_part_of_all_wheels(classes) -> None:
    rig = RigInputs(classes(1), ("left", "right"))
    assert rig.names == ("level_left", "level_right", "level_axle_1", "exponent")
    assert rig.parts.tolist() == [[1, 0], [0, 1], [1, 1]]
