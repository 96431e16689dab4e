"""Messages: one CBOR map with named keys, followed by 4 bytes CRC-32 of it, on topics sprung/v1/{vehicle}/{what}."""

import io
import re
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, NamedTuple

from sprung._checks import required
from sprung.errors import FormatError, ParameterError

VERSION = 1
ROOT = "sprung/v1"
#: Kinds of messages from a vehicle, and to it.
UPWARDS = ("raw", "corr", "modes", "event", "health", "meta", "state")
DOWNWARDS = ("ack", "cmd")
#: Names of vehicles, which are parts of topics and of paths.
VEHICLE = re.compile(r"(?!\.{1,2}$)[A-Za-z0-9_.-]{1,64}")
#: Largest message [bytes].
LARGEST = 1 << 20
#: Largest number of entries of a list in it.
MAX_CHANNELS = 256
#: Largest number of values of all maps and lists of a message, which bounds the time to read it; smaller messages than
#: this many bytes cannot hold more.
MAX_VALUES = 16_384
#: Kinds of messages with the results of on-board identification in place of samples.
REPORTS = ("corr", "modes")
#: Largest number of boots in a state; later ones follow when those are acknowledged.
MAX_BOOTS = 32
#: Latest time of a sample, UTC ns: the beginning of 2200. Times that are computed from it have 64 bits.
LATEST = 7_258_118_400 * 10**9


class Key(IntEnum):
    """Numbered keys of the maps on the wire."""

    VERSION = 0
    VEHICLE = 1
    BOOT = 2
    SEQ = 3
    START = 4
    INTERVAL = 5
    TIME_STATUS = 6
    N_SAMPLES = 7
    CHANNELS = 8
    SCALE = 9
    FLAGS = 10
    DATA = 11
    CODEC = 12
    MONOTONIC = 13
    CONFIGURATION = 14
    PREVIOUS = 15
    KIND = 16


class VersionError(FormatError):
    """A frame of another version of the format."""


class _Untagged(dict[int, Any]):
    """Refuses all CBOR tags: no message needs decimals, dates or patterns, which can be costly to decode."""

    def __missing__(self, tag: int) -> None:
        raise FormatError(f"unexpected CBOR tag {tag}: send plain numbers, texts, bytes, lists and maps")


@dataclass(frozen=True, slots=True)
class Header:
    """Place of a frame or report in the sequence of its box, and the time that it covers.

    Parameters
    ----------
    boot, seq
        Number of the box's start, and of the message since then, from 0.
    start
        Time of the first sample, UTC ns.
    interval
        Time between samples [ns].
    n_samples
        Number of samples of each channel.
    kind
        "raw", "corr" or "modes".
    previous
        Number of the previous boot, and number of its messages, after which this one continues; None if unknown.
    """

    boot: int
    seq: int
    start: int
    interval: int = 0
    n_samples: int = 0
    kind: str = "raw"
    previous: tuple[int, int] | None = None

    @classmethod
    def of(cls, document: Mapping[Any, Any]) -> "Header":
        """Return the header of a message.

        Raises
        ------
        FormatError
            If boot, sequence number or time is missing or out of range.
        """
        start = count(document, Key.START)
        if start > LATEST:
            raise FormatError(f"start={start} is after the year 2199: set the clock of the box")
        return cls(
            boot=count(document, Key.BOOT),
            seq=count(document, Key.SEQ),
            start=start,
            interval=count(document, Key.INTERVAL, 0),
            n_samples=count(document, Key.N_SAMPLES, 0),
            kind=text(document.get(Key.KIND, "raw")),
            previous=previous_boot(document.get(Key.PREVIOUS)),
        )

    @property
    def end(self) -> int:
        """Time after the last sample, UTC ns."""
        return self.start + self.interval * self.n_samples


def check_vehicle(vehicle: str) -> str:
    """Return the name of a vehicle.

    Raises
    ------
    ParameterError
        If the name cannot be part of a topic.

    Examples
    --------
    >>> check_vehicle("bus-17")
    'bus-17'
    >>> check_vehicle("bus/17")
    Traceback (most recent call last):
        ...
    sprung.errors.ParameterError: vehicle 'bus/17' is not a valid name: use up to 64 letters, digits, ...
    """
    if not VEHICLE.fullmatch(vehicle):
        raise ParameterError(
            f"vehicle {vehicle!r} is not a valid name: use up to 64 letters, digits, '_', '-' and '.', such as 'bus-17'"
        )
    return vehicle


