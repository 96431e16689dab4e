"""Clipped channels, and channels that are dead for a part of a record: what is left out, and what is noted."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sprung.recording import Recording
from sprung.signals.data_faults import REST_DURATION, REST_RUN_SHARE, has_runs, stuck_runs
from sprung.signals.inspection import ChannelFacts, inspect

#: A channel that is dead for more than this share of a record is left out, and of others only the dead parts.
_MOSTLY_DEAD = 0.5


@dataclass(frozen=True, slots=True)
class ChannelFault:
    """Faults of one channel in one record.

    Parameters
    ----------
    channel
        Name of the channel.
    clipped, dead, missing
        Shares of its samples at the limits of its range, in runs of one value, and without a value, 0 to 1.
    is_left_out
        Whether the channel is left out of the record.
    """

    channel: str
    clipped: float
    dead: float
    missing: float
    is_left_out: bool


def without_dead_parts(recording: Recording, outputs: Sequence[str]) -> tuple[Recording, tuple[ChannelFault, ...]]:
    """Mark the dead parts of a record as missing, and leave out channels that are mostly dead.

    Parameters
    ----------
    recording
        Recording as read.
    outputs
        Names of the channels of motion.

    Returns
    -------
    tuple
        Recording with NaN in runs of one value for two seconds and 1 % of the record or longer, without the channels
        that are dead for more than half of it; and the faults of the outputs. A channel that is dead throughout stays
        as it is.
    """
    doubtful = [name for name in outputs if has_runs(recording.samples[recording.index(name)])]
    facts = inspect(recording.select(doubtful), counts_odd_samples=False).channels if doubtful else ()
    samples, faults = recording.samples, []
    for fact in facts:
        if fact.is_dead or not (fact.is_clipped or fact.stuck or fact.n_values < recording.n_samples):
            continue
        row = recording.index(fact.name)
        dead = _dead_samples(recording, row) if fact.stuck else np.zeros(0, dtype=np.intp)
        share = dead.size / recording.n_samples
        if dead.size and share <= _MOSTLY_DEAD:
            samples = samples.copy() if samples is recording.samples else samples
            samples[row, dead] = np.nan
        if fact.is_clipped or dead.size or fact.n_values < recording.n_samples:
            faults.append(_fault(fact, share, recording.n_samples))
    left_out = {fault.channel for fault in faults if fault.is_left_out}
    if samples is not recording.samples:
        recording = recording.changed("dead parts of channels marked as missing", samples=samples)
    if left_out:
        recording = recording.select([name for name in recording.names if name not in left_out])
    return recording, tuple(faults)


def note_on_faults(records: Sequence[Sequence[ChannelFault]]) -> tuple[str, ...]:
    """Return one sentence on the faults of all records; none without faults.

    Parameters
    ----------
    records
        Faults of each record.

    Returns
    -------
    tuple of str
    """
    channels = dict.fromkeys(fault.channel for faults in records for fault in faults)
    parts = [
        f"{channel} ({_words([fault for faults in records for fault in faults if fault.channel == channel])})"
        for channel in channels
    ]
    if not parts:
        return ()
    return (f"faults of channels: {', '.join(parts)}: check ranges, sensors and wiring",)


def _fault(fact: ChannelFacts, dead: float, n_samples: int) -> ChannelFault:
    """Return the faults that the facts about a channel show."""
    return ChannelFault(
        channel=fact.name,
        clipped=fact.clipped if fact.is_clipped else 0.0,
        dead=dead,
        missing=1 - fact.n_values / n_samples,
        is_left_out=dead > _MOSTLY_DEAD,
    )


def _dead_samples(recording: Recording, row: int) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Return the indices of the samples in long runs of one value."""
    breaks = [gap.index for gap in recording.gaps]
    starts, lengths = stuck_runs(recording.samples[row], recording.sampling_rate, breaks=breaks)
    shortest = max(REST_DURATION * recording.sampling_rate, REST_RUN_SHARE * recording.n_samples)
    is_long = lengths >= shortest
    runs = [np.arange(start, start + n) for start, n in zip(starts[is_long], lengths[is_long], strict=True)]
    return np.concatenate(runs) if runs else np.zeros(0, dtype=np.intp)


def _words(faults: Sequence[ChannelFault]) -> str:
    """Return the faults of one channel in words, with the largest shares of all records."""
    clipped, dead, missing = (max(getattr(fault, name) for fault in faults) for name in ("clipped", "dead", "missing"))
    words = []
    if clipped:
        words.append(f"clipped in {100 * clipped:.2g} % of its samples, which distorts the motion")
    if dead:
        is_left_out = any(fault.is_left_out for fault in faults)
        words.append(f"dead in {100 * dead:.2g} %, {'channel' if is_left_out else 'this part of the record'} left out")
    if missing:
        words.append(f"missing in {100 * missing:.2g} %, this part of the record left out")
    return ", ".join(words)
