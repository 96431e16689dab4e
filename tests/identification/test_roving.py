"""Which records are different set-ups, and which channels are one point."""

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.identification.roving import common_points, group_by_setup
from sprung.recording import Channel, Recording


def channels(*names, positions=None):
    """Return channels of known names, and positions if given."""
    places = positions or [None] * len(names)
    return tuple(Channel(name, "acceleration", place) for name, place in zip(names, places, strict=True))


def record(*names, positions=None):
    """Return a record of a few samples."""
    return Recording(np.zeros((len(names), 4)), 100.0, channels(*names, positions=positions))


def test_records_of_the_same_channels_are_one_set_up() -> None:
    here = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)]
    assert len(group_by_setup([record("a", "b"), record("b", "a")])) == 1
    assert len(group_by_setup([record("a", "b", positions=here), record("a", "b", positions=here)])) == 1
    assert len(group_by_setup([record("a", "b", positions=here), record("a", "b")])) == 1


def test_records_of_other_names_or_positions_are_set_ups() -> None:
    here, there = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)], [(0.0, 0.0, 0.0), (2.0, 0.0, 0.0)]
    first, second = record("a", "b"), record("a", "c")
    groups = group_by_setup([first, second, first])
    assert [len(group) for group in groups] == [2, 1]
    assert len(group_by_setup([record("a", "b", positions=here), record("a", "b", positions=there)])) == 2


def test_the_speed_and_the_temperature_make_no_set_up() -> None:
    first = Recording(np.zeros((2, 4)), 100.0, (Channel("a", "acceleration"), Channel("speed", "speed")))
    assert len(group_by_setup([first, record("a")])) == 1


def test_channels_of_one_name_are_one_point() -> None:
    points = common_points([channels("a", "b"), channels("a", "c")])
    assert [channel.name for channel in points.channels] == ["a", "b", "c"]
    assert points.rows == ((0, 1), (0, 2))
    assert points.references == ("a",)


def test_moved_channels_carry_the_number_of_their_set_up() -> None:
    here, there = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)], [(0.0, 0.0, 0.0), (2.0, 0.0, 0.0)]
    points = common_points([channels("a", "b", positions=here), channels("a", "b", positions=there)])
    assert [channel.name for channel in points.channels] == ["a", "b (1)", "b (2)"]
    assert [channel.position for channel in points.channels] == [here[0], here[1], there[1]]
    named = common_points([channels("a", "b"), channels("a", "b")], references=["a"])
    assert [channel.name for channel in named.channels] == ["a", "b (1)", "b (2)"]


def test_a_chain_of_set_ups_has_no_point_in_common() -> None:
    points = common_points([channels("a", "b"), channels("b", "c"), channels("c", "d")])
    assert points.references == ("b", "c")


@pytest.mark.parametrize(
    ("layouts", "references", "sentence"),
    [
        (
            [channels("a", "b"), channels("a", "c")],
            ["b"],
            "reference 'b' is not a channel of set-up 2, which has a, c: name channels that all set-ups have",
        ),
        (
            [channels("a", "b"), channels("a", "b")],
            None,
            "the 2 set-ups have the same channels a, b: name those that stayed in place as references (--references)",
        ),
        (
            [channels("a", "b"), channels("c", "d")],
            None,
            "set-up 2 (c, d) shares no channel with the others, so that its mode shapes have no common scale: keep at"
            " least one sensor in place, or identify it by itself",
        ),
    ],
)
def test_set_ups_that_cannot_be_merged(layouts, references, sentence) -> None:
    with pytest.raises(ParameterError) as refusal:
        common_points(layouts, references=references)
    assert str(refusal.value) == sentence
