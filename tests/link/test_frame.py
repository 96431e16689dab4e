"""Frames: what goes in comes out, and nothing that is no frame does any harm."""

import random
import subprocess
import sys
import zlib

import cbor2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sprung.errors import FormatError, ParameterError
from sprung.link import (
    CLIPPED,
    MISSING,
    PACKED,
    RAW,
    TIME_KEPT,
    Frame,
    Header,
    check_frame,
    checked_map,
    decode,
    encode,
    message,
    quantised,
)
from sprung.link.frame import MAX_SAMPLES
from sprung.link.messages import LARGEST, LATEST


def frame(samples=None, *, width=2, **fields):
    samples = np.random.default_rng(1).normal(size=(3, 200)) if samples is None else samples
    counts, scale, flags = quantised(np.asarray(samples, dtype=float), width=width)
    given_ = {"vehicle": "bus-17", "boot": 3, "seq": 5, "start": 1_700_000_000_000_000_000, "interval": 5_000_000}
    names = tuple(f"acc_{k}" for k in range(len(counts)))
    return Frame(**{**given_, **fields}, channels=names, scale=scale, counts=counts, flags=flags, width=width)


@pytest.mark.parametrize("codec", [RAW, PACKED])
@pytest.mark.parametrize("width", [2, 3, 4])
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data())
def test_write_then_read(width, codec, data) -> None:
    shape = data.draw(st.tuples(st.integers(1, 4), st.integers(1, 30)))
    top = 2 ** (8 * width - 1) - 1
    counts = data.draw(st.lists(st.integers(-top - 1, top), min_size=shape[0] * shape[1], max_size=shape[0] * shape[1]))
    one = frame()
    names, scale = tuple("abcd"[: shape[0]]), one.scale[:1].repeat(shape[0])
    sent = Frame("car.1", 1, 2, 3, 10**6, names, scale, np.reshape(counts, shape), width)
    again = decode(encode(sent, codec=codec))
    assert np.array_equal(again.counts, sent.counts)
    assert again.width == width
    assert (again.vehicle, again.boot, again.seq, again.start, again.interval) == ("car.1", 1, 2, 3, 10**6)
    assert np.array_equal(again.samples, sent.samples, equal_nan=True)


def test_layout_is_the_documented_one() -> None:
    """Against a map put together by hand, as another program would."""
    counts = np.array([[1, -2, 3], [-32768, 5, -6]])
    body = cbor2.dumps(
        {0: 1, 1: "v", 2: 7, 3: 9, 4: 11, 5: 50_000, 6: 1, 7: 3, 8: ["a", "b"], 9: [0.5, 2.0], 10: [0, 4]}
        | {11: counts.astype("<i2").tobytes(), 12: 0, 13: 17, 14: "c", 99: "unknown"}
    )
    found = decode(body + zlib.crc32(body).to_bytes(4, "little"))
    assert np.array_equal(found.samples, [[0.5, -1.0, 1.5], [np.nan, 10.0, -12.0]], equal_nan=True)
    assert (found.boot, found.seq, found.monotonic, found.configuration) == (7, 9, 17, "c")
    thrice = np.array([[-2, 70000]]).astype("<i4").view(np.uint8).reshape(1, 2, 4)[..., :3].tobytes()
    body = cbor2.dumps({0: 1, 1: "v", 2: 0, 3: 0, 4: 0, 5: 50_000, 6: 0, 7: 2, 8: ["a"], 9: [1], 11: thrice, 12: 0})
    assert decode(body + zlib.crc32(body).to_bytes(4, "little")).counts.tolist() == [[-2, 70000]]


def test_bytes_of_version_1() -> None:
    """As the first program of version 1 wrote them."""
    scale, counts, flags = np.array([0.001, 0.5]), np.array([[1, -2, 300], [4, 5, -32768]]), np.array([1, 4])
    names, start = ("acc_fl", "speed"), 1_795_219_200_000_000_000
    one = Frame("car-1", 7, 3, start, 5_000_000, names, scale, counts, 2, flags, TIME_KEPT, 12345, "cafe", (6, 90))
    assert encode(one, codec=RAW).hex() == (
        "b0000101656361722d3102070303041b18e9e659d5f60000051a004c4b40060207030882666163635f666c6573706565640982fb3f50"
        "624dd2f1a9fcfb3fe00000000000000a8201040b4c0100feff2c010400050000800c000d1930390e64636166650f8206185a82f48603"
    )
    assert checked_map(encode(one)).keys() == set(range(16))


