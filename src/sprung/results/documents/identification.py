"""Documents of modes, of an identification and of modes over time, `sprung.identification|track/1`."""

import math
from collections.abc import Sequence
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field

from sprung._arrays import Complex
from sprung._checks import check_type, data_frame_of
from sprung._display import counted, in_short, listed
from sprung.identification import Identification, RovingSetups
from sprung.identification.methods import WindowModes
from sprung.identification.refinement import Refinement
from sprung.identification.tracking import Jump, Track, TrackedModes, TrackTrend
from sprung.modal import Modes
from sprung.recording import Channel
from sprung.results.documents.document import (
    Document,
    Number,
    Pair,
    Published,
    checked,
    plain,
    read_fields,
    write_document,
)
from sprung.results.documents.modes import IdentifiedMode, ModeValues, identified_modes, modes_from_documents, row_of
from sprung.signals.harmonics import Harmonic
from sprung.vehicles import Vehicle, structure
from sprung.vehicles.labels import MOTIONS, rigid_body_participation
from sprung.vehicles.sensor_layout import AnyVehicle

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Participation(Document):
    """Shares of the rigid-body motions in a mode, and the share of its shape that they explain."""

    bounce: float
    pitch: float
    roll: float
    explained: float


def participations(
    modes: Modes, channels: tuple[Channel, ...], vehicle: AnyVehicle | None
) -> tuple[Participation | None, ...]:
    """Return the shares of the rigid-body motions in each mode; None if the sensors do not determine them."""
    mass = structure(vehicle).mass[:3, :3] if isinstance(vehicle, Vehicle) else None
    shares, explained = rigid_body_participation(modes, channels, mass=mass)
    return tuple(
        None if math.isnan(share[0]) else Participation(**dict(zip(MOTIONS, plain(share), strict=True)), explained=fit)
        for share, fit in zip(shares, explained, strict=True)
    )


class SubsetValues(ModeValues):
    """A mode as identified from one subset of segments."""

    stable_rate: Number


class LevelTrend(Document):
    """Dependence of a mode on the level of the motion."""

    natural_frequency: float
    natural_frequency_std: float
    damping_ratio: float
    damping_ratio_std: float
    p_value: float
    level_ratio: float
    is_detected: bool


class MergedMode(IdentifiedMode):
    """A mode with the method that gave it, its share in the rigid-body motions, and its values in each subset."""

    source: Literal["ssi", "plscf", "fdd", "road_likelihood", "free_response"] = "ssi"
    participation: Participation | None
    subsets: tuple[SubsetValues | None, ...]
    level_trend: LevelTrend | None = None


class SubsetDocument(Document):
    """The modes of a subset of segments."""

    n_segments: int
    level: Pair | None
    modes: tuple[IdentifiedMode, ...]


class BandDocument(Document):
    """Fit of the modes in one band: numbers of the modes, and misfit of the spectra relative to chance."""

    band: Pair
    modes: tuple[int, ...]
    is_converged: bool
    misfit_before: Number
    misfit: Number
    misfit_excess: Number


class RefinedDocument(ModeValues):
    """Refinement of one mode: its values before, the change in standard deviations, or why there is none."""

    distance: Number
    reason: str | None


class RefinementDocument(Document):
    """Refinement of the modes, in their order, by the likelihood of the spectra."""

    modes: tuple[RefinedDocument, ...]
    bands: tuple[BandDocument, ...]


class SetUpDocument(Document):
    """A set-up of roving sensors, with its own modes."""

    number: int
    channels: tuple[str, ...]
    modes: tuple[IdentifiedMode, ...]
    members: tuple[int | None, ...]
    mac: tuple[Number, ...]


class SetUpsDocument(Document):
    """The set-ups that are merged."""

    references: tuple[str, ...]
    parts: tuple[SetUpDocument, ...]


class IdentificationDocument(Document):
    """An identification as stored in a file: without stabilisation diagrams and spectra."""

    schema_name: Literal["sprung.identification/1"] = Field(alias="schema")
    method: str
    channels: tuple[str, ...]
    sensors: tuple[Channel, ...] = ()
    sampling_rate: float
    band: tuple[Number, Number]
    modes: tuple[MergedMode, ...]
    subsets: tuple[SubsetDocument, ...]
    harmonics: tuple[Annotated[Harmonic, Published(unit=lambda line: _UNITS[line.kind])], ...]
    refinement: RefinementDocument | None = None
    settings: dict[str, Any]
    notes: tuple[str, ...]
    setups: SetUpsDocument | None = Field(default=None, exclude_if=lambda setups: setups is None)

    def __repr__(self) -> str:
        """Return method, channels and modes in words."""
        size = f"{counted(len(self.channels), 'channel')}: {counted(len(self.modes), 'mode')}"
        head = f"IdentificationDocument by {self.method} of {size}"
        return in_short(head, self.as_modes().in_words, *self.notes[:1])

    def _repr_html_(self) -> str:
        return self.as_modes()._repr_html_()

    def to_dataframe(self) -> Any:
        """Return the modes as a pandas.DataFrame, as `Modes.to_dataframe`."""
        return self.as_modes().to_dataframe()

    def plot(self) -> "Figure":
        """Return the picture of the mode shapes: on the body where the places of the sensors are known."""
        figure: Figure = resolve_name("sprung.results.figures.shapes:shapes_figure")(
            self.as_modes(), self.as_channels()
        )
        return figure

    def as_channels(self) -> tuple[Channel, ...]:
        """Return the outputs with quantity, position and direction, as far as the file states them."""
        return self.sensors or tuple(Channel(name) for name in self.channels)

    def as_modes(self) -> Modes:
        """Return the modes as arrays, for comparisons and pictures."""
        return modes_from_documents(self.modes, self.channels)


