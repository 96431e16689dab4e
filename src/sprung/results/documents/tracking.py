"""The document of modes followed over time, `sprung.track/1`."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field

from sprung._arrays import Complex
from sprung._checks import check_type, data_frame_of
from sprung._display import counted, in_short, listed
from sprung.identification.methods import WindowModes
from sprung.identification.tracking import Jump, Track, TrackedModes, TrackTrend
from sprung.results.documents.document import (
    Document,
    Number,
    checked,
    plain,
    read_fields,
    write_document,
)
from sprung.results.documents.identification import ModeValues


class TrackPoint(ModeValues):
    """A mode of a track in one window, and its MAC with the mean shape of the track."""

    window: int
    mac: float


class TrackedValues(Document):
    """A natural frequency [Hz] or damping ratio over time."""

    mean: float
    low: float
    high: float
    scatter: Number
    stated: Number
    trend: TrackTrend | None


class TrackDocument(Document):
    """One mode over time."""

    label: str | None
    first: float
    last: float
    presence: float
    natural_frequency: TrackedValues
    damping_ratio: TrackedValues
    mode_shape: Complex
    jumps: tuple[Jump, ...]
    points: tuple[TrackPoint, ...]


class TrackedWindow(Document):
    """A window: its time, its file, its number of modes, or why it has none."""

    time: float
    source: str
    n_modes: int
    reason: str


class TrackingDocument(Document):
    """Modes followed over windows or runs."""

    schema_name: Literal["sprung.track/1"] = Field(alias="schema")
    channels: tuple[str, ...]
    start: int | None
    time_unit: Literal["s", "windows"]
    windows: tuple[TrackedWindow, ...]
    tracks: tuple[TrackDocument, ...]
    untracked_modes: tuple[TrackPoint, ...]
    settings: dict[str, Any]
    notes: tuple[str, ...]

    def __repr__(self) -> str:
        """Return the numbers of tracks and windows, and the mean frequencies."""
        means = (
            f"{track.natural_frequency.mean:.4g} Hz{f' {track.label}' if track.label else ''} ({len(track.points)})"
            for track in self.tracks
        )
        return in_short(
            f"TrackingDocument: {counted(len(self.tracks), 'track')} over {counted(len(self.windows), 'window')}",
            listed(means),
        )

    def to_dataframe(self) -> Any:
        """Return the modes of the tracks as a pandas.DataFrame, as `TrackedModes.to_dataframe`.

        Raises
        ------
        MissingPackageError
            If pandas is not installed.
        """
        points = [
            (number, track.label, point) for number, track in enumerate(self.tracks, start=1) for point in track.points
        ]
        units = {"natural_frequency": "Hz", "natural_frequency_std": "Hz"}
        names = ("natural_frequency", "natural_frequency_std", "damping_ratio", "damping_ratio_std", "mac")
        return data_frame_of(
            {
                "track": [number for number, _, _ in points],
                "label": [label for _, label, _ in points],
                "window": [point.window for _, _, point in points],
                f"time [{self.time_unit}]": [self.windows[point.window].time for _, _, point in points],
                **{f"{name} [{units.get(name, '-')}]": [getattr(p, name) for _, _, p in points] for name in names},
            }
        )


def tracking_document(
    tracked: TrackedModes,
    windows: Sequence[WindowModes] | None = None,
    *,
    start: int | None = None,
    has_times: bool = True,
    notes: Sequence[str] = (),
) -> TrackingDocument:
    """Return tracked modes as `sprung.track/1`.

    Parameters
    ----------
    tracked
        Result of `track_modes`.
    windows
        Its windows with their sources and reasons; None: unknown.
    start
        Time of the first window, UTC in nanoseconds since 1970; None if unknown.
    has_times
        Whether times are seconds since the first window, not numbers of windows.
    notes
        Reservations, one sentence each.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.identification.tracking import track_modes
    >>> from sprung.modal import Modes
    >>> some = np.full(2, 0.01)
    >>> poles = 2 * np.pi * np.array([2.0, 5.0]) * (1j - 0.01)
    >>> modes = Modes(poles, np.eye(2, dtype=complex), ("a", "b"), some, some, np.ones(2), (None, None))
    >>> tracked = track_modes([modes] * 6, times=3600.0 * np.arange(6))
    >>> document = tracking_document(tracked)
    >>> document.schema_name, len(document.tracks), round(document.tracks[0].natural_frequency.mean)
    ('sprung.track/1', 2, 2)
    """
    return TrackingDocument.of(
        tracked,
        start=start,
        time_unit="s" if has_times else "windows",
        windows=_windows(tracked)
        if windows is None
        else [TrackedWindow.of(window, n_modes=0 if window.modes is None else len(window.modes)) for window in windows],
        tracks=[
            TrackDocument.of(track, first=track.times[0], last=track.times[-1], points=_points(track))
            for track in tracked.tracks
        ],
        untracked_modes=sorted(
            (point for track in tracked.untracked_modes for point in _points(track)),
            key=lambda point: (point.window, point.natural_frequency),
        ),
        settings=plain(tracked.settings),
        notes=tuple(notes),
    )


def write_tracking(tracked: TrackedModes, path: str | Path, *, start: int | None = None) -> None:
    """Write tracked modes as a JSON file, `sprung.track/1`.

    Parameters
    ----------
    tracked
        Result of `track_modes`.
    path
        File to write; an existing one is replaced.
    start
        Time of the first window, UTC in nanoseconds since 1970; None where unknown.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import sprung
    >>> import numpy as np
    >>> from sprung.identification.tracking import track_modes
    >>> from sprung.modal import Modes
    >>> some = np.full(2, 0.01)
    >>> poles = 2 * np.pi * np.array([2.0, 5.0]) * (1j - 0.01)
    >>> modes = Modes(poles, np.eye(2, dtype=complex), ("a", "b"), some, some, np.ones(2), (None, None))
    >>> tracked = track_modes([modes] * 6, times=3600.0 * np.arange(6))
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "tracks.json")
    ...     write_tracking(tracked, path)
    ...     again = sprung.read_tracking(path)
    >>> len(again.tracks)
    2
    """
    check_type("tracked", tracked, TrackedModes)
    write_document(tracking_document(tracked, start=start, has_times=tracked.has_times), path)


def read_tracking(path: str | Path) -> TrackingDocument:
    """Read tracked modes from a JSON file.

    Parameters
    ----------
    path
        File that `write_tracking` or `sprung track --json` wrote.

    Raises
    ------
    ParameterError
        If the file cannot be read.
    FormatError
        If it contains something else.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import sprung
    >>> import numpy as np
    >>> from sprung.identification.tracking import track_modes
    >>> from sprung.modal import Modes
    >>> some = np.full(2, 0.01)
    >>> poles = 2 * np.pi * np.array([2.0, 5.0]) * (1j - 0.01)
    >>> modes = Modes(poles, np.eye(2, dtype=complex), ("a", "b"), some, some, np.ones(2), (None, None))
    >>> tracked = track_modes([modes] * 6, times=3600.0 * np.arange(6))
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "tracks.json")
    ...     sprung.write_tracking(tracked, path, start=1_790_000_000_000_000_000)
    ...     again = read_tracking(path)
    >>> again.schema_name, len(again.tracks)
    ('sprung.track/1', 2)
    """
    return checked(TrackingDocument, read_fields(path), source=str(path))


def _windows(tracked: TrackedModes) -> list[TrackedWindow]:
    """Return the windows of tracks, with the number of modes of each."""
    counts = np.zeros(len(tracked.times), dtype=np.intp)
    for track in (*tracked.tracks, *tracked.untracked_modes):
        counts[track.windows] += 1
    return [
        TrackedWindow(time=time, source="", n_modes=int(count), reason="" if known else "no mode found")
        for time, count, known in zip(tracked.times, counts, tracked.has_result, strict=True)
    ]


def _points(track: Track) -> tuple[TrackPoint, ...]:
    likeness = track.likeness
    return tuple(
        TrackPoint(
            window=int(track.windows[k]),
            mac=likeness[k],
            **{name: getattr(track.modes, name)[k] for name in ModeValues.model_fields},
        )
        for k in range(len(track))
    )


def plain_tracking_document(tracked: TrackedModes) -> TrackingDocument:
    """Return the document of tracked modes whose windows have no names and no start."""
    return tracking_document(tracked, has_times=tracked.has_times)
