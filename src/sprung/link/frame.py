"""Frames: a second or so of a vehicle's samples as bytes."""

import sys
import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sprung._arrays import Indices, Real
from sprung._checks import check_number, frozen_array
from sprung.errors import FormatError, ParameterError
from sprung.link.messages import (
    VERSION,
    Key,
    VersionError,
    check_vehicle,
    checked_map,
    integer,
    items,
    message,
    previous_boot,
    text,
)

#: Largest number of samples of all channels in a frame, which bounds its size unpacked.
MOST_SAMPLES = 1 << 19
#: Longest frame [ns]: a longer one could hold any number of windows, each of which takes time. Shortest time between
#: samples [ns]: a window of a higher rate would never be complete.
LONGEST, LEAST_INTERVAL = 3600 * 10**9, 50_000
#: Bits of a channel's flag.
CLIPPED, STUCK, MISSING = 1, 2, 4
#: Status of the time of a frame: unknown, set once, kept by a time server.
TIME_UNKNOWN, TIME_SET, TIME_KEPT = 0, 1, 2
#: Codecs of the data.
RAW, PACKED = 0, 1
_WIDTHS = (2, 3, 4)
#: Keys without which a frame is incomplete; a missing list of flags means no flags.
_REQUIRED = tuple(key for key in Key if key <= Key.DATA and key != Key.FLAGS)


