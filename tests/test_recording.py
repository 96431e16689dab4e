"""Recordings: what contradicts itself is refused, what is given stays as it is."""

import dataclasses

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.recording import QUANTITIES, Channel, Gap, Recording, join

SAMPLES = np.arange(30.0).reshape(3, 10)
CHANNELS = (Channel("a", "acceleration"), Channel("b"), Channel("speed", "speed"))


def recorded(**fields):
    return Recording(**{"samples": SAMPLES, "sampling_rate": 5.0, "channels": CHANNELS, **fields})


def test_a_recording_knows_its_names_length_and_units() -> None:
    recording = recorded(start=1_700_000_000_000_000_000)
    assert recording.names == ("a", "b", "speed")
    assert (recording.n_samples, recording.duration) == (10, 2.0)
    assert [channel.unit for channel in recording.channels] == ["m/s^2", "", "m/s"]
    assert recording.start == 1_700_000_000_000_000_000
    assert recording.index("speed") == 2


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_every_quantity_can_be_measured(quantity) -> None:
    assert Channel("x", quantity).unit == QUANTITIES[quantity]


def test_samples_are_read_only_and_not_copied() -> None:
    samples = SAMPLES.copy()
    recording = recorded(samples=samples)
    assert np.shares_memory(recording.samples, samples)
    assert samples.flags.writeable
    with pytest.raises(ValueError, match="read-only"):
        recording.samples[0, 0] = 1.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        recording.sampling_rate = 1.0


def test_integers_become_floating_point_numbers() -> None:
    assert recorded(samples=np.ones((3, 4), dtype=np.int16)).samples.dtype == np.float64


def test_select_takes_channels_in_the_order_given() -> None:
    selected = recorded(gaps=(Gap(4, 0.3),), history=("read",)).select(["speed", "a"])
    assert selected.names == ("speed", "a")
    np.testing.assert_array_equal(selected.samples, SAMPLES[[2, 0]])
    assert selected.gaps == (Gap(4, 0.3),)
    assert selected.history == ("read",)


def test_a_channel_is_taken_by_its_name() -> None:
    recording = recorded()
    np.testing.assert_array_equal(recording["speed"], SAMPLES[2])
    assert recording.select("a").names == ("a",)
    with pytest.raises(ParameterError, match=r'pass the name of a channel: recording\["acc_fl"\]'):
        recording[0]


def test_stretches_lie_between_gaps_and_hold_every_sample() -> None:
    recording = recorded(gaps=(Gap(1, 0.5), Gap(7, 2.0)))
    assert list(recording.stretches()) == [slice(0, 1), slice(1, 7), slice(7, 10)]
    assert list(recorded().stretches()) == [slice(0, 10)]
    assert recording.duration == 2.0


def test_changed_adds_a_line_to_the_history_and_leaves_the_original() -> None:
    first = recorded(history=("read",))
    second = first.changed("doubled", samples=2 * first.samples)
    assert second.history == ("read", "doubled")
    assert first.history == ("read",)
    np.testing.assert_array_equal(second.samples, 2 * SAMPLES)


def test_an_empty_recording_is_a_recording() -> None:
    empty = Recording(np.zeros((0, 0)), 10.0, ())
    assert (empty.names, empty.n_samples, empty.duration) == ((), 0, 0.0)
    assert list(empty.stretches()) == [slice(0, 0)]


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({"samples": np.zeros(5)}, "samples has 1 dimensions (5,), but must have 2"),
        ({"sampling_rate": 0.0}, "sampling_rate=0 must be above 0"),
        ({"sampling_rate": np.nan}, "sampling_rate=nan must be finite and above 0"),
        ({"sampling_rate": np.inf}, "sampling_rate=inf must be finite and above 0"),
        ({"channels": CHANNELS[:2]}, "2 channels are described, but samples hold 3 rows"),
        (
            {"channels": (Channel("a"), Channel("b"), Channel("a"))},
            "channel name 'a' occurs more than once: rename one of them",
        ),
        ({"gaps": (Gap(0, 1.0),)}, "gap indices [0] must rise between 1 and 9"),
        ({"gaps": (Gap(10, 1.0),)}, "gap indices [10] must rise between 1 and 9"),
        ({"gaps": (Gap(5, 1.0), Gap(5, 1.0))}, "gap indices [5, 5] must rise between 1 and 9"),
        ({"gaps": (Gap(5, 1.0), Gap(3, 1.0))}, "gap indices [5, 3] must rise between 1 and 9"),
    ],
)
def test_what_contradicts_itself_is_refused(fields, sentence) -> None:
    with pytest.raises(ParameterError) as refusal:
        recorded(**fields)
    assert str(refusal.value) == sentence


def test_a_channel_needs_a_name_and_a_known_quantity() -> None:
    with pytest.raises(ParameterError, match=r"^a channel has an empty name: give every column a name$"):
        Channel("  ")
    with pytest.raises(ParameterError, match=r"^quantity of channel 'a': 'smell' is not one of acceleration, angle"):
        Channel("a", "smell")


def test_an_unknown_channel_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ParameterError, match=r"^there is no channel 'c': the recording has a, b, speed$"):
        recorded().select(["a", "c"])


# Joining


def test_pieces_join_with_their_gaps_and_those_between_them() -> None:
    """The second piece follows at once, the third after 2 s."""
    pieces = [recorded(start=5), recorded(gaps=(Gap(4, 0.3),)), recorded(gaps=(Gap(1, 7.0),))]
    whole = join(pieces, waits=[None, 2.0])
    np.testing.assert_array_equal(whole.samples, np.tile(SAMPLES, 3))
    assert whole.gaps == (Gap(14, 0.3), Gap(20, 2.0), Gap(21, 7.0))
    assert (whole.channels, whole.sampling_rate, whole.start, whole.history) == (CHANNELS, 5.0, 5, ())


def test_parts_of_a_recording_join_to_the_recording() -> None:
    whole = recorded(start=5, gaps=(Gap(3, 1.5), Gap(6, 0.5)))
    parts = [whole.part(first, last) for first, last in ((0, 2), (2, 6), (6, 10))]
    again = join(parts, waits=[None, 0.5])
    np.testing.assert_array_equal(again.samples, whole.samples)
    assert (again.gaps, again.start) == (whole.gaps, whole.start)
    assert join([whole]).gaps == whole.gaps


@pytest.mark.parametrize(
    ("pieces", "waits", "sentence"),
    [
        ([], None, "there is nothing to join: give at least one piece"),
        ([recorded(), recorded()], [], "2 pieces need 1 waits, but there are 0"),
        (
            [recorded(), recorded(sampling_rate=6.0)],
            None,
            "pieces of one recording must have the same channels and sampling rate",
        ),
        (
            [recorded(), recorded().select(["a"])],
            None,
            "pieces of one recording must have the same channels and sampling rate",
        ),
    ],
)
def test_pieces_that_do_not_belong_together_are_refused(pieces, waits, sentence) -> None:
    with pytest.raises(ParameterError) as refusal:
        join(pieces, waits=waits)
    assert str(refusal.value) == sentence
