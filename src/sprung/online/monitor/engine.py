"""Monitoring of one vehicle: blocks of samples in, modes every two minutes and a diagnosis every ten minutes out."""

import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from sprung._checks import required
from sprung.diagnosis import Baseline, Diagnosis, Observation, TypeBaseline
from sprung.errors import ParameterError, SprungError
from sprung.identification import (
    METHODS,
    Identification,
    IdentificationSettings,
    RunningSummary,
    modes_of_summary,
    rate_for_body,
)
from sprung.link import Block, joined
from sprung.link.frame import part_of, plain_channels, restored_channels
from sprung.link.windows import WindowCutter
from sprung.modal import Modes
from sprung.online.monitor.assessment import Assessment, History
from sprung.online.monitor.events import Event, Identified, MonitorSettings, Observed, Restored
from sprung.recording import Gap, Recording
from sprung.results.documents import mode_documents
from sprung.signals.harmonics import Harmonic, harmonic_from_dict
from sprung.vehicles import Vehicle, vehicle_text

#: Shortest stretch of a window that modes are identified from [s].
_SHORTEST = 120.0
#: Length of the segments of a window that is not complete [s]: short enough for many of them after two minutes.
_SEGMENT = 10.0
#: Time after which lines are sought again [s].
_LINES_KNOWN = 3600.0
#: Damping ratio of a mode that may be an unknown line.
_NARROW = 0.05
#: Identification of a complete window, also for its page, and what that of an incomplete one has in common with it.
IDENTIFICATION = IdentificationSettings(has_road_modes=False, refine=False, allow_missing=True, kind="random")


class ModeIdentifier:
    """Identifies modes as the window of a vehicle grows.

    Parameters
    ----------
    settings
        Settings of the monitoring.

    Notes
    -----
    Modes of a complete window are those of the batch method. Until then a cheaper identification serves: the samples
    between one identification and the next are one record (`RunningSummary`), prepared and correlated once, at a rate
    for the modes of the body alone (`rate_for_body`). Lines, whose search takes half the time of an identification, are
    sought in a complete window and taken over for an hour, unless a complete window shows no mode, or one damped by at
    most 5 %, as a line would be: then they are sought, and the modes are identified anew.
    """

    def __init__(self, settings: MonitorSettings) -> None:
        self._settings = settings
        self._running: RunningSummary | None = None
        self._modes: tuple[dict[str, Any], ...] = ()
        self._harmonics: tuple[Harmonic, ...] | None = None
        self._lines_known = 0.0
        self.n_identified = 0

    def is_due(self, before: int, after: int, sampling_rate: float) -> bool:
        """Return whether modes are identified where the window has grown from one number of samples to another."""
        step = self._settings.identify_every * sampling_rate
        return bool(step) and after // step > before // step

    def begin(self) -> None:
        """Begin a new window."""
        self._running = None

    def identify(self, blocks: Sequence[Block], whole: Recording | None, vehicle: Vehicle) -> Identified:
        """Identify the modes of the whole window, or of the blocks of it so far."""
        self.n_identified += 1
        self._modes = ()
        reason = ""
        if sum(block.n_samples for block in blocks) < _SHORTEST * blocks[0].sampling_rate:
            reason = f"the window is shorter than {_SHORTEST:.0f} s"
        else:
            try:
                modes = self._so_far(blocks, vehicle) if whole is None else self._of_window(whole, vehicle)
                self._modes = tuple(mode_documents(modes))
            except SprungError as error:
                reason = str(error)
        return Identified(self.n_identified - 1, blocks[0].start, self._modes, reason)

    def state(self) -> dict[str, Any]:
        """Return everything that is needed to continue, as plain values."""
        return {
            "n_identified": self.n_identified,
            "modes": list(self._modes),
            "harmonics": None if self._harmonics is None else [asdict(line) for line in self._harmonics],
            "lines_known": self._lines_known,
        }

    @classmethod
    def from_state(cls, settings: MonitorSettings, state: Mapping[str, Any]) -> "ModeIdentifier":
        """Return what continues from a state."""
        identifier = cls(settings)
        identifier.n_identified = state["n_identified"]
        identifier._modes = tuple(state["modes"])
        lines = state["harmonics"]
        identifier._harmonics = None if lines is None else tuple(map(harmonic_from_dict, lines))
        identifier._lines_known = float(state["lines_known"])
        return identifier

    def _of_window(self, recording: Recording, vehicle: Vehicle) -> Modes:
        """Return the modes of the complete window, and keep the lines that it shows."""

        def identified(lines: tuple[Harmonic, ...] | None) -> Identification:
            settings = replace(IDENTIFICATION, harmonics=lines)
            return METHODS[self._settings.method](recording, settings=settings, vehicle=vehicle)

        is_known = self._lines_known > 0
        found = identified(self._harmonics if is_known else None)
        if is_known and _may_have_lines(found.modes):
            is_known, found = False, identified(None)
        self._harmonics = found.harmonics
        self._lines_known = (self._lines_known if is_known else _LINES_KNOWN) - self._settings.window
        return found.modes

    def _so_far(self, blocks: Sequence[Block], vehicle: Vehicle) -> Modes:
        """Return the modes of the body from the samples between one identification and the next, as records."""
        if self._running is None:
            settings = replace(
                IDENTIFICATION,
                harmonics=self._harmonics,
                decimate_to=rate_for_body(vehicle, blocks[0].sampling_rate),
                segment=_SEGMENT,
            )
            self._running = RunningSummary(
                self._settings.method, settings=settings, vehicle=vehicle, duration=self._settings.window
            )
        for record in self._records(blocks)[self._running.n_records :]:
            self._running.update(joined(record))
        return modes_of_summary(self._running.summary, vehicle=vehicle)

    def _records(self, blocks: Sequence[Block]) -> list[list[Block]]:
        """Return the blocks between one identification of the window and the next; a state holds no more of them."""
        records: list[list[Block]] = []
        record: list[Block] = []
        after = 0
        for block in blocks:
            record.append(block)
            before, after = after, after + block.n_samples
            if after >= _SHORTEST * block.sampling_rate and self.is_due(before, after, block.sampling_rate):
                records.append(record)
                record = []
        return records