def checked_map(payload: bytes) -> dict[Any, Any]:
    """Return the CBOR map in front of its CRC-32.

    Raises
    ------
    FormatError
        If the bytes are not a message.

    Examples
    --------
    >>> payload = message({"lost": []})
    >>> checked_map(payload)
    {'lost': []}
    >>> checked_map(payload[:-1] + b"?")
    Traceback (most recent call last):
        ...
    sprung.errors.FormatError: the checksum does not match: the message was damaged in transit
    """
    cbor = required("cbor2", purpose="frames", extra="online")
    if not 8 <= len(payload) <= LARGEST:
        raise FormatError(f"a message of {len(payload)} bytes: it must have between 8 and {LARGEST}")
    body, check = payload[:-4], payload[-4:]
    if zlib.crc32(body).to_bytes(4, "little") != check:
        raise FormatError("the checksum does not match: the message was damaged in transit")
    if len(body) > MAX_VALUES and _n_values(body) > MAX_VALUES:
        raise FormatError(f"a message of more than {MAX_VALUES} values: send fewer, and samples as bytes")
    stream = io.BytesIO(body)
    try:
        decoder = cbor.CBORDecoder(
            stream, max_depth=8, allow_indefinite=False, allow_duplicate_keys=False, semantic_decoders=_Untagged()
        )
        document = decoder.decode()
    except (cbor.CBORError, ValueError, TypeError, OverflowError, RecursionError, MemoryError) as error:
        raise FormatError(f"the message is not a CBOR map: {error.__cause__ or error}") from None
    if not isinstance(document, dict) or stream.tell() != len(body):
        raise FormatError("the message is not a single CBOR map")
    return document


def _n_values(body: bytes) -> int:
    """Return the number of values in CBOR, counted up to the limit or to what is not well-formed (RFC 8949, 3)."""
    place, n_open, n_values = 0, 1, 0
    try:
        while n_open and n_values <= MAX_VALUES:
            kind, length = body[place] >> 5, body[place] & 31
            place += 1
            n_open -= 1
            n_values += 1
            if 24 <= length < 28:
                size = 1 << (length - 24)
                length = int.from_bytes(body[place : place + size])
                place += size
            if kind in {2, 3}:  # bytes, text
                place += length
            elif kind in {4, 5}:  # list, map
                n_open += length * (kind - 3)
            elif kind == 6:  # tag
                n_open += 1
    except IndexError:
        return n_values
    return n_values


def message(document: Mapping[Any, Any]) -> bytes:
    """Return a map as bytes with its CRC-32; the opposite of `checked_map`.

    Examples
    --------
    >>> payload = message({"description": "depot car"})
    >>> len(payload), checked_map(payload)
    (27, {'description': 'depot car'})
    """
    cbor = required("cbor2", purpose="frames", extra="online")
    body: bytes = cbor.dumps(document)
    return body + zlib.crc32(body).to_bytes(4, "little")


def checksum(payload: bytes) -> int:
    """Return the CRC-32 at the end of a message."""
    return int.from_bytes(payload[-4:], "little")


def count(document: Mapping[Any, Any], key: int | str, default: int | None = None) -> int:
    """Return a whole number from 0 to 2^63 - 1 of a message.

    Raises
    ------
    FormatError
        If it is missing without a default, or not such a number.
    """
    value = integer(document.get(key, default))
    if value < 0:
        name = key.name.lower() if isinstance(key, Key) else key
        raise FormatError(f"{name}={value} must be at least 0")
    return value


def integer(value: Any) -> int:
    """Return a 64-bit integer.

    Raises
    ------
    FormatError
        If it is something else.
    """
    if not isinstance(value, int) or isinstance(value, bool) or abs(value) >= 2**63:
        raise FormatError(f"{str(value)[:40]!r} found where an integer is expected")
    return value


def text(value: Any) -> str:
    """Return a short text.

    Raises
    ------
    FormatError
        If it is something else.
    """
    if not isinstance(value, str) or len(value) > 256 or "\0" in value:
        raise FormatError(f"{str(value)[:40]!r} found where a short text is expected")
    return value


def items(value: Any) -> list[Any]:
    """Return a list with at most one entry for each channel.

    Raises
    ------
    FormatError
        If it is something else.
    """
    if not isinstance(value, list) or len(value) > MAX_CHANNELS:
        raise FormatError(f"{str(value)[:40]!r} found where a list is expected")
    return value


