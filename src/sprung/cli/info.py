"""The command `sprung info`."""

from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from sprung.cli.documents import write_json
from sprung.cli.files import Channels, Files, Json, SamplingRate, check_file, names, records
from sprung.cli.printing import console, notes, printable, table
from sprung.cli.progress import progress_bar

if TYPE_CHECKING:
    from sprung.signals.inspection import ChannelFacts, Inspection


def info(
    files: Files,
    *,
    sampling_rate: SamplingRate = None,
    channels: Channels = None,
    json: Json = None,
) -> None:
    """Summarise recordings: channels, units, rate, length, gaps, levels and faults."""
    from sprung.documents import inspection_document

    check_file("--json", json, inputs=files)
    inspections = {}
    for path in files:
        inspection = _inspect(path, sampling_rate, names(channels))
        inspections[str(path)] = inspection
        if json != "-":
            _show(path, inspection)
    if json is not None:
        write_json(inspection_document(inspections), json)


def _inspect(path: Path, sampling_rate: float | None, channels: tuple[str, ...] | None) -> "Inspection":
    """Inspect a file, in bounded memory where it is large."""
    from sprung.signals.inspection import inspect_blocks

    with progress_bar() as report:
        return inspect_blocks(records([path], sampling_rate=sampling_rate, channels=channels, report=report))


def _show(path: Path, inspection: "Inspection") -> None:
    """Print the facts about a file."""
    out = console()
    out.print(printable(str(path)), style="bold", soft_wrap=True)
    out.print(_summary(inspection))
    rows = [_row(facts, inspection.n_samples) for facts in inspection.channels]
    out.print(
        table("", ("channel", "quantity", "unit", "mean", "RMS", "lowest", "highest", "remarks"), rows, n_words=3)
    )
    out.print(notes(inspection.history))
    out.print()


def _summary(inspection: "Inspection") -> str:
    """Return length, rate, gaps and start in one line."""
    length = f"{inspection.n_samples} samples at {inspection.sampling_rate:.8g} Hz: {_time(inspection.duration)}"
    gaps = "no gaps"
    if inspection.n_gaps:
        gaps = f"{inspection.n_gaps} gap{'s' * (inspection.n_gaps > 1)} of {_time(inspection.gap_duration)} in all"
    start = ""
    if inspection.start is not None:
        start = f", from {datetime.fromtimestamp(inspection.start // 10**9, tz=UTC):%Y-%m-%d %H:%M:%S} UTC"
    return f"{length}, {gaps}{start}"


def _time(seconds: float) -> str:
    """Return a duration in its natural unit."""
    if seconds < 120:
        return f"{seconds:.4g} s"
    return f"{seconds / 60:.4g} min" if seconds < 7200 else f"{seconds / 3600:.4g} h"


def _row(facts: "ChannelFacts", n_samples: int) -> tuple[str, ...]:
    """Return a channel's row of the table."""
    levels = (facts.mean, facts.rms, facts.minimum, facts.maximum)
    numbers = ("" if level is None else f"{level:.4g}" for level in levels)
    return (facts.name, facts.quantity, facts.unit, *numbers, _remarks(facts, n_samples))


def _remarks(facts: "ChannelFacts", n_samples: int) -> str:
    """Return the faults of a channel in words."""
    shares = {
        "clipped": facts.clipped if facts.is_clipped else 0.0,
        "stuck": facts.stuck if facts.is_stuck else 0.0,
        "missing": 1 - facts.n_values / n_samples,
    }
    remarks = ["dead"] if facts.is_dead else []
    return ", ".join(remarks + [f"{what} {100 * share:.3g} %" for what, share in shares.items() if share > 0])
