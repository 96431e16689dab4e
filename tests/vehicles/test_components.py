import pytest

from sprung.errors import ParameterError
from sprung.vehicles import Component, corner_names


def test_every_corner_has_its_axle_and_side() -> None:
    parsed = [Component.parse(f"{corner}.damper") for corner in corner_names(4)]
    assert [component.axle for component in parsed[::2]] == ["front", "axle2", "axle3", "rear"]
    assert {component.side for component in parsed[::2]} == {"left"}
    assert {component.side for component in parsed[1::2]} == {"right"}


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
