"""Frames: a second or so of a vehicle's samples as bytes (version 1: one CBOR map and 4 bytes CRC-32 of it)."""

import io
import re
import sys
import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sprung._arrays import Real
from sprung._checks import check_number, frozen_array, required
from sprung.errors import FormatError, ParameterError

VERSION = 1
#: Names of vehicles, which are parts of topics and of paths.
VEHICLE = re.compile(r"(?!\.{1,2}$)[A-Za-z0-9_.-]{1,64}")
#: Largest frame [bytes], most channels, and most samples of all channels in one: what it holds unpacked.
LARGEST, MOST_CHANNELS, MOST_SAMPLES = 1 << 20, 256, 1 << 19
#: Longest frame [ns]: one could hold windows without number, each of them work. Least time between samples [ns]: a
#: window of a higher rate would never be complete.
LONGEST, LEAST_INTERVAL = 3600 * 10**9, 50_000
#: Bits of a channel's flag.
CLIPPED, STUCK, MISSING = 1, 2, 4
#: Status of the time of a frame: nobody knows, set once, kept by a time server.
TIME_UNKNOWN, TIME_SET, TIME_KEPT = 0, 1, 2
#: Codecs of the data.
RAW, PACKED = 0, 1
_WIDTHS = (2, 3, 4)
_KEYS = ("version", "vehicle", "boot", "seq", "start", "interval", "time status", "samples", "channels", "scale")


class VersionError(FormatError):
    """A frame of another version of the format."""


class _Untagged(dict[int, Any]):
    """Refuses all tags of CBOR: one decimal of a megabyte, or a date, pattern or set, is work that no message needs."""

    def __missing__(self, tag: int) -> None:
        raise FormatError(f"tag {tag} stands where none belongs")


@dataclass(frozen=True, eq=False, slots=True)
class Frame:
    """Samples of all channels of a vehicle over a short time, as integers.

    Parameters
    ----------
    vehicle
        Up to 64 letters, digits, "_", "." or "-".
    boot, seq
        Number of the box' start, and of the frame since then, from 0.
    start, interval
        Time of the first sample, UTC ns since 1970, and between samples [ns], at least 50 us.
    time_status
        `TIME_UNKNOWN`, `TIME_SET` or `TIME_KEPT`.
    channels
        Names.
    scale
        SI units per count, shape (channels,).
    flags
        Bits `CLIPPED`, `STUCK`, `MISSING` of each channel, shape (channels,).
    counts
        Shape (channels, samples), within `width` bytes; the lowest integer of that width stands for a missing value.
    width
        Bytes of a count: 2, 3 or 4.
    monotonic
        The box' own clock at the first sample [ns], which no time server moves.
    configuration
        Of the vehicle file that the box goes by.
    previous
        Number of the boot before and of its frames, where the box knows: what follows waits for them.
    """

    vehicle: str
    boot: int
    seq: int
    start: int
    interval: int
    channels: tuple[str, ...]
    scale: Real
    counts: NDArray[np.signedinteger]
    width: int = 2
    flags: NDArray[np.int64] | None = None
    time_status: int = TIME_SET
    monotonic: int = 0
    configuration: str = ""
    previous: tuple[int, int] | None = None

    def __post_init__(self) -> None:
        check_vehicle(self.vehicle)
        for name in ("boot", "seq", "monotonic"):
            check_number(name, getattr(self, name), at_least=0, at_most=2**63 - 1)
        check_number("interval", self.interval, at_least=LEAST_INTERVAL, at_most=10**12)
        flags = np.zeros(len(self.channels)) if self.flags is None else self.flags
        if self.width not in _WIDTHS:
            raise ParameterError(f"width={self.width} must be 2, 3 or 4 bytes")
        # A monitor keeps minutes of frames of many vehicles.
        narrow = np.int16 if self.width == 2 else np.int32
        for name, ndim, dtype in (("scale", 1, np.float64), ("flags", 1, np.int64), ("counts", 2, narrow)):
            value = flags if name == "flags" else getattr(self, name)
            object.__setattr__(self, name, frozen_array(name, value, ndim=ndim, dtype=dtype))
        if self.counts.shape[0] != len(self.channels) or self.scale.size != len(self.channels):
            raise ParameterError(
                f"{len(self.channels)} channels, but counts {self.counts.shape}: give one row for each"
            )
        if self.width not in _WIDTHS:
            raise ParameterError(f"width={self.width} must be 2, 3 or 4 bytes")

    @property
    def n_samples(self) -> int:
        """Samples of each channel."""
        return int(self.counts.shape[1])

    @property
    def samples(self) -> Real:
        """Samples in SI units, NaN where missing, shape (channels, samples)."""
        values = self.counts * self.scale[:, None]
        values[self.counts == _lowest(self.width)] = np.nan
        return np.asarray(values, dtype=np.float64)