def previous_boot(value: Any) -> tuple[int, int] | None:
    """Return the number of the previous boot and of its messages; None if there was none.

    Raises
    ------
    FormatError
        If it is something else.
    """
    if value is None:
        return None
    numbers = [integer(number) for number in items(value)]
    if len(numbers) != 2 or min(numbers) < 0:
        raise FormatError(f"{str(value)[:40]!r} found where boot and count of messages before are expected")
    return numbers[0], numbers[1]


def topic(vehicle: str, what: str) -> str:
    """Return the topic of a vehicle's messages.

    Examples
    --------
    >>> topic("bus-17", "raw")
    'sprung/v1/bus-17/raw'
    """
    return f"{ROOT}/{vehicle}/{what}"


def parse_topic(name: str) -> tuple[str, str]:
    """Return vehicle and kind of message of a topic.

    Raises
    ------
    FormatError
        If it is not a topic of this version.

    Examples
    --------
    >>> parse_topic("sprung/v1/bus-17/raw")
    ('bus-17', 'raw')
    """
    parts = name.split("/")
    if len(parts) != 4 or "/".join(parts[:2]) != ROOT or not VEHICLE.fullmatch(parts[2]):
        raise FormatError(f"{name[:120]!r} is not a topic of this version: it must be {ROOT}/VEHICLE/WHAT")
    return parts[2], parts[3]


#: Largest number of losses in a message.
MAX_LOSSES = 64
_LARGEST = 2**63 - 1


class Loss(NamedTuple):
    """Frames of one boot that were dropped.

    Parameters
    ----------
    boot
        Number of the box's start.
    first, last
        Sequence numbers of the first and the last of them.
    n_frames
        Number of them.
    begin, end
        Times of the first sample and after the last one, UTC ns; 0 if unknown.
    """

    boot: int
    first: int
    last: int
    n_frames: int
    begin: int = 0
    end: int = 0

    def joined(self, other: "Loss") -> "Loss":
        """Return this loss together with another one of the same boot."""
        begin, end = span_of([self, other])
        first, last = min(self.first, other.first), max(self.last, other.last)
        return Loss(self.boot, first, last, self.n_frames + other.n_frames, begin, end)


def span_of(losses: Iterable[Loss]) -> tuple[int, int]:
    """Return the times of the first sample and after the last one of losses, UTC ns; 0 if unknown.

    Examples
    --------
    >>> span_of([Loss(1, 7, 8, 2, begin=3 * 10**9, end=5 * 10**9), Loss(1, 9, 9, 1, begin=5 * 10**9, end=6 * 10**9)])
    (3000000000, 6000000000)
    """
    known = [(loss.begin, loss.end) for loss in losses if loss.begin]
    return min((begin for begin, _ in known), default=0), max((end for _, end in known), default=0)


def loss_of(boot: int, first: int, last: int, payloads: Iterable[bytes]) -> Loss:
    """Return the loss of the frames of a boot from `first` to `last`, with the times that their payloads state."""
    headers = []
    for payload in payloads:
        try:
            headers.append(Header.of(checked_map(payload)))
        except FormatError:
            continue
    begin = min((header.start for header in headers), default=0)
    return Loss(boot, first, last, last - first + 1, begin, max((header.end for header in headers), default=0))


def losses_in(document: Mapping[Any, Any]) -> list[Loss]:
    """Return the losses that a state message of a box states; empty if an older program wrote it.

    Raises
    ------
    FormatError
        If they are too many, or not of the form of `Loss`.

    Examples
    --------
    >>> losses_in({"lost": [[1, 7, 8, 2, 3_000_000_000, 5_000_000_000]]})
    [Loss(boot=1, first=7, last=8, n_frames=2, begin=3000000000, end=5000000000)]
    """
    entries = document.get("lost", [])
    if not isinstance(entries, list) or len(entries) > MAX_LOSSES:
        raise FormatError(f"lost frames that are not a list of at most {MAX_LOSSES}")
    return [_loss(entry) for entry in entries]


def _loss(entry: Any) -> Loss:
    """Return a loss from its numbers."""
    is_valid = (
        isinstance(entry, list)
        and len(entry) == len(Loss._fields)
        and all(type(number) is int and 0 <= number < _LARGEST for number in entry)
        and entry[1] <= entry[2]
    )
    if not is_valid:
        raise FormatError(f"{str(entry)[:40]!r} found where {', '.join(Loss._fields)} of lost frames are expected")
    return Loss(*entry)
