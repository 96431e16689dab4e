"""Messages of any bytes: read, or refused in one sentence and bounded memory."""

import zlib

import cbor2
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sprung.errors import FormatError, ParameterError
from sprung.link import Header, Key, decode, parse_topic
from sprung.link.messages import LARGEST, check_vehicle, checked_map, message


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({Key.BOOT: None}, "'None' found where an integer"),
        ({Key.SEQ: -1}, "seq=-1 must be at least 0"),
        ({Key.KIND: 5}, "'5' found where a short text"),
        ({Key.PREVIOUS: [1]}, "boot and count of messages before"),
    ],
)
def test_header_that_is_wrong(change, words) -> None:
    with pytest.raises(FormatError, match=words):
        Header.of({Key.BOOT: 1, Key.SEQ: 2, Key.START: 3} | change)


def sealed(body):
    return body + zlib.crc32(body).to_bytes(4, "little")


@pytest.mark.parametrize("major", [2, 3, 4, 5], ids=["bytes", "text", "list", "map"])
@pytest.mark.parametrize("length", [2**20, 2**32, 2**62, 2**64 - 1])
def test_lengths_that_are_only_claimed_take_no_memory(memory_below, major, length) -> None:
    head = bytes([major << 5 | 27]) + length.to_bytes(8, "big")
    for payload in (sealed(b"\xa1\x00" + head + b"\x00" * 8), sealed(head + b"\x00" * 8)):
        with memory_below(LARGEST), pytest.raises(FormatError, match="the message is not a CBOR map"):
            decode(payload)


@pytest.mark.parametrize(
    "tagged",
    [
        b"\xc4\x82\x00\xc2\x5a\x00\x0f\x00\x00" + b"\xa7" * 0xF0000,
        b"\xd8\x23\x61a",
        b"\xd8\x1c\x81\xd8\x1d\x00",
        b"\xc1\x00",
        b"\xd9\x99\x99\x80",
    ],
    ids=["decimal of a megabyte, over a minute", "pattern", "list of itself", "time", "unknown"],
)
def test_what_would_be_worked_out_by_a_tag_is_refused(tagged) -> None:
    with pytest.raises(FormatError, match=r"unexpected CBOR tag \d+"):
        decode(sealed(b"\xa1\x00" + tagged))


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(st.binary(max_size=200))
def test_any_bytes_are_refused(payload) -> None:
    with pytest.raises(FormatError):
        decode(payload)
    with pytest.raises(FormatError):
        decode(payload + zlib.crc32(payload).to_bytes(4, "little"))


def test_names_of_vehicles() -> None:
    for name in ("", ".", "..", "a/b", "a b", "x" * 65, "#", "+"):
        with pytest.raises(ParameterError, match="not a valid name"):
            check_vehicle(name)
    assert check_vehicle("bus-17.b_2") == "bus-17.b_2"


DOCUMENT = {0: 1, "number": -7, "text": "°", "bytes": b"\x00\xff", "list": [1, 2.5, None, {"deep": True}]}


def test_a_message_is_read_as_it_was_written() -> None:
    assert checked_map(message(DOCUMENT)) == DOCUMENT


def test_a_flipped_bit_is_noticed() -> None:
    payload = message(DOCUMENT)
    for bit in range(8 * len(payload)):
        damaged = bytearray(payload)
        damaged[bit // 8] ^= 1 << bit % 8
        with pytest.raises(FormatError, match="the message was damaged in transit"):
            checked_map(bytes(damaged))


@pytest.mark.parametrize("size", [0, 7, LARGEST + 1])
def test_messages_have_a_least_and_a_largest_size(size) -> None:
    with pytest.raises(FormatError, match=f"a message of {size} bytes: it must have between 8 and {LARGEST}"):
        checked_map(bytes(size))


@pytest.mark.parametrize("document", [[1], 5, "text"])
def test_what_is_no_map_is_refused(document) -> None:
    with pytest.raises(FormatError, match="not a single CBOR map"):
        checked_map(sealed(cbor2.dumps(document).ljust(4, b"\x00")))


@pytest.mark.parametrize("name", ["", "sprung/v1/car", "sprung/v2/car/raw", "sprung/v1/car/raw/x", "sprung/v1/../raw"])
def test_other_topics_are_refused(name) -> None:
    with pytest.raises(FormatError, match="it must be sprung/v1/VEHICLE/WHAT"):
        parse_topic(name)