def check_vehicle(vehicle: str) -> str:
    """Return a vehicle's name, or say what is wrong with it."""
    if not VEHICLE.fullmatch(vehicle):
        raise ParameterError(
            f"vehicle {vehicle!r} is no name for one: use up to 64 letters, digits, '_', '-' and '.', such as 'bus-17'"
        )
    return vehicle


def quantised(
    samples: Real, *, width: int = 2, scale: Real | None = None
) -> tuple[NDArray[np.int64], Real, NDArray[np.int64]]:
    """Return samples as integers, the scale and the flags.

    Parameters
    ----------
    samples
        Shape (channels, samples), SI; NaN where missing.
    width
        Bytes of a count.
    scale
        SI units per count, shape (channels,); None: the largest sample of each channel fills the range.

    Returns
    -------
    tuple
        counts, scale and flags. Values beyond the range are cut off and flagged.
    """
    values = np.asarray(samples, dtype=np.float64)
    missing = ~np.isfinite(values)
    highest = -_lowest(width) - 1
    if scale is None:
        largest = np.max(np.abs(values), axis=1, initial=0.0, where=~missing)
        scale = np.where(largest > 0, largest / highest, 1.0)
    counts = np.rint(np.where(missing, 0.0, values) / scale[:, None])
    clipped = np.abs(counts) > highest
    counts = np.clip(counts, -highest, highest).astype(np.int64)
    counts[missing] = _lowest(width)
    flags = CLIPPED * clipped.any(axis=1).astype(np.int64) + MISSING * missing.any(axis=1).astype(np.int64)
    return counts, scale, np.asarray(flags, dtype=np.int64)


def encode(frame: Frame, *, codec: int = PACKED) -> bytes:
    """Return a frame as bytes.

    Parameters
    ----------
    frame
        Any.
    codec
        `RAW`, or `PACKED`: differences along each channel, bytes of equal weight together, then zlib.
    """
    cbor = required("cbor2", purpose="frames", extra="online")
    flags = frame.flags if frame.flags is not None else np.zeros(len(frame.channels), dtype=np.int64)
    document = {
        0: VERSION,
        1: frame.vehicle,
        2: frame.boot,
        3: frame.seq,
        4: frame.start,
        5: frame.interval,
        6: frame.time_status,
        7: frame.n_samples,
        8: list(frame.channels),
        9: frame.scale.tolist(),
        10: flags.tolist(),
        11: _data(frame.counts, frame.width, codec),
        12: codec,
        13: frame.monotonic,
        14: frame.configuration,
    }
    if frame.previous is not None:
        document[15] = list(frame.previous)
    body: bytes = cbor.dumps(document)
    return body + zlib.crc32(body).to_bytes(4, "little")


def decode(payload: bytes) -> Frame:
    """Return the frame of bytes.

    Raises
    ------
    FormatError
        Where they are no frame of version 1 (`VersionError`: of another); nothing else, whatever they are.

    Notes
    -----
    Unknown keys are ignored. The checksum is compared before anything else is read.
    """
    document = checked_map(payload)
    version = document.get(0)
    if version != VERSION:
        raise VersionError(f"a frame of version {str(version)[:40]}: this program reads version {VERSION}, update it")
    missing = [name for key, name in enumerate(_KEYS) if key not in document]
    if missing or 11 not in document:
        raise FormatError(f"a frame without {(missing or ['data'])[0]}: send all of the keys 0 to 11")
    try:
        # One copy of each name, however many frames a monitor keeps.
        channels = tuple(sys.intern(_text(name)) for name in _list(document[8]))
        n_samples = _number(document[7])
        if not 0 < n_samples * len(channels) <= MOST_SAMPLES:
            raise FormatError(
                f"a frame with {len(channels)} channels of {n_samples} samples: that is none, or too many"
            )
        interval = _number(document[5])
        if n_samples * interval > LONGEST:
            raise FormatError(
                f"a frame with {n_samples} samples of {interval:g} ns: more than an hour, send shorter ones"
            )
        counts, width = _counts(document[11], _number(document.get(12, RAW)), len(channels), n_samples)
        scale = np.array([float(value) for value in _list(document[9])])
        if not np.all(np.isfinite(scale)):
            raise FormatError("a frame whose scale is no number: send SI units per count")
        return Frame(
            vehicle=_text(document[1]),
            boot=_number(document[2]),
            seq=_number(document[3]),
            start=_number(document[4]),
            interval=interval,
            channels=channels,
            scale=scale,
            counts=counts,
            width=width,
            flags=np.array([_number(flag) for flag in _list(document.get(10, [0] * len(channels)))]),
            time_status=_number(document[6]),
            monotonic=_number(document.get(13, 0)),
            configuration=_text(document.get(14, "")),
            previous=_previous(document.get(15)),
        )
    except (ParameterError, TypeError, ValueError, OverflowError) as error:
        raise FormatError(f"a frame that contradicts itself: {error}") from None


