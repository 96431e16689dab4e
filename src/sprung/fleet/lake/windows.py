"""A window of samples as one row of a lake: integers of two or four bytes, arranged so that they compress well."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, date, datetime
from hashlib import blake2b
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from sprung._arrays import Real
from sprung.errors import DataError, FormatError, ParameterError
from sprung.recording import Channel, Gap, Recording

_CHANNEL = pa.struct(
    [
        pa.field("name", pa.string()),
        pa.field("quantity", pa.string()),
        pa.field("scale", pa.float64()),
        pa.field("position", pa.list_(pa.float64())),
        pa.field("direction", pa.list_(pa.float64())),
    ]
)
_GAP = pa.struct([pa.field("index", pa.int64()), pa.field("duration", pa.float64())])
#: Columns of a lake, one row for each window; those of DuckDB, Spark and others by the names of Arrow's types.
SCHEMA = pa.schema(
    [
        pa.field("date", pa.date32()),  # of the first sample, UTC; the partition
        pa.field("vehicle", pa.string()),
        pa.field("start", pa.int64()),  # time of the first sample, UTC ns since 1970
        pa.field("duration", pa.float64()),  # of the samples and the gaps between them [s]
        pa.field("sampling_rate", pa.float64()),  # [Hz]
        pa.field("n_samples", pa.int64()),  # of each channel
        pa.field("channels", pa.list_(_CHANNEL)),  # rows of the samples; scale: SI units per count
        pa.field("gaps", pa.list_(_GAP)),
        pa.field("conditions", pa.map_(pa.string(), pa.float64())),  # mean of each speed and temperature
        pa.field("digest", pa.string()),  # of everything above and of the samples
        pa.field("source", pa.string()),  # file or monitor that it is from
        pa.field("samples", pa.binary()),  # counts, as `packed` arranges them
    ]
)
#: Columns that identify a window.
KEY = ("vehicle", "start", "digest")
_NANOSECONDS = 10**9
#: Quantities whose means are the conditions of a window.
_CONDITIONS = ("speed", "temperature")
#: Largest standard deviation of the rounding error of a channel in two bytes, relative to the scatter of its samples.
MAX_ROUNDING = 1e-3
#: Deviation from whole numbers below which samples are multiples of a step.
_WHOLE = 1e-6
#: Number of samples from which the step of a channel is taken.
_FOR_STEP = 4096


@dataclass(frozen=True, eq=False, slots=True)
class LakeWindow:
    """Samples of a vehicle that are analysed together, as integers.

    Parameters
    ----------
    vehicle
        Name of the vehicle.
    row
        Values of the columns of `SCHEMA` by name.
    """

    vehicle: str
    row: Mapping[str, Any] = field(repr=False)

    @property
    def n_bytes(self) -> int:
        """Size of the samples [bytes]."""
        return len(self.row["samples"])

    @property
    def day(self) -> date:
        """Date of the first sample, UTC."""
        day: date = self.row["date"]
        return day


def window_of_recording(vehicle: str, recording: Recording, *, source: str = "") -> LakeWindow:
    """Return a recording as a window of a lake.

    Parameters
    ----------
    vehicle
        Name of the vehicle.
    recording
        Samples of the window, with a start time.
    source
        File or monitor that the samples are from.

    Raises
    ------
    ParameterError
        If the vehicle has no name.
    DataError
        If the recording has no start time, or no samples.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.recording import Channel, Recording
    >>> samples = np.array([[0.0, 0.5, -1.25, 3.0]])
    >>> run = Recording(samples, 100.0, (Channel("acc_fl", "acceleration"),), start=1_790_000_000_000_000_000)
    >>> window = window_of_recording("bus-17", run, source="drive.csv")
    >>> window.vehicle, str(window.day), window.n_bytes
    ('bus-17', '2026-09-21', 8)
    """
    if not vehicle.strip():
        raise ParameterError("a window needs the name of its vehicle: give one")
    if recording.start is None:
        raise DataError(f"a window of {vehicle} has no start time, and windows are ordered by it: state one")
    if not recording.n_samples:
        raise DataError(f"a window of {vehicle} has no samples: leave it out")
    counts, scale = quantised(recording.samples)
    row: dict[str, Any] = {
        "date": datetime.fromtimestamp(recording.start // _NANOSECONDS, UTC).date(),
        "vehicle": vehicle,
        "start": recording.start,
        "duration": recording.duration,
        "sampling_rate": recording.sampling_rate,
        "n_samples": recording.n_samples,
        "channels": [
            {
                "name": channel.name,
                "quantity": channel.quantity,
                "scale": float(own),
                "position": None if channel.position is None else list(channel.position),
                "direction": None if channel.direction is None else list(channel.direction),
            }
            for channel, own in zip(recording.channels, scale, strict=True)
        ],
        "gaps": [{"index": gap.index, "duration": gap.duration} for gap in recording.gaps],
        "conditions": list(_conditions(recording).items()),
        "samples": packed(counts),
    }
    return LakeWindow(vehicle, {**row, "digest": _digest(row), "source": source})


def recording_of(row: Mapping[str, Any]) -> Recording:
    """Return the samples of a row of a lake.

    Raises
    ------
    FormatError
        If the row is inconsistent.

    Examples
    --------
    Samples that are multiples of a step are kept exactly:

    >>> import numpy as np
    >>> from sprung.fleet.lake import window_of_recording
    >>> from sprung.recording import Channel, Recording
    >>> samples = np.round(8 * np.sin(np.arange(400)))[None] / 8
    >>> run = Recording(samples, 100.0, (Channel("acc_fl", "acceleration"),), start=1_790_000_000_000_000_000)
    >>> kept = recording_of(window_of_recording("bus-17", run).row)
    >>> bool(np.array_equal(kept.samples, samples)), kept.sampling_rate, kept.start == run.start
    (True, 100.0, True)
    """
    try:
        channels = row["channels"]
        counts = unpacked(row["samples"], n_channels=len(channels), n_samples=row["n_samples"])
        return Recording(
            samples=values_of(counts, np.array([channel["scale"] for channel in channels])),
            sampling_rate=row["sampling_rate"],
            channels=tuple(
                Channel(
                    channel["name"],
                    channel["quantity"],
                    _triple(channel["position"]),
                    _triple(channel["direction"]),
                )
                for channel in channels
            ),
            start=row["start"],
            gaps=tuple(Gap(gap["index"], gap["duration"]) for gap in row["gaps"] or ()),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise FormatError(f"a row of the lake cannot be read: {error}: import its file again") from None


def _conditions(recording: Recording) -> dict[str, float]:
    """Return the means of channels that measure conditions."""
    means = {}
    for channel, values in zip(recording.channels, recording.samples, strict=True):
        known = values[np.isfinite(values)]
        if channel.quantity in _CONDITIONS and known.size:
            means[channel.name] = float(known.mean())
    return means


def _digest(row: Mapping[str, Any]) -> str:
    """Return a digest of what the analysis of a row depends on, the same after a file has rounded rate and gaps."""
    facts = [
        *(row[name] for name in ("vehicle", "start", "n_samples")),
        f"{row['sampling_rate']:.9g}",
        [{**channel, "scale": f"{channel['scale']:.9g}"} for channel in row["channels"]],
        [(gap["index"], f"{gap['duration']:.6f}") for gap in row["gaps"]],
    ]
    return blake2b(repr(facts).encode() + row["samples"], digest_size=12).hexdigest()


def _triple(values: Any) -> tuple[float, float, float] | None:
    """Return a position or direction."""
    return None if values is None else (values[0], values[1], values[2])


def quantised(samples: Real) -> tuple[NDArray[np.signedinteger], Real]:
    """Return samples as integers, and their scale.

    Parameters
    ----------
    samples
        Samples, shape (channels, samples); NaN where missing.

    Returns
    -------
    tuple
        Integers of two bytes, or of four where those would round too coarsely, shape (channels, samples), the lowest
        one for a missing value; and the value of one count, shape (channels,).

    Notes
    -----
    Samples that are whole multiples of a step, as those of converters and of text files are, keep that step and are
    exact. Others are rounded to 1/32767 of the largest one of their channel, or to 1/(2^31 - 1) of it where the error
    would exceed 1e-3 of the scatter of some channel.
    """
    values = np.asarray(samples, dtype=np.float64)
    missing = ~np.isfinite(values)
    scales = np.array([_step(row[~gone]) for row, gone in zip(values, missing, strict=True)])
    highest = 2**15 - 1
    coarse = np.array([_largest(row, gone) / highest for row, gone in zip(values, missing, strict=True)])
    is_exact = (scales > 0) & (coarse <= scales)
    spread = np.array([_spread(row[~gone]) for row, gone in zip(values, missing, strict=True)])
    if np.all(is_exact | (coarse / np.sqrt(12) <= MAX_ROUNDING * spread)):
        scale, integers = np.where(is_exact, scales, coarse), np.int16
    else:
        highest = 2**31 - 1
        fine = coarse * (2**15 - 1) / highest
        scale, integers = np.where((scales > 0) & (fine <= scales), scales, fine), np.int32  # type: ignore[assignment]
    scale = np.where(scale > 0, scale, 1.0)
    counts = np.rint(np.where(missing, 0.0, values) / scale[:, None])
    counts = np.clip(counts, -highest, highest).astype(integers)
    counts[missing] = -highest - 1
    return counts, scale


def values_of(counts: NDArray[np.signedinteger], scale: Real) -> Real:
    """Return the samples of integers, NaN where missing; inverse of `quantised`."""
    values: Real = counts * np.asarray(scale, dtype=np.float64)[:, None]
    values[counts == np.iinfo(counts.dtype).min] = np.nan
    return values


def packed(counts: NDArray[np.signedinteger]) -> bytes:
    """Return integers as the bytes of their differences along each row, bytes of equal weight together."""
    kind = counts.dtype.newbyteorder("<")
    steps = np.diff(counts, axis=1, prepend=counts.dtype.type(0)).astype(kind)  # wraps around, and back in `unpacked`
    octets = steps.view(np.uint8).reshape(*counts.shape, kind.itemsize)
    return np.ascontiguousarray(np.moveaxis(octets, -1, 0)).tobytes()


def unpacked(data: bytes, *, n_channels: int, n_samples: int) -> NDArray[np.signedinteger]:
    """Return the integers of `packed`, shape (channels, samples).

    Raises
    ------
    ValueError
        If the number of bytes does not fit.
    """
    width = len(data) // max(1, n_channels * n_samples)
    if width not in {2, 4} or len(data) != width * n_channels * n_samples:
        raise ValueError(f"{len(data)} bytes are not {n_channels} channels of {n_samples} samples")
    octets = np.moveaxis(np.frombuffer(data, dtype=np.uint8).reshape(width, n_channels, n_samples), 0, -1)
    kind = np.dtype(f"<i{width}")
    steps = np.ascontiguousarray(octets).view(kind)[..., 0]
    return np.cumsum(steps, axis=1, dtype=kind)


def _step(values: Real) -> float:
    """Return the step of which all values are whole multiples; 0 where there is none."""
    levels = np.unique(np.abs(values[:_FOR_STEP]))
    steps = np.diff(levels[levels > 0], prepend=0.0)
    steps = steps[steps > _WHOLE * levels[-1]] if levels.size else steps
    if not steps.size:
        return 0.0
    step = float(steps.min())
    step = float(levels[-1] / np.rint(levels[-1] / step))  # the largest value determines it best
    counts = values / step
    return step if np.all(np.abs(counts - np.rint(counts)) < _WHOLE) else 0.0


def _largest(values: Real, missing: NDArray[np.bool_]) -> float:
    """Return the largest absolute value."""
    return float(np.max(np.abs(values), initial=0.0, where=~missing))


def _spread(values: Real) -> float:
    """Return half the range of the middle two thirds, which a few spikes do not widen; else the standard deviation."""
    if not values.size:
        return 0.0
    low, high = np.quantile(values, [1 / 6, 5 / 6])
    return float(high - low) / 2 or float(np.std(values)) or _largest(values, np.zeros(values.shape, dtype=bool))
