"""Frames: a second or so of a vehicle's samples as bytes; frames and recordings as blocks in order of time."""

import sys
import zlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from sprung._arrays import Indices, Real
from sprung._checks import check_number, frozen_array
from sprung.errors import FormatError, ParameterError
from sprung.link.messages import (
    LATEST,
    VERSION,
    Header,
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
from sprung.recording import Channel, Gap, Recording

#: Largest number of samples of all channels in a frame, which bounds its size unpacked.
MAX_SAMPLES = 1 << 19
#: Longest frame [ns]: a longer one could hold any number of windows, each of which takes time.
LONGEST = 3600 * 10**9
#: Shortest time between samples [ns]: a window of a higher rate would never be complete.
MIN_INTERVAL = 50_000
#: Largest number of samples of all channels in a second: a monitor keeps windows of minutes of every vehicle.
HIGHEST_RATE = 200_000
#: Bits of a channel's flag.
CLIPPED, STUCK, MISSING = 1, 2, 4
#: Status of the time of a frame: unknown, set once, kept by a time server.
TIME_UNKNOWN, TIME_SET, TIME_KEPT = 0, 1, 2
#: Codecs of the data.
RAW, PACKED = 0, 1
_WIDTHS = (2, 3, 4)
#: Ranges of the numbers of a frame.
_COUNT = (0, 2**63 - 1)
_RANGES = {
    "boot": _COUNT,
    "seq": _COUNT,
    "monotonic": _COUNT,
    "start": (-LATEST, LATEST),
    "interval": (MIN_INTERVAL, 10**12),
}
#: Keys of a frame, and largest size of all others, which later versions may have [bytes].
_KNOWN = frozenset(key for key in Key if key <= Key.PREVIOUS)
_MAX_UNKNOWN = 1024
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
        Time between samples [ns], at least 50 us; all channels together have at most 200,000 samples in a second.
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
        _check_ranges({name: getattr(self, name) for name in _RANGES}, len(self.channels))
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

    Examples
    --------
    >>> import numpy as np
    >>> counts, scale, flags = quantised(np.array([[0.5, -1.0, np.nan]]), scale=np.array([0.01]))
    >>> counts.tolist(), flags.tolist() == [MISSING]
    ([[50, -100, -32768]], True)
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

    Examples
    --------
    >>> import numpy as np
    >>> counts, scale, flags = quantised(np.sin(np.linspace(0.0, 6.0, 400))[None])
    >>> frame = Frame("bus-17", 1, 0, 10**18, 2_500_000, ("acc_fl",), scale, counts, flags=flags)
    >>> raw, packed = encode(frame, codec=RAW), encode(frame)
    >>> len(packed) < len(raw), decode(packed).vehicle
    (True, 'bus-17')
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

    Examples
    --------
    >>> import numpy as np
    >>> counts, scale, flags = quantised(np.array([[0.0, 0.5, -1.0]]), scale=np.array([0.01]))
    >>> payload = encode(Frame("bus-17", 1, 0, 10**18, 2_500_000, ("acc_fl",), scale, counts, flags=flags))
    >>> frame = decode(payload)
    >>> frame.channels, frame.samples.tolist()
    (('acc_fl',), [[0.0, 0.5, -1.0]])
    """
    document = _document(payload)
    try:
        fields = _fields(document)
        shape = len(fields["channels"]), document[Key.N_SAMPLES]
        data = _unpacked(document, fields)
        width = _width(data, shape[0] * shape[1])
        is_packed = document.get(Key.CODEC, RAW) == PACKED
        return Frame(**fields, counts=_counts(data, width, shape, is_packed=is_packed), width=width)
    except (ParameterError, TypeError, ValueError, OverflowError) as error:
        raise FormatError(f"an inconsistent frame: {error}") from None


def check_frame(payload: bytes, vehicle: str) -> Header:
    """Return the header of a frame of a vehicle that `decode` can read, without making samples of its data.

    Raises
    ------
    FormatError
        As `decode`, and if the frame is of another vehicle.

    Notes
    -----
    Packed data are unpacked to their size, which costs a tenth of decoding them.

    Examples
    --------
    >>> import numpy as np
    >>> counts, scale, flags = quantised(np.array([[0.0, 0.5, -1.0]]))
    >>> payload = encode(Frame("bus-17", 1, 8, 10**18, 2_500_000, ("acc_fl",), scale, counts, flags=flags))
    >>> header = check_frame(payload, "bus-17")
    >>> header.boot, header.seq, header.n_samples
    (1, 8, 3)
    """
    document = _document(payload)
    try:
        fields = _fields(document)
        _width(_unpacked(document, fields), len(fields["channels"]) * document[Key.N_SAMPLES])
        if len(fields["scale"]) != len(fields["channels"]):
            raise ParameterError(
                f"{len(fields['channels'])} channels with {len(fields['scale'])} scales: give one for each"
            )
        _check_ranges(fields, len(fields["channels"]))
        if check_vehicle(fields["vehicle"]) != vehicle:
            raise FormatError(f"a frame of {fields['vehicle']!r} on the topic of {vehicle!r}")
    except (ParameterError, TypeError, ValueError, OverflowError) as error:
        raise FormatError(f"an inconsistent frame: {error}") from None
    return Header(
        boot=fields["boot"],
        seq=fields["seq"],
        start=fields["start"],
        interval=fields["interval"],
        n_samples=document[Key.N_SAMPLES],
        previous=fields["previous"],
    )


def _document(payload: bytes) -> dict[Any, Any]:
    """Return the map of a complete frame of this version."""
    document = checked_map(payload)
    version = document.get(Key.VERSION)
    if version != VERSION:
        raise VersionError(f"a frame of version {str(version)[:40]}: this program reads version {VERSION}, update it")
    unknown = {key: value for key, value in document.items() if key not in _KNOWN}
    if unknown and len(message(unknown)) > _MAX_UNKNOWN:
        raise FormatError(f"a frame with more than {_MAX_UNKNOWN} bytes under unknown keys: send the keys 0 to 15")
    missing = next((key for key in _REQUIRED if key not in document), None)
    if missing is not None:
        raise FormatError(f"a frame without {missing.name.lower()} (key {missing}): send all of the keys 0 to 11")
    return document


def _fields(document: dict[Any, Any]) -> dict[str, Any]:
    """Return the fields of a frame but its counts and their width."""
    # One copy of each name for all frames that a monitor keeps.
    channels = tuple(sys.intern(text(name)) for name in items(document[Key.CHANNELS]))
    n_samples = integer(document[Key.N_SAMPLES])
    if not 0 < n_samples * len(channels) <= MAX_SAMPLES:
        raise FormatError(
            f"a frame with {len(channels)} channels of {n_samples} samples: 1 to {MAX_SAMPLES} in all fit"
        )
    interval = integer(document[Key.INTERVAL])
    if n_samples * interval > LONGEST:
        raise FormatError(f"a frame with {n_samples} samples of {interval:g} ns: more than an hour, send shorter ones")
    scales = items(document[Key.SCALE])
    if not all(isinstance(value, int | float) for value in scales):
        raise FormatError("a frame whose scale is not of numbers: send SI units per count")
    scale = np.array([float(value) for value in scales])
    if not np.all(np.isfinite(scale)):
        raise FormatError("a frame whose scale is not finite: send SI units per count")
    flags = items(document.get(Key.FLAGS, [0] * len(channels)))
    return {
        "vehicle": text(document[Key.VEHICLE]),
        "boot": integer(document[Key.BOOT]),
        "seq": integer(document[Key.SEQ]),
        "start": integer(document[Key.START]),
        "interval": interval,
        "channels": channels,
        "scale": scale,
        "flags": np.array([integer(flag) for flag in flags], dtype=np.int64),
        "time_status": integer(document[Key.TIME_STATUS]),
        "monotonic": integer(document.get(Key.MONOTONIC, 0)),
        "configuration": text(document.get(Key.CONFIGURATION, "")),
        "previous": previous_boot(document.get(Key.PREVIOUS)),
    }


def _check_ranges(fields: Mapping[str, Any], n_channels: int) -> None:
    """Refuse numbers out of range, and more samples in a second than a monitor takes."""
    for name, (lowest, highest) in _RANGES.items():
        check_number(name, fields[name], at_least=lowest, at_most=highest)
    rate = n_channels * 1e9 / fields["interval"]
    if rate > HIGHEST_RATE:
        raise ParameterError(
            f"{n_channels} channels at {1e9 / fields['interval']:g} Hz are {rate:.0f} samples/s, a vehicle may send "
            f"{HIGHEST_RATE}: leave out channels or send a lower rate"
        )


def _lowest(width: int) -> int:
    """Return the lowest signed integer of a width in bytes."""
    return -(1 << (8 * width - 1))


def _data(counts: NDArray[np.signedinteger], width: int, codec: int) -> bytes:
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


def _unpacked(document: Mapping[Any, Any], fields: Mapping[str, Any]) -> bytes:
    """Return the data of a frame as they were before packing, and at most one byte more than may be."""
    data, codec = document[Key.DATA], integer(document.get(Key.CODEC, RAW))
    if not isinstance(data, bytes):
        raise FormatError("a frame whose data is not a byte string")
    if codec == RAW:
        return data
    if codec != PACKED:
        raise FormatError(f"a frame with the codec {codec}: this program reads {RAW} and {PACKED}, update it")
    try:
        unpacked = zlib.decompressobj().decompress(data, 4 * len(fields["channels"]) * document[Key.N_SAMPLES] + 1)
    except zlib.error as error:
        raise FormatError(f"a frame whose data cannot be unpacked: {error}") from None
    if len(data) > len(unpacked) + len(unpacked) // 1000 + 64:  # nothing needs more, even if it cannot be compressed
        raise FormatError(
            f"a frame with {len(data)} bytes for {len(unpacked)} bytes of samples: send the samples alone"
        )
    return unpacked


def _width(data: bytes, size: int) -> int:
    """Return the bytes of a count."""
    width, rest = divmod(len(data), size)
    if rest or width not in _WIDTHS:
        raise FormatError(f"a frame with {len(data)} bytes for {size} samples: each must have 2, 3 or 4")
    return width


def _counts(data: bytes, width: int, shape: tuple[int, int], *, is_packed: bool) -> NDArray[np.signedinteger]:
    """Return counts of a shape from their bytes, or from those of their differences."""
    octets = np.frombuffer(data, dtype=np.uint8)
    octets = np.moveaxis(octets.reshape(width, *shape), 0, -1) if is_packed else octets.reshape(*shape, width)
    integers = np.dtype("<i2" if width == 2 else "<i4")
    # Three bytes are the upper ones of four, so that their sums wrap around where those of the box did.
    spare = integers.itemsize - width
    wide = np.zeros((*shape, integers.itemsize), dtype=np.uint8)
    wide[..., spare:] = octets
    counts = wide.view(integers)[..., 0]
    if is_packed:
        counts = np.cumsum(counts, axis=1, dtype=integers)
    return np.asarray(counts >> (8 * spare))


#: Longest time between blocks that is not a gap, in samples; clocks of loggers jitter.
LONGEST_STEP = 2.5


@dataclass(frozen=True, eq=False, slots=True)
class FrameBlock:
    """A frame as a block: it keeps the integers, which take a quarter of the memory of samples.

    Parameters
    ----------
    frame
        Frame of a vehicle.
    channels
        Channels with the quantities that the box announced.
    """

    frame: Frame
    channels: tuple[Channel, ...]

    @property
    def start(self) -> int:
        """Time of the first sample, UTC ns; a step of the box's clock is a gap."""
        return self.frame.start

    @property
    def samples(self) -> Real:
        """Samples in SI units, NaN where missing, shape (channels, samples)."""
        return self.frame.samples

    @property
    def sampling_rate(self) -> float:
        """Sampling rate [Hz]."""
        return 1e9 / self.frame.interval

    @property
    def n_samples(self) -> int:
        """Number of samples of each channel."""
        return self.frame.n_samples

    @property
    def gaps(self) -> tuple[Gap, ...]:
        """No gaps: a frame is continuous."""
        return ()


#: Samples of several channels in order of time.
Block: TypeAlias = Recording | FrameBlock


def frame_block(frame: Frame, quantities: Mapping[str, str]) -> FrameBlock:
    """Return a frame as a block; `quantities` of the channels as the box announced them.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.link import Frame
    >>> frame = Frame("bus-17", 1, 0, 10**18, 2_500_000, ("acc_fl",), np.array([0.01]), np.array([[0, 50, -100]]))
    >>> block = frame_block(frame, {"acc_fl": "acceleration"})
    >>> block.channels[0].unit, block.sampling_rate, block.samples.tolist()
    ('m/s^2', 400.0, [[0.0, 0.5, -1.0]])
    """
    return FrameBlock(
        frame, _channels(frame.channels, tuple(quantities.get(name, "unknown") for name in frame.channels))
    )


@lru_cache(maxsize=1024)
def _channels(names: tuple[str, ...], quantities: tuple[str, ...]) -> tuple[Channel, ...]:
    """Return channels, shared by all frames that have them: a window holds hundreds."""
    return tuple(Channel(name, quantity) for name, quantity in zip(names, quantities, strict=True))


def plain_channels(channels: Iterable[Channel]) -> list[list[Any]]:
    """Return channels as plain values."""
    return [[channel.name, channel.quantity, channel.position, channel.direction] for channel in channels]


def restored_channels(plain: Iterable[Sequence[Any]]) -> tuple[Channel, ...]:
    """Return the channels of plain values."""
    return tuple(
        Channel(name, quantity, tuple(position) if position else None, tuple(direction) if direction else None)
        for name, quantity, position, direction in plain
    )


def part_of(block: Block, first: int, last: int) -> Block:
    """Return the samples of a block from one to before another."""
    if first == 0 and last == block.n_samples:
        return block
    return Recording(block.samples, block.sampling_rate, block.channels, block.start, block.gaps).part(first, last)


def joined(blocks: Sequence[Block]) -> Recording:
    """Return blocks of the same channels and rate as one recording, with gaps where time is missing.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.recording import Channel, Recording
    >>> channels = (Channel("acc_fl", "acceleration"),)
    >>> blocks = [Recording(np.ones((1, 100)), 100.0, channels, start=second * 10**9) for second in (0, 1, 5)]
    >>> recording = joined(blocks)
    >>> recording.n_samples, recording.gaps
    (300, (Gap(index=200, duration=3.0),))
    """
    first = blocks[0]
    gaps, place, end = [], 0, first.start
    for block in blocks:
        if place and block.start is not None and end is not None:
            missing = (block.start - end) / 1e9 * first.sampling_rate
            if abs(missing) > LONGEST_STEP:
                gaps.append(Gap(place, max(missing, 1.0) / first.sampling_rate))
        gaps += [replace(gap, index=gap.index + place) for gap in block.gaps]
        place += block.n_samples
        lost = sum(gap.duration for gap in block.gaps)
        end = None if block.start is None else block.start + round((block.n_samples / block.sampling_rate + lost) * 1e9)
    return Recording(
        samples=np.concatenate([block.samples for block in blocks], axis=1),
        sampling_rate=first.sampling_rate,
        channels=first.channels,
        start=first.start,
        gaps=tuple(gaps),
    )