@pytest.mark.parametrize(("width", "digits"), [(2, 4), (3, 6), (4, 9)])
def test_quantisation_keeps_its_digits(width, digits) -> None:
    samples = np.random.default_rng(2).normal(size=(2, 500))
    samples[0, 3] = np.nan
    again = decode(encode(frame(samples, width=width))).samples
    assert np.nanmax(np.abs(again - samples)) < 10.0**-digits
    assert np.array_equal(np.isnan(again), np.isnan(samples))
    assert frame(samples).flags.tolist() == [MISSING, 0]


def test_what_is_beyond_the_range_is_flagged() -> None:
    counts, _, flags = quantised(np.array([[1.0, 5.0], [1.0, 0.0]]), scale=np.array([1e-4, 1e-4]))
    assert counts.tolist() == [[10000, 32767], [10000, 0]]
    assert flags.tolist() == [CLIPPED, 0]


def test_packed_is_small() -> None:
    """Slow motion of a body at 200 Hz: less than 2 bytes a sample."""
    time = np.arange(2000) / 200
    samples = np.sin(2 * np.pi * 1.5 * time)[None] + 0.003 * np.random.default_rng(3).normal(size=(4, 2000))
    assert len(encode(frame(samples))) < 1.75 * samples.size


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({0: 2}, "version 2"),
        ({7: 0}, "samples: 1 to 524288"),
        ({7: 10**9}, "samples: 1 to 524288"),
        ({11: b"123"}, "3 bytes for 600 samples"),
        ({11: "text"}, "not a byte string"),
        ({12: 9}, "codec 9"),
        ({1: "../etc"}, "not a valid name"),
        ({2: -1}, "boot=-1"),
        ({9: [float("nan")] * 3}, "scale"),
        ({8: ["a", 5, "c"]}, "short text"),
        ({3: 2**63}, "an integer"),
        ({5: 49_999}, "interval=49999"),
        ({11: zlib.compress(bytes(10**8)), 12: PACKED}, "bytes for 2401 bytes of samples"),
        ({3: 2**70}, "not a CBOR map: unexpected CBOR tag 2"),
        ({0: "9" * 10**5}, "version 9{40}: this program"),
        ({7: 2**17, 8: list("abcde"), 9: [1.0] * 5}, "5 channels of 131072 samples: 1 to 524288"),
        ({7: -1, 8: [], 9: []}, "samples: 1 to 524288"),
        ({5: 10**12}, "200 samples of 1e\\+12 ns: more than an hour"),
    ],
)
def test_frames_that_contradict_themselves_are_refused(change, words) -> None:
    document = cbor2.loads(encode(frame(), codec=RAW)[:-4]) | change
    body = cbor2.dumps(document)
    with pytest.raises(FormatError, match=words):
        decode(body + zlib.crc32(body).to_bytes(4, "little"))


def sealed(body):
    return body + zlib.crc32(body).to_bytes(4, "little")


#: Prints the peak of memory while a payload is refused, and the refusal.
REFUSED = """
import sys, tracemalloc
from sprung.errors import FormatError
from sprung.link import decode
payload = sys.stdin.buffer.read()
tracemalloc.start()
try:
    decode(payload)
except FormatError as error:
    print(tracemalloc.get_traced_memory()[1], error)
"""


def test_a_bomb_that_claims_its_size_is_not_unpacked() -> None:
    """Counts of 64 MB: over 1 GB as they are worked on. In a process of its own, whose memory no other thread takes."""
    n_channels, n_samples = 256, 1 << 17
    claimed = {7: n_samples, 8: [f"c{k}" for k in range(n_channels)], 9: [1.0] * n_channels, 10: [0] * n_channels}
    data = zlib.compress(bytes(2 * n_channels * n_samples))
    payload = message(cbor2.loads(encode(frame())[:-4]) | claimed | {11: data})
    assert len(payload) < LARGEST
    shown = subprocess.run([sys.executable, "-c", REFUSED], input=payload, capture_output=True, check=True).stdout
    peak, refusal = shown.decode().split(maxsplit=1)
    assert "256 channels of 131072 samples" in refusal
    assert int(peak) < LARGEST


