import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.vehicles import (
    Component,
    Fault,
    corner_names,
    parse_fault,
    read_description,
    read_vehicle,
    structure,
    with_faults,
)


def test_every_corner_has_its_axle_and_side() -> None:
    parsed = [Component.parse(f"{corner}.damper") for corner in corner_names(4)]
    assert [component.axle for component in parsed[::2]] == ["front", "axle2", "axle3", "rear"]
    assert {component.side for component in parsed[::2]} == {"left"}
    assert {component.side for component in parsed[1::2]} == {"right"}
    with pytest.raises(ParameterError, match="n_axles=1 must be at least 2"):
        corner_names(1)


def test_text_and_component_are_each_other() -> None:
    for text in ("front_left.spring", "mass_1.damper", "front_axle.anti_roll"):
        assert str(Component.parse(text)) == text


def test_an_owner_that_is_not_a_corner_is_its_own_axle() -> None:
    bar = Component("front_axle", "anti_roll")
    assert (bar.axle, bar.side) == ("front_axle", None)


@pytest.mark.parametrize("text", ["spring", "", ".spring", "front_left.", "a.b.c"])
def test_other_texts_are_refused(text) -> None:
    with pytest.raises(ParameterError, match=r"is not of the form CORNER\.KIND: write front_left\.spring"):
        Component.parse(text)


@pytest.fixture
def car():
    return structure(read_vehicle("zafira"))


def test_fault_changes_its_component_only(car) -> None:
    before, after = car.components(), with_faults(car, [parse_fault("front_right.tyre=-0.3")]).components()
    tyre = Component("front_right", "tyre")
    assert after[tyre] == pytest.approx(0.7 * before[tyre])
    after[tyre] = before[tyre]
    assert after == before


@pytest.mark.parametrize("kind", ["spring", "damper", "tyre"])
def test_every_component_can_fail(car, kind) -> None:
    for corner in ("front_left", "front_right", "rear_left", "rear_right"):
        component = Component(corner, kind)
        changed = with_faults(car, [Fault(component, -0.5)])
        assert changed.components()[component] == pytest.approx(car.components()[component] / 2)


def test_growing_fault(car) -> None:
    fault = parse_fault("rear_left.spring=-0.4@60+120")
    assert fault.factor([0, 60, 120, 180, 500]) == pytest.approx([1, 1, 0.8, 0.6, 0.6])
    half = with_faults(car, [fault], time=120.0).components()[Component("rear_left", "spring")]
    assert half == pytest.approx(0.8 * car.components()[Component("rear_left", "spring")])


def test_sudden_fault_steps() -> None:
    fault = Fault(Component("front_left", "damper"), -0.5, onset=10.0)
    assert fault.factor([9.999, 10.0]).tolist() == [1.0, 0.5]
    assert not fault.is_constant


def test_two_faults_of_one_component_multiply(car) -> None:
    spring = Component("front_left", "spring")
    faults = [Fault(spring, -0.5), Fault(spring, 1.0)]
    assert with_faults(car, faults).components() == car.components()


@pytest.mark.parametrize("text", ["front_left.spring", "front_left=-0.2", "a.b=x", "a.b=nan", "", "a.b=-0.2@x"])
def test_a_fault_of_another_form_is_refused(text) -> None:
    with pytest.raises(ParameterError, match=r"CORNER\.COMPONENT=CHANGE"):
        parse_fault(text)


def test_unknown_component_is_refused_with_the_known_ones(car) -> None:
    with pytest.raises(ParameterError, match=r"'front_left.sprung' is not one of .*front_left.spring"):
        with_faults(car, [parse_fault("front_left.sprung=-0.2")])


def test_nothing_is_left_of_a_component_is_refused() -> None:
    with pytest.raises(ParameterError, match="above -1"):
        parse_fault("front_left.spring=-1")


def test_payload_is_the_mass_matrix_of_its_kinetic_energy(car) -> None:
    loaded = car.with_payload(100.0, x=-1.0, y=0.3)
    motion = np.zeros(len(car.coordinates))
    motion[:3] = 0.1, 0.2, -0.3  # bounce, pitch, roll velocities
    velocity = 0.1 + 0.2 * 1.0 - 0.3 * 0.3  # z' = bounce' - x pitch' + y roll'
    energy = (motion @ (loaded.mass - car.mass) @ motion) / 2
    assert energy == pytest.approx(100 * velocity**2 / 2)
    assert loaded.modes().natural_frequency[0] < car.modes().natural_frequency[0]


def test_payload_needs_a_body() -> None:
    with pytest.raises(ParameterError, match="has no pitch"):
        structure(read_description("quarter")).with_payload(10.0)
