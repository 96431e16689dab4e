"""miniSEED, versions 2 and 3, through pymseed: records of one channel each, put in order and side by side."""

import itertools
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sprung._arrays import Indices, Real
from sprung._checks import required
from sprung.errors import FormatError
from sprung.formats.settings import ReadSettings
from sprung.formats.stated import column_group, distinct, mapped, plain
from sprung.formats.table import Block, Column, Group, reported, row_pieces

NAME, EXTRA = "miniSEED", "seismic"
ENDINGS = (".mseed", ".miniseed", ".ms3", ".msd", ".seed")

_VERSION_2 = re.compile(rb"[0-9 \0]{6}[DRQM][ \0]")
#: Deviation from the expected time, in sample intervals, up to which a record continues the one before.
_TOLERANCE = 0.5
#: Difference of sample times, in intervals, up to which channels have one clock.
_SAME_PHASE = 0.05


@dataclass(frozen=True, eq=False, slots=True)
class _Records:
    """Records of one channel by rising time: name, rate [Hz], first samples, and where they are in the file."""

    name: str
    rate: float
    starts: Indices  #: Time of the first sample of each record, UTC in nanoseconds since 1970.
    counts: Indices
    offsets: Indices
    lengths: Indices

    def segments(self) -> Iterator[tuple[int, int, int]]:
        """Yield stretches without gaps: time of the first sample [ns], number of samples, index of the first one."""
        interval = 1e9 / self.rate
        lateness = np.diff(self.starts) - self.counts[:-1] * interval
        breaks = np.flatnonzero(np.abs(lateness) > _TOLERANCE * interval) + 1
        edges = np.concatenate([[0], np.cumsum(self.counts)])
        for first, last in itertools.pairwise([0, *breaks.tolist(), self.starts.size]):
            yield int(self.starts[first]), int(edges[last] - edges[first]), int(edges[first])


@dataclass(frozen=True, slots=True)
class _Stretch:
    """Samples that all channels have: time of the first one [ns], number, its index in the records of each channel."""

    start: int
    n_samples: int
    firsts: tuple[int, ...]


def recognises(head: bytes) -> bool:
    """Return whether a file begins with the header of a record."""
    if head.startswith(b"MS\x03"):
        return True
    year = head[20:22]
    is_year = any(1900 <= int.from_bytes(year, order) <= 2200 for order in ("big", "little"))
    return _VERSION_2.match(head) is not None and len(head) >= 48 and is_year


def groups(path: Path, settings: ReadSettings) -> tuple[Group, ...]:
    """Return the channels of a miniSEED file, those with the same rate and sample times in one group.

    Channels are named NETWORK.STATION.LOCATION.CHANNEL. Samples are counts of the digitiser. Where a group holds a time
    at which one of the wanted channels has no samples, there is a gap.

    Raises
    ------
    FormatError
        If the file is damaged, or records of a channel overlap.
    MissingPackageError
        If pymseed is not installed.
    """
    package = required("pymseed", purpose="reading miniSEED", extra="seismic")
    with reported(path, NAME):
        channels = _channels(path, package)
        members = _in_step(channels)
        names = distinct([f"{each[0].rate:.6g} Hz" for each in members])
        names = [path.name] if len(members) == 1 else names
        return tuple(_group(path, name, each) for name, each in zip(names, members, strict=True))


def _channels(path: Path, package: Any) -> list[_Records]:
    """Return the records of each channel, from the headers alone."""
    headers: dict[tuple[str, str], list[tuple[int, int, int, int]]] = {}
    rates: dict[tuple[str, str], float] = {}
    offset = 0
    with package.MS3RecordReader(str(path)) as reader:
        for record in reader:
            if record.samplecnt > 0 and np.isfinite(record.samprate) and record.samprate > 0 and record.encoding != 0:
                key = record.sourceid, f"{record.samprate:.6g}"
                rates.setdefault(key, float(record.samprate))
                headers.setdefault(key, []).append((record.starttime, record.samplecnt, offset, record.reclen))
            offset += record.reclen
    if not headers:
        raise FormatError(f"{path} holds no samples: no record has a sampling rate and samples")
    return [_ordered(path, _name(package, key[0]), rates[key], own) for key, own in headers.items()]


def _name(package: Any, identifier: str) -> str:
    """Return NETWORK.STATION.LOCATION.CHANNEL; another identifier as it is."""
    try:
        name = ".".join(package.sourceid2nslc(identifier))
    except (ValueError, RuntimeError):
        name = str(identifier)
    return plain(name) or "unnamed"


def _ordered(path: Path, name: str, rate: float, headers: Sequence[tuple[int, int, int, int]]) -> _Records:
    """Return the records of a channel by rising time, each once."""
    table = np.array(sorted(headers), dtype=np.int64)
    is_new = np.concatenate([[True], np.any(np.diff(table[:, :2], axis=0) != 0, axis=1)])
    starts, counts, offsets, lengths = table[is_new].T
    ends = starts[:-1] + counts[:-1] * (1e9 / rate)
    overlap = np.flatnonzero(starts[1:] < ends - _TOLERANCE * 1e9 / rate)
    if overlap.size:
        moment = np.datetime64(int(starts[overlap[0] + 1]), "ns")
        raise FormatError(f"{path}: records of {name} overlap at {moment}: keep one of them")
    return _Records(name, rate, starts, counts, offsets, lengths)


