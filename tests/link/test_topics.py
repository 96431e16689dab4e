"""Topics of vehicles: written and read back, others refused."""

import pytest

from sprung.errors import FormatError
from sprung.link import UPWARDS, parse_topic, topic
from sprung.link.messages import DOWNWARDS


@pytest.mark.parametrize("what", [*UPWARDS, *DOWNWARDS])
def test_a_topic_is_read_as_it_was_written(what) -> None:
    assert topic("bus-17", what) == f"sprung/v1/bus-17/{what}"
    assert parse_topic(topic("bus-17", what)) == ("bus-17", what)


@pytest.mark.parametrize("name", ["", "sprung/v1/car", "sprung/v2/car/raw", "sprung/v1/car/raw/x", "sprung/v1/../raw"])
def test_other_topics_are_refused(name) -> None:
    with pytest.raises(FormatError, match="it must be sprung/v1/VEHICLE/WHAT"):
        parse_topic(name)
