"""Common checks of every block of parameters, and of the terms that they contribute to."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.likelihood.corners import fitted_structure
from sprung.likelihood.hermitian import real_coordinates
from sprung.likelihood.transfer import transfer

CASES = [
    (group, name, kind)
    for name, kind in (("zafira", "road"), ("y25", "rail"), ("scale-bogie", "rig"))
    for group in ("components", "payload", "unsprung", "sensors", "inputs", "class_roughness", "noise")
    if (group, kind) != ("class_roughness", "rig")
] + [(group, "zafira", "road") for group in ("tracks", "elements", "driving")]
CASES.append(("driving", "coach", "rail"))


@pytest.fixture(params=CASES, ids="-".join)
def case(request, whole_model):
    """A group of blocks and the model that they are in."""
    group, name, kind = request.param
    return group, whole_model(name, kind)


def blocks_of(group, model, parameters):
    """Each block of a group, and its parameters."""
    blocks = [(block, own) for block, own in model.by_block(parameters) if block.group == group]
    assert blocks
    return blocks


def test_names_starts_and_priors_agree(case) -> None:
    group, model = case
    for block, own in blocks_of(group, model, model.start):
        assert block.start.shape == block.prior_std.shape == block.is_log_power.shape == (len(block.names),)
        assert np.array_equal(own, block.start)
        assert np.all(block.prior_std > 0)
        assert set(block.names) <= set(block.values(own))
    assert len(set(model.names)) == len(model.names) == model.start.size


def test_rows_of_the_groups_are_all_parameters_once(case) -> None:
    _, model = case
    groups = {block.group for block in model.blocks}
    assert sorted(row for group in groups for row in model.rows(group)) == list(range(model.start.size))
    assert model.rows("no such group").size == 0


def test_values_are_physical(whole_model) -> None:
    model = whole_model("zafira", "road")
    parameters = model.start.copy()
    parameters[model.rows("components")[0]] = np.log(0.8)
    parameters[model.rows("payload")[0]] = 0.1
    of_vehicle = [(block, own) for block, own in model.by_block(parameters) if "seat_1" not in block.names]
    values = {name: value for block, own in of_vehicle for name, value in block.values(own).items()}
    nominal = {str(component): value for component, value in model.structure.components().items()}
    assert values["front_left.spring"] == pytest.approx(0.8 * nominal["front_left.spring"])
    assert values["rear_left.damper"] == pytest.approx(nominal["rear_left.damper"])
    assert values["payload_mass"] == pytest.approx(0.1 * 1480.0)  # a tenth of the body
    assert values["roughness"] == pytest.approx(256e-6)  # class C of ISO 8608
    assert (values["waviness"], values["delay"], values["class_0"]) == (2.0, 1.0, 1.0)


def test_gradient_of_a_block_is_the_finite_difference(case, somewhere, with_data, misfit, gradients_of) -> None:
    group, model = case
    parameters = somewhere(model, size=0.05)
    model = with_data(model, somewhere(model, seed=1, size=0.05))
    rows = model.rows(group)
    gradients = gradients_of(model, model.terms(parameters))
    gradient = np.concatenate([block.gradient(own, gradients) for block, own in blocks_of(group, model, parameters)])
    for row, value in zip(rows, gradient, strict=True):
        step = 1e-3 * min(model.prior_std[row], 10.0) * np.eye(parameters.size)[row]
        low2, low, high, high2 = (misfit(model, model.terms(parameters + k * step)) for k in (-2, -1, 1, 2))
        difference = (low2 - 8 * low + 8 * high - high2) / (12 * step[row])
        scale = np.abs(gradient * np.minimum(model.prior_std[rows], 0.3)).max() / min(model.prior_std[row], 0.3)
        assert value == pytest.approx(difference, rel=1e-5, abs=1e-6 * scale), model.names[row]


def test_derivatives_of_a_block_are_finite_differences(case, somewhere) -> None:
    group, model = case
    parameters = somewhere(model, size=0.05)
    response = transfer(model.terms(parameters))
    size = np.abs(response.spectral_matrix).max()
    derivatives = [d for block, own in blocks_of(group, model, parameters) for d in block.derivatives(own, response)]
    for row, derivative in zip(model.rows(group), derivatives, strict=True):
        step = 1e-4 * min(model.prior_std[row], 0.3) * np.eye(parameters.size)[row]
        above, below = (transfer(model.terms(parameters + sign * step)).spectral_matrix for sign in (1, -1))
        difference = real_coordinates((above - below) / (2 * step[row]))
        bound = 1e-6 * np.abs(difference).max() + 1e-11 * size / step[row]
        assert np.abs(derivative - difference).max() < bound, model.names[row]


def test_parameters_that_are_log_powers_scale_the_spectra_together(case, somewhere) -> None:
    _, model = case
    parameters = somewhere(model)
    scales = np.concatenate([block.is_log_power for block in model.blocks])
    assert model.matrix(parameters + np.log(3) * scales) == pytest.approx(3 * model.matrix(parameters), rel=1e-9)


def test_a_fitted_structure_moves_as_its_terms_do(case, somewhere) -> None:
    """The transfer of the terms, and that of a structure with the same components and masses; nobody on the seats."""
    _, model = case
    parameters = somewhere(model, size=0.05)
    parameters[model.rows("sensors")] = 0
    parameters[[row for row, name in enumerate(model.names) if name.startswith("seat_")]] = 0
    fitted = vehicle_terms(model, fitted_structure(model, parameters))
    expected = transfer(model.terms(parameters)).matrix[..., : len(model.structure.inputs)]
    assert transfer(fitted).matrix == pytest.approx(expected, rel=1e-9, abs=1e-9 * np.abs(expected).max())


def vehicle_terms(model, vehicle):
    """The terms of a nominal structure."""
    return replace(model, structure=vehicle, blocks=model.blocks[-1:]).terms(model.blocks[-1].start)