def _in_step(channels: Sequence[_Records]) -> list[list[_Records]]:
    """Return channels with the same rate and sample times in groups; no name occurs twice in one."""
    grouped: list[list[_Records]] = []
    for channel in channels:
        for group in grouped:
            names = {member.name for member in group}
            if channel.name not in names and _is_in_step(group[0], channel) and _stretches([*group, channel]):
                group.append(channel)
                break
        else:
            grouped.append([channel])
    return grouped


def _is_in_step(one: _Records, other: _Records) -> bool:
    """Return whether two channels are sampled at the same times."""
    phase = (float(one.starts[0] - other.starts[0]) * one.rate * 1e-9 + 0.5) % 1 - 0.5
    return abs(one.rate / other.rate - 1) < 1e-6 and abs(phase) < _SAME_PHASE


def _stretches(channels: Sequence[_Records]) -> list[_Stretch]:
    """Return the stretches without gaps in which all channels have samples."""
    common = [_Stretch(start, count, (index,)) for start, count, index in channels[0].segments()]
    for channel in channels[1:]:
        common = list(_intersections(common, list(channel.segments()), channels[0].rate))
    return common


def _intersections(common: Sequence[_Stretch], own: Sequence[tuple[int, int, int]], rate: float) -> Iterator[_Stretch]:
    """Yield the parts of stretches that a further channel has, too; both are in order of time."""
    k = 0
    for stretch in common:
        while k < len(own):
            start, count, index = own[k]
            late = round((start - stretch.start) * rate * 1e-9)
            first, last = max(0, late), min(stretch.n_samples, late + count)
            if last > first:
                begin = stretch.start + round(1e9 * first / rate)
                yield _Stretch(begin, last - first, (*(each + first for each in stretch.firsts), index + first - late))
            if late + count > stretch.n_samples:
                break
            k += 1


def _group(path: Path, name: str, channels: Sequence[_Records]) -> Group:
    """Return a group of channels in step."""

    def rows(indices: Sequence[int], first: int = 0, last: int | None = None) -> Iterator[Block]:
        return _blocks(path, [channels[k] for k in indices], first, last)

    return column_group(
        path,
        name,
        [Column(channel.name, channel.name, unit="counts") for channel in channels],
        rows,
        clock=name,
        n_rows=sum(stretch.n_samples for stretch in _stretches(channels)),
        sampling_rate=channels[0].rate,
        time_heading="time",
    )


def _parts(stretches: Sequence[_Stretch], first: int, last: int | None) -> Iterator[tuple[int, int, int, _Stretch]]:
    """Yield row, first and last sample and stretch of pieces of the rows from `first` to before `last`."""
    row = 0
    for stretch in stretches:
        for part in row_pieces(stretch.n_samples, max(0, first - row), None if last is None else last - row):
            yield row + part.start, part.start, part.stop, stretch
        row += stretch.n_samples


def _stamps(stretch: _Stretch, rate: float, begin: int, until: int) -> Any:
    """Return the times of some samples of a stretch."""
    nanoseconds = stretch.start + np.round(np.arange(begin, until) * (1e9 / rate)).astype(np.int64)
    return nanoseconds.astype("M8[ns]")


def _blocks(path: Path, channels: Sequence[_Records], first_row: int, last_row: int | None) -> Iterator[Block]:
    """Yield samples of some channels, counted from 1."""
    package = required("pymseed", purpose="reading miniSEED", extra="seismic")
    edges = [np.concatenate([[0], np.cumsum(channel.counts)]) for channel in channels]
    with reported(path, NAME), mapped(path) as content:
        for row, begin, until, stretch in _parts(_stretches(channels), first_row, last_row):
            values = np.empty((len(channels), until - begin))
            for k, channel in enumerate(channels):
                first, last = stretch.firsts[k] + begin, stretch.firsts[k] + until
                record = int(np.searchsorted(edges[k], first, side="right")) - 1
                while edges[k][record] < last:
                    here = int(edges[k][record])
                    samples = _samples(path, package, content, channel, record)
                    part = samples[max(0, first - here) : last - here]
                    at = max(first, here) - first
                    values[k, at : at + part.size] = part
                    record += 1
                    if record == channel.counts.size:
                        break
            yield Block(row + 1, _stamps(stretch, channels[0].rate, begin, until), values)


def _samples(path: Path, package: Any, content: Any, channel: _Records, record: int) -> Real:
    """Return the samples of one record."""
    offset, length = int(channel.offsets[record]), int(channel.lengths[record])
    parsed = package.MS3Record.parse(content[offset : offset + length], unpack_data=True)
    samples: Real = np.array(parsed.np_datasamples, dtype=np.float64)
    if samples.size != channel.counts[record]:
        raise FormatError(
            f"{path}, byte {offset}: a record of {channel.name} declares {channel.counts[record]} samples, but holds "
            f"{samples.size}"
        )
    return samples
