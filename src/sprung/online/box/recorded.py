"""Times of recordings that are replayed: their own, where they have one."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from os import PathLike

from sprung.errors import ParameterError
from sprung.formats import ReadSettings, read_blocks
from sprung.link import TIME_SET, TIME_UNKNOWN
from sprung.results.tables import counted, time_in_words


@dataclass(frozen=True, slots=True)
class ReplayTimes:
    """Times that files without start time get in a replay.

    Parameters
    ----------
    start
        Time of the first sample of the first of these files, UTC ns; the others follow.
    untimed
        Names of these files.
    is_given
        Whether the time was given by the operator.
    """

    start: int
    untimed: tuple[str, ...]
    is_given: bool

    @property
    def status(self) -> int:
        """Status of the time of the samples, as in `Frame`."""
        return TIME_UNKNOWN if self.untimed and not self.is_given else TIME_SET

    @property
    def in_words(self) -> list[str]:
        """Sentence about files without start time; empty if the times are those of the files."""
        if not self.untimed:
            return []
        others = f" and {counted(len(self.untimed) - 1, 'other file')}" if self.untimed[1:] else ""
        how = "as given" if self.is_given else "so that they end now; give --start TIME for the time of recording"
        begin = time_in_words(self.start)
        return [f"no start time in {self.untimed[0]}{others}: samples count from {begin} UTC on, {how}"]


def replay_times(
    paths: Sequence[str | PathLike[str]],
    *,
    now: int,
    start: str | None = None,
    settings: ReadSettings | None = None,
) -> ReplayTimes:
    """Return the times of recordings in a replay: files without start time end now, unless one is given.

    Parameters
    ----------
    paths
        Files in order of time.
    now
        Present time, UTC ns.
    start
        Time of the first sample of the first file without start time, ISO 8601, UTC unless it has another offset; None:
        unknown.
    settings
        As for `sprung.formats.read`.

    Raises
    ------
    ParameterError
        If the time cannot be read.
    SprungError
        As raised by `sprung.formats.read`.
    """
    given = None if start is None else _utc(start)
    durations = {}
    for path in paths:
        duration = _untimed_duration(path, settings)
        if duration is not None:
            durations[str(path)] = duration
    begin = now - round(1e9 * sum(durations.values())) if given is None else given
    return ReplayTimes(begin, tuple(durations), given is not None)


def _untimed_duration(path: str | PathLike[str], settings: ReadSettings | None) -> float | None:
    """Return the duration of a file without start time, with its gaps [s]; None if it has one."""
    duration = 0.0
    for part in read_blocks(path, settings=settings):
        if part.start is not None:
            return None
        duration += part.duration + sum(gap.duration for gap in part.gaps)
    return duration


def _utc(text: str) -> int:
    """Return the time in a text, UTC ns."""
    try:
        time = datetime.fromisoformat(text)
    except ValueError:
        raise ParameterError(f"--start {text!r} is not a time: write it like 2026-11-21T08:30 (UTC)") from None
    return round((time if time.tzinfo else time.replace(tzinfo=UTC)).timestamp()) * 10**9