@pytest.mark.parametrize(("n_channels", "width"), [(1, 2), (1, 4), (256, 2), (128, 4)])
def test_the_largest_frame_is_read_in_bounded_memory(memory_below, n_channels, width) -> None:
    counts = np.random.default_rng(4).integers(-3, 4, size=(n_channels, MAX_SAMPLES // n_channels))
    names = tuple(f"c{k}" for k in range(n_channels))
    payload = encode(Frame("v", 1, 1, 1, 3 * 10**6, names, np.ones(n_channels), counts, width))
    with memory_below(20 * LARGEST):
        assert np.array_equal(decode(payload).counts, counts)


def test_more_samples_in_a_second_than_a_monitor_takes_are_refused() -> None:
    """256 channels at 20 kHz would be windows of gigabytes."""
    names, counts = tuple(f"c{k}" for k in range(256)), np.zeros((256, 10), dtype=np.int16)
    words = (
        "256 channels at 20000 Hz are 5120000 samples/s, a vehicle may send 200000: leave out channels or send a lower"
    )
    with pytest.raises(ParameterError, match=words):
        Frame("v", 1, 1, 1, 50_000, names, np.ones(256), counts)
    payload = encode(Frame("v", 1, 1, 1, 2_560_000, names, np.ones(256), counts))
    for read in (decode, lambda payload: check_frame(payload, "v")):
        with pytest.raises(FormatError, match=words):
            read(message(checked_map(payload) | {5: 50_000}))


@pytest.mark.parametrize("start", [LATEST + 1, 2**63 - 1, -LATEST - 1])
def test_times_that_sums_would_carry_beyond_64_bits_are_refused(start) -> None:
    payload = message(checked_map(encode(frame())) | {4: start})
    with pytest.raises(FormatError, match="start="):
        check_frame(payload, "bus-17")
    if start > 0:
        with pytest.raises(FormatError, match=f"start={start} is after the year 2199: set the clock of the box"):
            Header.of(checked_map(payload))


def test_a_checked_frame_is_of_its_vehicle() -> None:
    payload = encode(frame(previous=(2, 90)))
    assert check_frame(payload, "bus-17") == Header.of(checked_map(payload))
    with pytest.raises(FormatError, match=r"a frame of 'bus-17' on the topic of 'bus-18'"):
        check_frame(payload, "bus-18")


def test_a_frame_that_is_checked_can_be_decoded_and_no_other() -> None:
    """Any change of any field, and of any bytes, is refused by both or by none."""
    generator = random.Random(7)
    originals = [encode(frame(np.ones((2, 8)), width=2 + k % 3), codec=k % 2) for k in range(6)]
    values: list[object] = [
        None,
        -1,
        0,
        1,
        2**63,
        2**64 - 1,
        -(2**63),
        "x",
        b"y",
        [],
        {},
        1.5,
        True,
        float("nan"),
        [1, 2],
        ["a"],
    ]
    n_read = 0
    for number in range(3000):
        if number % 2:
            payload = mutated(originals[number % 6], generator, is_sealed=True)
        else:
            key, value = generator.randrange(17), generator.choice(values)
            payload = message(checked_map(originals[number % 6]) | {key: value})
        outcomes = []
        for read in (decode, lambda payload: check_frame(payload, "bus-17")):
            try:
                found = read(payload)
                outcomes.append(
                    (found.boot, found.seq, found.start) if getattr(found, "vehicle", "bus-17") == "bus-17" else None
                )
            except FormatError:
                outcomes.append(None)
        assert outcomes[0] == outcomes[1]
        n_read += outcomes[0] is not None
    assert n_read > 100


def test_a_message_of_many_small_things_is_refused_before_it_is_read(memory_below) -> None:
    """A byte can be an empty map, of 80 bytes with its place in a list."""
    with (
        memory_below(4 * LARGEST),
        pytest.raises(FormatError, match="a message of more than 16384 values: send fewer"),
    ):
        decode(sealed(b"\xa1\x00\x9a" + (10**6).to_bytes(4, "big") + b"\xa0" * 10**6))


def mutated(payload, generator, *, is_sealed):
    """A frame with bytes changed, cut, doubled or put in; sealed again where asked."""
    octets = bytearray(payload[:-4] if is_sealed else payload)
    below = generator.randrange
    for _ in range(below(1, 5)):
        place, kind = below(len(octets)), below(4)
        if kind == 0:
            octets[place] = below(256)
        elif kind == 1:
            del octets[place : place + below(1, 20)]
        elif kind == 2:
            octets[place:place] = octets[place : place + below(1, 20)]
        else:
            octets[place:place] = generator.randbytes(below(1, 9))
        octets = octets or bytearray(1)
    body = bytes(octets)
    return body + zlib.crc32(body).to_bytes(4, "little") if is_sealed else body
