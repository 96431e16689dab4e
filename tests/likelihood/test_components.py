"""Springs, dampers and tyres as parameters."""

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.likelihood import FreeComponents
from sprung.likelihood.components import free_components
from sprung.vehicles import parse_fault, structure, with_faults


def test_kinds_and_single_components_are_chosen_by_name(car) -> None:
    nominal = structure(car)
    assert len(free_components(nominal, car, None)) == 12
    springs = free_components(nominal, car, ("spring",))
    assert list(map(str, springs)) == [
        f"{corner}.spring" for corner in ("front_left", "front_right", "rear_left", "rear_right")
    ]
    some = free_components(nominal, car, ("rear_left.damper", "tyre"))
    assert {str(component) for component in some if component.kind == "damper"} == {"rear_left.damper"}
    assert len(some) == 5
    with pytest.raises(ParameterError, match="free component 'wheel' is none of spring, damper, tyre, front_left"):
        free_components(nominal, car, ("wheel",))


def test_a_component_that_the_vehicle_does_not_have_is_not_free(car) -> None:
    """A rear axle without dampers."""
    axles = (car.axle[0], car.axle[1].model_copy(update={"damping": 0.0}))
    undamped = car.model_copy(update={"axle": axles})
    free = free_components(structure(undamped), undamped, ("damper",))
    assert list(map(str, free)) == ["front_left.damper", "front_right.damper"]


def test_fitted_components_are_those_of_a_vehicle_with_faults(car) -> None:
    nominal = structure(car)
    block = FreeComponents(nominal, free_components(nominal, car, None))
    parameters = np.zeros(12)
    parameters[block.names.index("rear_left.spring")] = np.log(0.7)
    parameters[block.names.index("front_right.tyre")] = np.log(1.2)
    faults = [parse_fault("rear_left.spring=-0.3"), parse_fault("front_right.tyre=0.2")]
    faulty = with_faults(nominal, faults)
    np.testing.assert_allclose(block.fitted(parameters, nominal).modes().poles, faulty.modes().poles, rtol=1e-12)
    expected = {str(component): value for component, value in faulty.components().items()}
    assert block.values(parameters) == pytest.approx(expected)