@dataclass(frozen=True, eq=False, slots=True)
class Frame:
    """Samples of all channels of a vehicle over a short time, as integers.

    Parameters
    ----------
    vehicle
        Name of the vehicle: up to 64 letters, digits, "_", "." or "-".
    boot, seq
        Number of the box's start, and of the frame since then, from 0.
    start
        Time of the first sample, UTC ns since 1970.
    interval
        Time between samples [ns], at least 50 us.
    time_status
        `TIME_UNKNOWN`, `TIME_SET` or `TIME_KEPT`.
    channels
        Names of the channels.
    scale
        SI units per count, shape (channels,).
    flags
        Bits `CLIPPED`, `STUCK`, `MISSING` of each channel, shape (channels,); None: no flag is set.
    counts
        Integers within `width` bytes, shape (channels, samples); the lowest one stands for a missing value.
    width
        Bytes of a count: 2, 3 or 4.
    monotonic
        Monotonic clock of the box at the first sample [ns].
    configuration
        Hash of the vehicle file of the box.
    previous
        Number of the previous boot, and number of its frames; None if unknown. This boot is analysed after them.

    Raises
    ------
    ParameterError
        If a value is out of range, or the shapes are inconsistent.
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
    flags: Indices | None = None
    time_status: int = TIME_SET
    monotonic: int = 0
    configuration: str = ""
    previous: tuple[int, int] | None = None

    def __post_init__(self) -> None:
        check_vehicle(self.vehicle)
        for name in ("boot", "seq", "monotonic"):
            check_number(name, getattr(self, name), at_least=0, at_most=2**63 - 1)
        check_number("interval", self.interval, at_least=LEAST_INTERVAL, at_most=10**12)
        if self.width not in _WIDTHS:
            raise ParameterError(f"width={self.width} must be 2, 3 or 4 bytes")
        # A monitor keeps minutes of frames of many vehicles.
        narrow = np.int16 if self.width == 2 else np.int32
        for name, ndim, dtype in (("scale", 1, np.float64), ("flags", 1, np.int64), ("counts", 2, narrow)):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, frozen_array(name, value, ndim=ndim, dtype=dtype))
        if self.counts.shape[0] != len(self.channels) or self.scale.size != len(self.channels):
            raise ParameterError(
                f"{len(self.channels)} channels, but counts of shape {self.counts.shape} and {self.scale.size} scales: "
                "give one row and one scale for each"
            )

    @property
    def is_time_known(self) -> bool:
        """Whether the time is that of the measurement."""
        return self.time_status != TIME_UNKNOWN

    @property
    def n_samples(self) -> int:
        """Number of samples of each channel."""
        return int(self.counts.shape[1])

    @property
    def samples(self) -> Real:
        """Samples in SI units, NaN where missing, shape (channels, samples)."""
        values = self.counts * self.scale[:, None]
        values[self.counts == _lowest(self.width)] = np.nan
        return np.asarray(values, dtype=np.float64)


def quantised(samples: Real, *, width: int = 2, scale: Real | None = None) -> tuple[Indices, Real, Indices]:
    """Return samples as integers, the scale and the flags.

    Parameters
    ----------
    samples
        Samples in SI units, NaN where missing, shape (channels, samples).
    width
        Bytes of a count.
    scale
        SI units per count, shape (channels,); None: the largest sample of each channel fills the range.

    Returns
    -------
    tuple
        Counts, scale and flags as in `Frame`. Values beyond the range are clipped and flagged.
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
        Frame to encode.
    codec
        `RAW`, or `PACKED`: differences along each channel, bytes of equal weight together, then zlib.

    Raises
    ------
    ParameterError
        If the codec is unknown.
    """
    document: dict[int, Any] = {
        Key.VERSION: VERSION,
        Key.VEHICLE: frame.vehicle,
        Key.BOOT: frame.boot,
        Key.SEQ: frame.seq,
        Key.START: frame.start,
        Key.INTERVAL: frame.interval,
        Key.TIME_STATUS: frame.time_status,
        Key.N_SAMPLES: frame.n_samples,
        Key.CHANNELS: list(frame.channels),
        Key.SCALE: frame.scale.tolist(),
        Key.FLAGS: [0] * len(frame.channels) if frame.flags is None else frame.flags.tolist(),
        Key.DATA: _data(frame.counts, frame.width, codec),
        Key.CODEC: codec,
        Key.MONOTONIC: frame.monotonic,
        Key.CONFIGURATION: frame.configuration,
    }
    if frame.previous is not None:
        document[Key.PREVIOUS] = list(frame.previous)
    return message(document)


def decode(payload: bytes) -> Frame:
    """Return the frame that bytes encode.

    Raises
    ------
    FormatError
        If they are not a frame of version 1 (`VersionError` for another version). No other error is raised.

    Notes
    -----
    Unknown keys are ignored. The checksum is compared before anything else is read.
    """
    document = checked_map(payload)
    version = document.get(Key.VERSION)
    if version != VERSION:
        raise VersionError(f"a frame of version {str(version)[:40]}: this program reads version {VERSION}, update it")
    missing = next((key for key in _REQUIRED if key not in document), None)
    if missing is not None:
        raise FormatError(f"a frame without {missing.name.lower()} (key {missing}): send all of the keys 0 to 11")
    try:
        # One copy of each name for all frames that a monitor keeps.
        channels = tuple(sys.intern(text(name)) for name in items(document[Key.CHANNELS]))
        n_samples = integer(document[Key.N_SAMPLES])
        if not 0 < n_samples * len(channels) <= MOST_SAMPLES:
            raise FormatError(
                f"a frame with {len(channels)} channels of {n_samples} samples: 1 to {MOST_SAMPLES} in all fit"
            )
        interval = integer(document[Key.INTERVAL])
        if n_samples * interval > LONGEST:
            raise FormatError(
                f"a frame with {n_samples} samples of {interval:g} ns: more than an hour, send shorter ones"
            )
        codec = integer(document.get(Key.CODEC, RAW))
        counts, width = _counts(document[Key.DATA], codec, len(channels), n_samples)
        scale = np.array([float(value) for value in items(document[Key.SCALE])])
        if not np.all(np.isfinite(scale)):
            raise FormatError("a frame whose scale is not finite: send SI units per count")
        flags = items(document.get(Key.FLAGS, [0] * len(channels)))
        return Frame(
            vehicle=text(document[Key.VEHICLE]),
            boot=integer(document[Key.BOOT]),
            seq=integer(document[Key.SEQ]),
            start=integer(document[Key.START]),
            interval=interval,
            channels=channels,
            scale=scale,
            counts=counts,
            width=width,
            flags=np.array([integer(flag) for flag in flags]),
            time_status=integer(document[Key.TIME_STATUS]),
            monotonic=integer(document.get(Key.MONOTONIC, 0)),
            configuration=text(document.get(Key.CONFIGURATION, "")),
            previous=previous_boot(document.get(Key.PREVIOUS)),
        )
    except (ParameterError, TypeError, ValueError, OverflowError) as error:
        raise FormatError(f"an inconsistent frame: {error}") from None


def _lowest(width: int) -> int:
    """Return the lowest signed integer of a width in bytes."""
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
    """Return counts and their width in bytes."""
    if not isinstance(data, bytes):
        raise FormatError("a frame whose data is not a byte string")
    size = n_channels * n_samples
    if codec == PACKED:
        unpacking = zlib.decompressobj()
        try:
            data = unpacking.decompress(data, 4 * size + 1)
        except zlib.error as error:
            raise FormatError(f"a frame whose data cannot be unpacked: {error}") from None
    elif codec != RAW:
        raise FormatError(f"a frame with the codec {codec}: this program reads {RAW} and {PACKED}, update it")
    width, rest = divmod(len(data), size)
    if rest or width not in _WIDTHS:
        raise FormatError(f"a frame with {len(data)} bytes for {size} samples: each must have 2, 3 or 4")
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