def _may_have_lines(modes: Modes) -> bool:
    """Return whether a mode is damped so little that it may be a line, or lines may have hidden all modes."""
    return not len(modes.damping_ratio) or bool((modes.damping_ratio <= _NARROW).any())


#: Name and version of the documents.
SCHEMA = "sprung.vehicle-monitor/1"
_N_CHECKSUM = 4

#: Errors of values of other types, or that do not fit together.
_UNUSABLE = (ValueError, TypeError, LookupError, AttributeError, ArithmeticError)


class StateError(ParameterError):
    """A saved state that this program cannot continue from."""


def write_state(state: Mapping[str, Any]) -> bytes:
    """Return a state as bytes: CBOR, followed by 4 bytes CRC-32 of it, little-endian."""
    body: bytes = _cbor().dumps(dict(state))
    return body + _checksum(body)


def read_state(document: bytes) -> dict[str, Any]:
    """Return the state encoded in bytes.

    Raises
    ------
    StateError
        If they are not a state of this version, or damaged. No other error is raised.
    """
    cbor = _cbor()
    body = document[:-_N_CHECKSUM]
    if document[-_N_CHECKSUM:] != _checksum(body):
        raise StateError("the saved state is damaged, as its checksum does not match: start from scratch")
    try:
        state = cbor.loads(body)
    except (cbor.CBORError, *_UNUSABLE, RecursionError, MemoryError) as error:
        raise StateError(f"the saved state is not CBOR ({type(error).__name__}): start from scratch") from None
    return checked_state(state)


def checked_state(state: Any) -> dict[str, Any]:
    """Return a state if it is one of this version.

    Raises
    ------
    StateError
        If it is not.
    """
    schema = str(state.get("schema") if isinstance(state, Mapping) else None)[:60]
    if schema != SCHEMA:
        raise StateError(
            f"the saved state has the schema {schema!r}, and this program uses {SCHEMA}: install the sprung that wrote "
            "it, or start from scratch"
        )
    return dict(state)


def _checksum(body: bytes) -> bytes:
    return zlib.crc32(body).to_bytes(_N_CHECKSUM, "little")


@contextmanager
def unusable_as_state_error() -> Iterator[None]:
    """Raise errors of parts that are missing, of other types, or that do not fit together, as `StateError`."""
    try:
        yield
    except (*_UNUSABLE, SprungError) as error:
        raise StateError(f"the saved state is incomplete or invalid ({str(error)[:200]}): start from scratch") from None


def stored_block(block: Block) -> dict[str, Any]:
    """Return a block as plain values and bytes."""
    return {
        "samples": np.ascontiguousarray(block.samples, dtype="<f8").tobytes(),
        "channels": plain_channels(block.channels),
        "sampling_rate": block.sampling_rate,
        "start": block.start,
        "gaps": [[gap.index, gap.duration] for gap in block.gaps],
    }


def restored_block(stored: Mapping[str, Any]) -> Recording:
    """Return the block of plain values and bytes."""
    channels = restored_channels(stored["channels"])
    samples = np.frombuffer(stored["samples"], dtype="<f8").reshape(len(channels), -1)
    gaps = tuple(Gap(index, duration) for index, duration in stored["gaps"])
    return Recording(samples, stored["sampling_rate"], channels, stored["start"], gaps)