def checked_map(payload: bytes) -> dict[Any, Any]:
    """Return the CBOR map in front of its CRC-32.

    Raises
    ------
    FormatError
        Where there is none.
    """
    cbor = required("cbor2", purpose="frames", extra="online")
    if not 8 <= len(payload) <= LARGEST:
        raise FormatError(f"{len(payload)} bytes are no message: between 8 and {LARGEST} are")
    body, check = payload[:-4], payload[-4:]
    if zlib.crc32(body).to_bytes(4, "little") != check:
        raise FormatError("the checksum does not agree: the message was damaged on its way")
    stream = io.BytesIO(body)
    try:
        decoder = cbor.CBORDecoder(
            stream, max_depth=8, allow_indefinite=False, allow_duplicate_keys=False, semantic_decoders=_Untagged()
        )
        document = decoder.decode()
    except (cbor.CBORError, ValueError, TypeError, OverflowError, RecursionError, MemoryError) as error:
        raise FormatError(f"the message is no CBOR map: {error.__cause__ or error}") from None
    if not isinstance(document, dict) or stream.tell() != len(body):
        raise FormatError("the message is no single CBOR map")
    return document


def message(document: dict[Any, Any]) -> bytes:
    """Return a map as bytes with its CRC-32; the opposite of `checked_map`."""
    cbor = required("cbor2", purpose="frames", extra="online")
    body: bytes = cbor.dumps(document)
    return body + zlib.crc32(body).to_bytes(4, "little")


def _lowest(width: int) -> int:
    """Lowest integer of a width in bytes."""
    return -(1 << (8 * width - 1))


def _data(counts: NDArray[np.signedinteger], width: int, codec: int) -> bytes:
    """Return counts as bytes."""
    if codec == RAW:
        return _octets(counts, width).tobytes()
    if codec != PACKED:
        raise ParameterError(f"codec={codec} must be {RAW} (raw) or {PACKED} (packed)")
    wide = counts.astype(np.int64)
    steps = np.concatenate([wide[:, :1], wide[:, 1:] - wide[:, :-1]], axis=1)
    return zlib.compress(np.moveaxis(_octets(steps, width), -1, 0).tobytes(), 6)


def _octets(counts: NDArray[np.signedinteger], width: int) -> NDArray[np.uint8]:
    """Return the low bytes of integers, little-endian, shape (channels, samples, width)."""
    eight = np.ascontiguousarray(counts, dtype="<i8").view(np.uint8).reshape(*counts.shape, 8)
    return np.ascontiguousarray(eight[..., :width])


def _counts(data: Any, codec: int, n_channels: int, n_samples: int) -> tuple[NDArray[np.int64], int]:
    """Return the counts of bytes, and their width."""
    if not isinstance(data, bytes):
        raise FormatError("a frame whose data is no bytes")
    size = n_channels * n_samples
    if codec == PACKED:
        unpacking = zlib.decompressobj()
        try:
            data = unpacking.decompress(data, 4 * size + 1)
        except zlib.error as error:
            raise FormatError(f"a frame whose data cannot be unpacked: {error}") from None
    elif codec != RAW:
        raise FormatError(f"a frame with the codec {codec}: this program knows {RAW} and {PACKED}, update it")
    width, rest = divmod(len(data), size)
    if rest or width not in _WIDTHS:
        raise FormatError(f"a frame with {len(data)} bytes for {size} samples: 2, 3 or 4 for each are possible")
    octets = np.frombuffer(data, dtype=np.uint8)
    if codec == PACKED:
        steps = _integers(np.moveaxis(octets.reshape(width, n_channels, n_samples), 0, -1), width)
        # Sums wrap around as the differences did.
        return _integers(_octets(np.cumsum(steps, axis=1), width), width), width
    return _integers(octets.reshape(n_channels, n_samples, width), width), width


def _integers(octets: NDArray[np.uint8], width: int) -> NDArray[np.int64]:
    """Return the signed integers of little-endian bytes."""
    eight = np.zeros((*octets.shape[:-1], 8), dtype=np.uint8)
    eight[..., 8 - width :] = octets
    return np.asarray(eight.view("<i8")[..., 0] >> (8 * (8 - width)), dtype=np.int64)


def _previous(value: Any) -> tuple[int, int] | None:
    """Return boot and number of frames of the boot before."""
    if value is None:
        return None
    boot, count = (_number(one) for one in _list(value))
    return boot, count


def _number(value: Any) -> int:
    """Return an integer, or refuse what is none."""
    if not isinstance(value, int) or isinstance(value, bool) or abs(value) >= 2**63:
        raise FormatError(f"{str(value)[:40]!r} stands where an integer belongs")
    return value


def _text(value: Any) -> str:
    """Return a short text, or refuse what is none."""
    if not isinstance(value, str) or len(value) > 256 or "\0" in value:
        raise FormatError(f"{str(value)[:40]!r} stands where a short text belongs")
    return value


def _list(value: Any) -> list[Any]:
    """Return a list, or refuse what is none."""
    if not isinstance(value, list) or len(value) > MOST_CHANNELS:
        raise FormatError(f"{str(value)[:40]!r} stands where a list belongs")
    return value