_UNITS = {"constant": "Hz", "drifting": "Hz", "speed": "1/m"}


def identification_document(
    identification: Identification, *, vehicle: AnyVehicle | None = None
) -> IdentificationDocument:
    """Return an identification as `sprung.identification/1`.

    Parameters
    ----------
    identification
        Result of any method.
    vehicle
        Vehicle of the identification, whose mass matrix weights the participation; None: equal masses.

    Examples
    --------
    >>> from sprung.identification import cov_ssi
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> masses = chain()
    >>> run = simulate(masses, usual_excitation(masses), duration=60.0, sampling_rate=200.0, seed=1)
    >>> identification = cov_ssi(run)
    >>> document = identification_document(identification)
    >>> document.schema_name, [round(mode.natural_frequency) for mode in document.modes]
    ('sprung.identification/1', [7, 20, 28])
    """
    check_type("identification", identification, Identification)
    settings = identification.effective_settings
    kept = {name: value for name, value in plain(settings).items() if (name, value) != ("kind", "auto")}
    lifter = None if settings.lifter is None else {"kind": type(settings.lifter).__name__, **plain(settings.lifter)}
    setups = identification.setups
    return IdentificationDocument.of(
        identification,
        channels=[channel.name for channel in identification.channels],
        sensors=identification.channels,
        modes=_merged_modes(identification, vehicle),
        subsets=[SubsetDocument.of(subset, modes=identified_modes(subset.modes)) for subset in identification.subsets],
        refinement=None if identification.refinement is None else _refinement(identification.refinement),
        settings={**kept, "lifter": lifter},
        setups=None if setups is None else _setups(setups),
    )


def _refinement(refinement: Refinement) -> RefinementDocument:
    modes = tuple(
        RefinedDocument(**row_of(refinement.start, ModeValues, k), distance=distance, reason=reason or None)
        for k, (distance, reason) in enumerate(zip(refinement.distances, refinement.reasons, strict=True))
    )
    return RefinementDocument.of(refinement, modes=modes)


def write_identification(
    identification: Identification, path: str | Path, *, vehicle: AnyVehicle | None = None
) -> None:
    """Write an identification as a JSON file, `sprung.identification/1`.

    Parameters
    ----------
    identification
        Result of any method.
    path
        File to write; an existing one is replaced.
    vehicle
        Vehicle of the identification, whose mass matrix weights the participation; None: equal masses.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import sprung
    >>> from sprung.identification import cov_ssi
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> masses = chain()
    >>> run = simulate(masses, usual_excitation(masses), duration=60.0, sampling_rate=200.0, seed=1)
    >>> identification = cov_ssi(run)
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "modes.json")
    ...     write_identification(identification, path)
    ...     again = sprung.read_identification(path)
    >>> len(again.modes), again.modes[0].natural_frequency == float(identification.modes.natural_frequency[0])
    (3, True)
    """
    write_document(identification_document(identification, vehicle=vehicle), path)


def read_identification(path: str | Path) -> IdentificationDocument:
    """Read an identification from a JSON file.

    Parameters
    ----------
    path
        File that `write_identification` or `sprung identify --json` wrote.

    Returns
    -------
    IdentificationDocument
        Modes, subsets, harmonics, settings and notes. The stabilisation diagrams and spectra of an `Identification`
        are not in the file.

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
    >>> from sprung.identification import cov_ssi
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> masses = chain()
    >>> run = simulate(masses, usual_excitation(masses), duration=60.0, sampling_rate=200.0, seed=1)
    >>> identification = cov_ssi(run)
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "modes.json")
    ...     sprung.write_identification(identification, path)
    ...     again = read_identification(path)
    >>> [round(mode.natural_frequency) for mode in again.modes]
    [7, 20, 28]
    """
    return checked(IdentificationDocument, read_fields(path), source=str(path))


def _setups(setups: RovingSetups) -> SetUpsDocument:
    parts = tuple(
        SetUpDocument.of(
            part,
            modes=identified_modes(part.identification.modes),
            members=tuple(None if member < 0 else int(member) for member in part.members),
            mac=tuple(part.mac.tolist()),
        )
        for part in setups.parts
    )
    return SetUpsDocument.of(setups, parts=parts)


def _merged_modes(identification: Identification, vehicle: AnyVehicle | None) -> list[dict[str, Any]]:
    return [
        {
            **dict(mode),
            "source": source,
            "participation": participation,
            "subsets": [
                row_of(subset.modes, SubsetValues, int(member)) if member >= 0 else None
                for subset, member in zip(identification.subsets, members, strict=True)
            ],
            "level_trend": trend,
        }
        for mode, source, participation, members, trend in zip(
            identified_modes(identification.modes),
            identification.sources,
            participations(identification.modes, identification.channels, vehicle),
            identification.members,
            _level_trends(identification),
            strict=True,
        )
    ]


def _level_trends(identification: Identification) -> list[dict[str, Any] | None]:
    trends = identification.level_trends
    if trends is None:
        return [None] * len(identification.modes)
    return [
        row_of(trends, LevelTrend, k) if np.isfinite(trends.p_value[k]) else None
        for k in range(len(identification.modes))
    ]


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