def _cbor() -> Any:
    """Return the package that encodes states."""
    return required("cbor2", purpose="the state of a vehicle", extra="online")


class VehicleMonitor:
    """Monitors one vehicle.

    Parameters
    ----------
    vehicle
        Vehicle with its sensors.
    settings
        Settings of the monitoring; None: windows of ten minutes, a baseline from twelve of them.
    baseline
        Baseline learnt before; None: one is learnt from the first windows.
    type_baseline
        Baseline of the vehicle's type: until the vehicle has a baseline its windows are compared with it, and it is the
        prior of that baseline. None: unknown.

    Notes
    -----
    Windows hold a fixed number of samples in order of arrival, independent of the division into blocks
    (`WindowCutter`). Modes are identified as the window grows (`ModeIdentifier`). A complete window is processed by the
    functions that process recordings (`Assessment`): `observe_window`, `learn`, `ChangeDetector` and `diagnosis_of`.
    Score, decision and learning are separate: only `learn_again` starts learning again, and only `restore` returns
    to an earlier baseline. A vehicle that deviates from its type gets no first baseline until `learn_again`: its fault
    would be normal from then on.

    Memory: the samples of one window, and 96 observations of about 4 kB each with four outputs and twelve components.
    While a baseline is learnt, an observation also holds the correlations of its segments for the residual test (170 kB
    in ten minutes): 2 MB with twelve windows, released when it is learnt.

    A sensor of the vehicle file that the samples lack counts as failing, like a dead one, unless the baseline was
    learnt without it: monitoring continues, and the window is not used for learning.

    The first three windows of a learning phase decide whether the vehicle file is calibrated (`Completion`). If so,
    learning starts again with the windows that follow, in terms of the completed file, which the baseline keeps and
    which is used from then on.

    Samples that were analysed before, as when a recording is replayed again, are skipped (`Repeats`) until learning
    starts again or the vehicle file changes.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        *,
        settings: MonitorSettings | None = None,
        baseline: Baseline | None = None,
        type_baseline: TypeBaseline | None = None,
    ) -> None:
        self._given = vehicle
        self._settings = settings or MonitorSettings()
        self._cutter = WindowCutter(self._settings.window)
        self._blocks: list[Block] = []
        self._identifier = ModeIdentifier(self._settings)
        self._assessment = Assessment(vehicle, self._settings, baseline=baseline, type_baseline=type_baseline)
        self._n_windows = 0

    @property
    def vehicle(self) -> Vehicle:
        """Vehicle as its file describes it, or as completed by calibration."""
        return self._assessment.vehicle

    @property
    def settings(self) -> MonitorSettings:
        """Settings of the monitoring."""
        return self._settings

    @property
    def baseline(self) -> Baseline | None:
        """Normal state of the vehicle; None before it is learnt."""
        return self._assessment.baseline

    @property
    def type_baseline(self) -> TypeBaseline | None:
        """Normal state of the vehicles of its type; None if unknown."""
        return self._assessment.type_baseline

    @property
    def is_learning(self) -> bool:
        """Whether the windows are collected for a baseline."""
        return self._assessment.is_learning

    @property
    def learning(self) -> tuple[int, int]:
        """Number of windows for the next baseline so far, and number needed; equal if nothing is being learnt."""
        return self._assessment.learning

    @property
    def coverage(self) -> str:
        """What the windows have brought of the information that a baseline needs, in words; empty if none is learnt."""
        return self._assessment.coverage

    @property
    def diagnosis(self) -> Diagnosis | None:
        """Diagnosis of the windows since the baseline; while it is being learnt, against the type, if that is known."""
        return self._assessment.diagnosis

    @property
    def observations(self) -> tuple[Observation, ...]:
        """Windows held for diagnosis, oldest first."""
        return self._assessment.observations

    @property
    def buffered(self) -> float:
        """Share of the present window that has been received, 0 to 1."""
        return self._cutter.share

    @property
    def note(self) -> str:
        """Why the last window was inconclusive or not used for learning, or limits of the baseline; empty otherwise."""
        return self._assessment.note

    @property
    def until(self) -> int | None:
        """Time after the last sample, UTC ns; None before the first."""
        return self._cutter.repeats.end

    @property
    def repeated(self) -> float:
        """Duration of the samples that arrived last and were analysed before [s]; 0 after new ones."""
        return self._cutter.repeats.repeated

    def update(self, block: Block) -> tuple[Event, ...]:
        """Add samples and return the events that they complete.

        Parameters
        ----------
        block
            Samples of any length, a `Recording` or a `FrameBlock`. With other channels or another rate than before, a
            new window begins.

        Returns
        -------
        tuple of Identified or Observed
            Events in order of time; empty for samples that were analysed before.
        """
        events: list[Event] = []
        for piece in self._cutter.cut(block):
            if not piece.n_before:
                self._blocks = []
                self._identifier.begin()
            self._blocks.append(part_of(block, piece.first, piece.last))
            whole = joined(self._blocks) if piece.is_last else None
            after = piece.n_before + piece.last - piece.first
            if self._identifier.is_due(piece.n_before, after, block.sampling_rate):
                events.append(self._identifier.identify(self._blocks, whole, self.vehicle))
            if whole is not None:
                self._blocks = []
                events.append(self._complete(whole))
        return tuple(events)

    def learn_again(self, reason: str) -> None:
        """Forget the windows so far and learn a new baseline, such as after maintenance.

        Parameters
        ----------
        reason
            Reason, such as "new dampers"; it is kept in the baseline.

        Raises
        ------
        ParameterError
            If the reason is empty.
        """
        if not reason.strip():
            raise ParameterError("a new baseline needs a reason, such as 'new dampers'")
        self._assessment.learn_again(reason.strip())
        self._cutter.repeats.forget()

    def restore(self, baseline: Baseline) -> Restored:
        """Forget the windows so far and assess the next ones by an earlier baseline, such as after learning a fault.

        Parameters
        ----------
        baseline
            The earlier baseline, with its new version and the reason.

        Returns
        -------
        Restored
            Event that states the baseline in use.

        Notes
        -----
        Learning in progress ends without a baseline. Windows are observed in terms of the vehicle file with
        which the baseline was learnt.
        """
        self._assessment.restore(baseline)
        self._cutter.repeats.forget()
        return Restored(baseline)

    def state(self) -> dict[str, Any]:
        """Return everything that is needed to continue, as plain values and bytes."""
        return {
            "schema": SCHEMA,
            "vehicle": self.vehicle.name,
            "file": vehicle_text(self._given),
            "settings": asdict(self._settings),
            "n_windows": self._n_windows,
            "windows": self._cutter.state,
            "blocks": [stored_block(block) for block in self._blocks],
            **self._identifier.state(),
            **self._assessment.state(),
        }

    @classmethod
    def from_state(
        cls, vehicle: Vehicle, state: Mapping[str, Any], *, type_baseline: TypeBaseline | None = None
    ) -> "VehicleMonitor":
        """Return a monitor that continues from a state.

        Parameters
        ----------
        vehicle
            Vehicle with its sensors.
        state
            State from `state`.
        type_baseline
            Baseline of the vehicle's type from now on; None: that of the state.

        Raises
        ------
        StateError
            If the state is incomplete or invalid, or of another version.
        """
        known = checked_state(state)
        with unusable_as_state_error():
            settings = MonitorSettings(**known["settings"])
            monitor = cls(vehicle, settings=settings)
            monitor._n_windows = known["n_windows"]
            monitor._cutter = WindowCutter(settings.window, known["windows"])
            monitor._blocks = [restored_block(block) for block in known["blocks"]]
            monitor._identifier = ModeIdentifier.from_state(settings, known)
            monitor._assessment = Assessment.from_state(vehicle, settings, known, type_baseline)
            if known["file"] != vehicle_text(vehicle):
                monitor._cutter.repeats.forget()
        return monitor

    @classmethod
    def from_history(
        cls,
        vehicle: Vehicle,
        history: History,
        *,
        settings: MonitorSettings,
        type_baseline: TypeBaseline | None = None,
    ) -> "VehicleMonitor":
        """Return a monitor that starts again from stored results, as the saved state is lost.

        Parameters
        ----------
        vehicle
            As for the class.
        history
            Stored results of the vehicle.
        settings, type_baseline
            As for the class.

        Raises
        ------
        StateError
            If the results cannot be used.

        Notes
        -----
        Statistics of the residual test, samples of an incomplete window and the memory of repeated samples are not in
        the store: they begin with the next samples.
        """
        monitor = cls(vehicle, settings=settings, type_baseline=type_baseline)
        monitor._n_windows = history.n_windows
        monitor._identifier.n_identified = history.n_identified
        with unusable_as_state_error():
            monitor._assessment.recall(history)
        return monitor

    def _complete(self, recording: Recording) -> Observed:
        """Process the complete window."""
        number = self._n_windows
        self._n_windows += 1
        time = recording.start / 1e9 if recording.start is not None else number * self._settings.window
        observation, diagnosis, learnt = self._assessment.update(recording, time=time)
        return Observed(number, recording, observation, diagnosis, learnt)
