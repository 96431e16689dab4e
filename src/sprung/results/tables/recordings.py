"""Channels of recordings, and the true modes of simulated ones."""

import math
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

from sprung._display import counted
from sprung.recording import Recording
from sprung.results.tables.wording import Table, format_duration, format_name
from sprung.signals.inspection import ChannelFacts, Inspection, inspect


def true_modes_table(truth: Mapping[str, Any]) -> Table:
    """Return the table of the exact modes of a simulated recording, from its `sprung.truth/1`.

    Examples
    --------
    >>> mode = {"natural_frequency": 12.0, "damping_ratio": 0.24, "label": "wheel_hop"}
    >>> table = true_modes_table({"modes": [mode]})
    >>> for row in (table.columns, *table.rows):
    ...     print(" | ".join(row))
    frequency [Hz] | damping [%] | label
    12.00 | 24.00 | wheel hop
    """
    rows = tuple(
        (
            f"{mode['natural_frequency']:#.4g}",
            f"{100 * mode['damping_ratio']:#.4g}",
            format_name(mode["label"] or ""),
        )
        for mode in truth["modes"]
    )
    return Table("True modes", ("frequency [Hz]", "damping [%]", "label"), rows, n_words=0)


def inspection_table(inspection: Inspection) -> Table:
    """Return the table of the channels of a recording: levels and faults.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.recording import Channel, Recording
    >>> tone = 3 * np.sqrt(2) * np.sin(2 * np.pi * 7 * np.arange(4000) / 100)
    >>> run = Recording(tone[None], 100.0, (Channel("acc", "acceleration"),))
    >>> import sprung
    >>> table = inspection_table(sprung.inspect(run))
    >>> row = dict(zip(table.columns, table.rows[0]))
    >>> [(name, row[name]) for name in ("unit", "RMS", "lowest", "highest")]
    [('unit', 'm/s^2'), ('RMS', '3'), ('lowest', '-4.243'), ('highest', '4.243')]
    """
    columns = ("channel", "quantity", "unit", "mean", "RMS", "lowest", "highest", "remarks")
    return Table("", columns, tuple(_channel_cells(facts) for facts in inspection.channels), n_words=3)


def describe_inspection(inspection: Inspection) -> str:
    """Return length, rate, gaps and start of a recording in one line.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.recording import Channel, Recording
    >>> tone = 3 * np.sqrt(2) * np.sin(2 * np.pi * 7 * np.arange(4000) / 100)
    >>> run = Recording(tone[None], 100.0, (Channel("acc", "acceleration"),))
    >>> import sprung
    >>> describe_inspection(sprung.inspect(run))
    '4000 samples at 100 Hz: 40 s, no gaps'
    """
    if math.isnan(inspection.sampling_rate):
        return f"{inspection.n_samples} rows without a clock"
    length = format_duration(inspection.duration)
    gaps = "no gaps"
    if inspection.n_gaps:
        gaps = f"{counted(inspection.n_gaps, 'gap')} of {format_duration(inspection.gap_duration)} in all"
    start = ""
    if inspection.start is not None:
        start = f", from {datetime.fromtimestamp(inspection.start // 10**9, tz=UTC):%Y-%m-%d %H:%M:%S} UTC"
    return f"{inspection.n_samples} samples at {inspection.sampling_rate:.8g} Hz: {length}, {gaps}{start}"


def recording_parts(recording: Recording) -> tuple[Any, ...]:
    """Return what a recording contains: a heading, the table of its channels, and its history."""
    inspection = inspect(recording)
    return describe_inspection(inspection), inspection_table(inspection), recording.history


def _channel_cells(facts: ChannelFacts) -> tuple[str, ...]:
    """Return a channel's row of the table."""
    levels = (facts.mean, facts.rms, facts.minimum, facts.maximum)
    numbers = ("" if level is None else f"{level:.4g}" for level in levels)
    return (facts.name, facts.quantity, facts.unit, *numbers, _remarks(facts))


def _remarks(facts: ChannelFacts) -> str:
    """Return the faults of a channel in words."""
    shares = {
        "half-dead": facts.stuck,
        "stuck": facts.stuck,
        "clipped": facts.clipped,
        "filled": facts.fillers,
        "repeating": facts.repeated,
    }
    words = {
        "filled": f"filler value {facts.filler or 0.0:.6g} in",
        "repeating": "copies of earlier stretches",
        "spiking": counted(facts.n_spikes, "spike"),
    }
    remarks = [
        f"{words.get(kind, kind)} {100 * shares[kind]:.3g} %" if kind in shares else words.get(kind, kind)
        for kind in facts.faults
    ]
    remarks += [facts.reason] if facts.reason else []
    return ", ".join(remarks + [f"missing {100 * facts.missing:.3g} %"] * (facts.missing > 0))
