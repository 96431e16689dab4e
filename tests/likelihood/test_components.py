"""Springs, dampers and tyres as parameters."""

import pytest

from sprung.errors import ParameterError
from sprung.likelihood.components import free_components
from sprung.vehicles import structure


def test_kinds_and_single_components_are_chosen_by_name(car) -> None:
    nominal = structure(car)
    assert len(free_components(nominal, car, None, kind="road")) == 12
    assert len(free_components(nominal, car, None, kind="rail")) == 8  # without the contact of wheel and rail
    springs = free_components(nominal, car, ("spring",), kind="road")
    assert list(map(str, springs)) == [
        f"{corner}.spring" for corner in ("front_left", "front_right", "rear_left", "rear_right")
    ]
    some = free_components(nominal, car, ("rear_left.damper", "tyre"), kind="road")
    assert {str(component) for component in some if component.kind == "damper"} == {"rear_left.damper"}
    assert len(some) == 5
    with pytest.raises(ParameterError, match="free component 'wheel' is none of spring, damper, tyre, front_left"):
        free_components(nominal, car, ("wheel",), kind="road")


def test_a_component_that_the_vehicle_does_not_have_is_not_free(car) -> None:
    """A rear axle without dampers."""
    axles = (car.axle[0], car.axle[1].model_copy(update={"damping": 0.0}))
    undamped = car.model_copy(update={"axle": axles})
    free = free_components(structure(undamped), undamped, ("damper",), kind="road")
    assert list(map(str, free)) == ["front_left.damper", "front_right.damper"]
