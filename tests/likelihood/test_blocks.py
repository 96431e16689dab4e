"""Common checks of every block of parameters, and of the terms that they contribute to."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.likelihood import CornerSettings, rigid_layout, vehicle_model
from sprung.likelihood.corners import fitted_structure
from sprung.likelihood.spectra import onto_grid, through_window
from sprung.likelihood.transfer import term_gradients, transfer
from sprung.likelihood.whittle import minus_log_likelihood
from sprung.vehicles import read_vehicle, structure

CASES = [
    (group, name, kind)
    for name, kind in (("zafira", "road"), ("y25", "rail"), ("scale-bogie", "rig"))
    for group in ("components", "payload", "sensors", "inputs", "class_roughness", "noise")
    if (group, kind) != ("class_roughness", "rig")
]


def whole_model(name, kind, classes):
    """A model with every block that its kind has."""
    vehicle = read_vehicle(name)
    nominal = structure(vehicle)
    layout = rigid_layout(nominal)
    settings = CornerSettings(has_payload=True, has_free_sensors=True)
    spectra = classes(len(layout.rows), n_classes=3)
    return vehicle_model(spectra, layout, vehicle, nominal, settings=settings, kind=kind)


@pytest.fixture(params=CASES, ids="-".join)
def case(request, classes):
    """A group of blocks and the model that they are in."""
    group, name, kind = request.param
    return group, whole_model(name, kind, classes)


def blocks_of(group, model, parameters):
    """Each block of a group, and its parameters."""
    blocks = [(block, own) for block, own in model.by_block(parameters) if block.group == group]
    assert blocks
    return blocks


def misfit(model, terms):
    """The likelihood of terms, without a prior."""
    return minus_log_likelihood(through_window(transfer(terms).spectral_matrix), model.spectra)[0]


def gradients_of(model, terms):
    response = transfer(terms)
    weight = minus_log_likelihood(through_window(response.spectral_matrix), model.spectra)[1]
    return term_gradients(response, onto_grid(weight))


def test_names_starts_and_priors_agree(case):
    group, model = case
    for block, own in blocks_of(group, model, model.start):
        assert block.start.shape == block.prior_std.shape == block.is_log_power.shape == (len(block.names),)
        assert np.array_equal(own, block.start)
        assert np.all(block.prior_std > 0)
        assert set(block.values(own)) == set(block.names)
    assert len(set(model.names)) == len(model.names) == model.start.size


def test_rows_of_the_groups_are_all_parameters_once(case):
    _, model = case
    groups = {block.group for block in model.blocks}
    assert sorted(row for group in groups for row in model.rows(group)) == list(range(model.start.size))
    assert model.rows("no such group").size == 0


def test_values_are_physical(classes):
    model = whole_model("zafira", "road", classes)
    parameters = model.start.copy()
    parameters[model.rows("components")[0]] = np.log(0.8)
    parameters[model.rows("payload")[0]] = 0.1
    values = {name: value for block, own in model.by_block(parameters) for name, value in block.values(own).items()}
    nominal = {str(component): value for component, value in model.structure.components().items()}
    assert values["front_left.spring"] == pytest.approx(0.8 * nominal["front_left.spring"])
    assert values["rear_left.damper"] == pytest.approx(nominal["rear_left.damper"])
    assert values["payload_mass"] == pytest.approx(0.1 * 1480.0)  # a tenth of the body
    assert values["roughness"] == pytest.approx(256e-6)  # class C of ISO 8608
    assert (values["waviness"], values["delay"], values["class_0"]) == (2.0, 1.0, 1.0)


def test_gradient_of_a_block_is_the_finite_difference(case, somewhere, with_data):
    group, model = case
    parameters = somewhere(model, size=0.05)
    model = with_data(model, somewhere(model, seed=1, size=0.05))
    rows = model.rows(group)
    gradients = gradients_of(model, model.terms(parameters))
    gradient = np.concatenate([block.gradient(own, gradients) for block, own in blocks_of(group, model, parameters)])
    for row, value in zip(rows, gradient, strict=True):
        step = 1e-3 * min(model.prior_std[row], 0.3) * np.eye(parameters.size)[row]
        low2, low, high, high2 = (misfit(model, model.terms(parameters + k * step)) for k in (-2, -1, 1, 2))
        difference = (low2 - 8 * low + 8 * high - high2) / (12 * step[row])
        scale = np.abs(gradient * np.minimum(model.prior_std[rows], 0.3)).max() / min(model.prior_std[row], 0.3)
        assert value == pytest.approx(difference, rel=1e-5, abs=1e-6 * scale), model.names[row]


def test_derivatives_of_a_block_are_finite_differences(case, somewhere):
    group, model = case
    parameters = somewhere(model, size=0.05)
    response = transfer(model.terms(parameters))
    size = np.abs(response.spectral_matrix).max()
    derivatives = [d for block, own in blocks_of(group, model, parameters) for d in block.derivatives(own, response)]
    for row, derivative in zip(model.rows(group), derivatives, strict=True):
        step = 1e-4 * min(model.prior_std[row], 0.3) * np.eye(parameters.size)[row]
        above, below = (transfer(model.terms(parameters + sign * step)).spectral_matrix for sign in (1, -1))
        difference = (above - below) / (2 * step[row])
        bound = 1e-6 * np.abs(difference).max() + 1e-11 * size / step[row]
        assert np.abs(derivative - difference).max() < bound, model.names[row]


def test_parameters_that_are_log_powers_scale_the_spectra_together(case, somewhere):
    _, model = case
    parameters = somewhere(model)
    scales = np.concatenate([block.is_log_power for block in model.blocks])
    assert model.matrix(parameters + np.log(3) * scales) == pytest.approx(3 * model.matrix(parameters), rel=1e-9)


def test_a_fitted_structure_moves_as_its_terms_do(case, somewhere):
    """The transfer of the terms, and that of a structure with the same components and masses."""
    _, model = case
    parameters = somewhere(model, size=0.05)
    parameters[model.rows("sensors")] = 0
    fitted = vehicle_terms(model, fitted_structure(model, parameters))
    expected = transfer(model.terms(parameters)).matrix
    assert transfer(fitted).matrix == pytest.approx(expected, rel=1e-9, abs=1e-9 * np.abs(expected).max())


def vehicle_terms(model, vehicle):
    """The terms of a nominal structure."""
    return replace(model, structure=vehicle, blocks=model.blocks[-1:]).terms(model.blocks[-1].start)


@pytest.mark.parametrize(
    "term", ["stiffness", "mass", "forces", "motion", "feedthrough", "channel_response", "inputs", "noise"]
)
def test_gradient_of_a_term_is_the_finite_difference(term, classes, somewhere, with_data):
    """d objective = Re sum(g dT) for a change of a term, Hermitian or symmetric where the term is."""
    model = whole_model("zafira", "road", classes)
    terms = model.terms(somewhere(model))
    model = with_data(model, somewhere(model, seed=1))
    value, generator = getattr(terms, term), np.random.default_rng(3)
    change = generator.standard_normal(value.shape)
    if np.iscomplexobj(value):
        change = change + 1j * generator.standard_normal(value.shape)
    if term in {"mass", "inputs", "noise"}:
        change = change + change.conj().swapaxes(-1, -2)
    typical = {"forces": 1e3, "feedthrough": 10.0}.get(term, np.abs(value).mean())
    change *= 1e-5 * typical
    gradients = gradients_of(model, terms)
    gradient = getattr(gradients, term)
    above, below = (misfit(model, replace(terms, **{term: value + sign * change})) for sign in (1, -1))
    assert np.sum(gradient * change).real == pytest.approx((above - below) / 2, rel=1e-4)


@pytest.mark.parametrize("term", ["mass", "forces", "motion", "feedthrough"])
def test_change_by_a_term_is_the_finite_difference(term, classes, somewhere):
    model = whole_model("zafira", "road", classes)
    terms = model.terms(somewhere(model))
    value = getattr(terms, term)
    change = np.random.default_rng(3).standard_normal(value.shape)
    change = change + change.T if term == "mass" else change
    step = 1e-5 * ({"forces": 1e3, "feedthrough": 10.0}.get(term) or np.abs(value).mean())
    above, below = (
        transfer(replace(terms, **{term: value + sign * step * change})).spectral_matrix for sign in (1, -1)
    )
    derivative = getattr(transfer(terms), f"change_by_{term}")(change)
    difference = (above - below) / (2 * step)
    assert np.abs(derivative - difference).max() < 1e-5 * np.abs(difference).max()


def with_measured_input(terms, *, density=0.3):
    """Terms with one more input, which moves no wheel and is independent of the road."""
    measured = np.full((*terms.inputs.shape[:2], 1, 1), density, dtype=np.complex128)
    more = {name: np.pad(getattr(terms, name), ((0, 0), (0, 1))) for name in ("feet", "forces", "feedthrough")}
    return replace(terms, measured_inputs=measured, **more)


def test_a_measured_input_that_a_channel_reads_adds_its_spectrum(classes, somewhere):
    model = whole_model("zafira", "road", classes)
    terms = model.terms(somewhere(model))
    feedthrough = np.zeros((4, 5))
    feedthrough[2, 4] = 0.5  # half of the input is read by the third channel
    column = 0.5 * terms.reduction[:, 2]
    both = transfer(replace(with_measured_input(terms), feedthrough=feedthrough)).spectral_matrix
    expected = transfer(terms).spectral_matrix + 0.3 * np.outer(column, column)
    assert both == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("term", ["forces", "feedthrough"])
def test_gradient_of_what_a_measured_input_does_is_the_finite_difference(term, classes, somewhere, with_data):
    model = whole_model("zafira", "road", classes)
    terms = with_measured_input(model.terms(somewhere(model)))
    model = with_data(model, somewhere(model, seed=1))
    change = np.zeros(getattr(terms, term).shape)
    change[:, -1] = np.random.default_rng(3).standard_normal(len(change)) * (1e3 if term == "forces" else 1.0)
    at, step = replace(terms, **{term: getattr(terms, term) + change}), 1e-4
    above, below = (misfit(model, replace(at, **{term: getattr(at, term) + k * step * change})) for k in (1, -1))
    gradient = getattr(gradients_of(model, at), term)
    assert np.sum(gradient * change).real == pytest.approx((above - below) / (2 * step), rel=1e-5)
