"""Fitted corners: values, identifiability, modes and their standard deviations."""

import numpy as np
import pytest
from scipy import stats

from sprung.likelihood import CornerFit, CornerSettings, rigid_layout, vehicle_model
from sprung.vehicles import parse_fault, structure, with_faults


@pytest.fixture
def model(car, classes):
    """A car with every component and a payload free."""
    nominal = structure(car)
    layout = rigid_layout(nominal)
    return vehicle_model(classes(3), layout, car, nominal, settings=CornerSettings(), kind="road")


def fit_of(model, parameters, std) -> CornerFit:
    covariance = np.diag(np.square(std))
    return CornerFit(model, parameters, covariance, np.zeros((3, 96)), 0.0, 54, 2, ())


@pytest.fixture
def soft(model):
    """The front left spring 30 % softer; every standard deviation a tenth of its prior's."""
    parameters = model.start.copy()
    parameters[0] = np.log(0.7)
    return fit_of(model, parameters, 0.1 * model.prior_std)


def test_values_are_nominal_times_the_ratio(soft) -> None:
    assert str(soft.components[0]) == "front_left.spring"
    assert soft.values[0] == pytest.approx(0.7 * 44179.0)
    assert soft.values[1:] == pytest.approx(soft.nominal[1:])
    assert soft.log_ratios_std == pytest.approx(np.full(12, 0.07))
    assert soft.inputs["roughness"] == pytest.approx(256e-6)
    assert soft.payload["payload_mass"] == pytest.approx({"value": 0.0, "std": 0.1 * 0.2 * 1480.0})
    assert soft.sensors == {}


def test_a_component_is_identifiable_where_the_data_halve_its_prior(model) -> None:
    std = 0.1 * model.prior_std
    std[3], std[5] = 0.49 * model.prior_std[3], 0.51 * model.prior_std[5]
    assert np.flatnonzero(~fit_of(model, model.start, std).is_identifiable).tolist() == [5]


@pytest.mark.parametrize(
    ("factors", "implausible", "uneven"),
    [
        ({"front_left.tyre": 2.0, "front_right.tyre": 1.8}, {"front tyres": np.sqrt(3.6)}, {}),
        ({"rear_left.spring": 0.5, "rear_right.spring": 0.5}, {"rear springs": 0.5}, {}),
        ({"rear_left.damper": 0.5, "rear_right.damper": 0.5}, {}, {}),  # worn
        ({"rear_left.tyre": 0.5}, {}, {"rear tyres": 0.5}),
        ({"rear_left.tyre": 1.48, "rear_right.tyre": 0.48}, {}, {"rear tyres": 1.48 / 0.48}),
        ({"front_left.spring": 1.3, "front_right.spring": 1.3}, {}, {}),
    ],
)
def test_values_that_no_car_of_the_file_has(model, factors, implausible, uneven) -> None:
    parameters = model.start.copy()
    for name, factor in factors.items():
        parameters[model.names.index(name)] = np.log(factor)
    fit = fit_of(model, parameters, 0.1 * model.prior_std)
    assert fit.implausible_axles == pytest.approx(implausible)
    assert fit.uneven_axles == pytest.approx(uneven)
    unsure = fit_of(model, parameters, model.prior_std)
    assert (unsure.implausible_axles, unsure.uneven_axles) == ({}, {})


def test_modes_are_those_of_a_vehicle_with_the_fault(soft, car) -> None:
    expected = with_faults(structure(car), [parse_fault("front_left.spring=-0.3")]).modes()
    np.testing.assert_allclose(soft.modes().poles, expected.poles, rtol=1e-9)
    assert soft.modes().labels == expected.labels


def test_uncertain_springs_alone_give_the_scatter_of_the_frequencies(model) -> None:
    """All components known but for one: the scatter over 400 equally likely values of its stiffness."""
    std = 1e-12 * model.prior_std
    std[0] = 0.05
    fit = fit_of(model, model.start, std)
    frequency, damping = fit.modes_std()
    draws = 0.05 * stats.norm.ppf((np.arange(400) + 0.5) / 400)
    changed = [model.structure.changed({model.components[0]: float(np.exp(draw))}).modes() for draw in draws]
    scatter = np.std([modes.natural_frequency[:3] for modes in changed], axis=0)
    assert frequency[:3] == pytest.approx(scatter, rel=0.02)
    assert damping[:3] == pytest.approx(np.std([modes.damping_ratio[:3] for modes in changed], axis=0), rel=0.02)
