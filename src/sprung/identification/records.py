"""From recordings to the correlations of their segments, record by record."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from operator import add

import numpy as np

from sprung._arrays import Booleans
from sprung.errors import DataError
from sprung.identification.band_fits import RecordSpectra, record_spectra
from sprung.identification.correlation import SegmentCorrelations, correlate_segments, join_segments, with_limited_power
from sprung.identification.fdd import with_long_segments
from sprung.identification.levels import LevelCorrelations, correlate_by_level, joined_levels
from sprung.identification.planning import (
    Prepared,
    highest_line,
    make_plan,
    plan_preparation,
    prepare,
    search_harmonics,
    without_slow_motion,
)
from sprung.identification.settings import COV, IdentificationSettings, Method, Plan, PreparationPlan
from sprung.recording import Channel, Recording
from sprung.signals.data_faults import REST_DURATION, REST_RUN_SHARE, has_runs, stuck_runs
from sprung.signals.harmonics import Harmonic, in_families, subtract_lines, with_present_bands, without_side_lines
from sprung.signals.inspection import doubts_of, inspect
from sprung.signals.spectrum import SpectralMatrix
from sprung.vehicles.labels import plausibility_notes
from sprung.vehicles.sensor_layout import (
    AnyVehicle,
    channels_without_motion,
    check_present,
    is_drive,
    layout_notes,
    output_channels,
    speed_channel,
    usable,
)

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
    samples, faults, n_samples = recording.samples, [], recording.n_samples
    for fact in facts:
        is_missing = fact.n_values < n_samples
        if fact.is_dead or not (fact.is_clipped or fact.stuck or is_missing):
            continue
        row = recording.index(fact.name)
        dead = _dead_samples(recording, row) if fact.stuck else np.zeros(0, dtype=np.intp)
        share = dead.size / n_samples
        is_left_out = share > _MOSTLY_DEAD
        if dead.size and not is_left_out:
            samples = samples.copy() if samples is recording.samples else samples
            samples[row, dead] = np.nan
        if fact.is_clipped or dead.size or is_missing:
            clipped = fact.clipped if fact.is_clipped else 0.0
            faults.append(ChannelFault(fact.name, clipped, share, 1 - fact.n_values / n_samples, is_left_out))
    left_out = {fault.channel for fault in faults if fault.is_left_out}
    if samples is not recording.samples:
        recording = recording.changed("dead parts of channels marked as missing", samples=samples)
    if left_out:
        recording = recording.select([name for name in recording.names if name not in left_out])
    return recording, tuple(faults)


def note_on_faults(records: Sequence[Sequence[ChannelFault]]) -> tuple[str, ...]:
    """Return one sentence on the faults of all records, with the largest share of each; none without faults."""
    channels: dict[str, list[ChannelFault]] = {}
    for fault in (fault for faults in records for fault in faults):
        channels.setdefault(fault.channel, []).append(fault)
    parts = [f"{channel} ({_describe_faults(faults)})" for channel, faults in channels.items()]
    return (f"faults of channels: {', '.join(parts)}: check ranges, sensors and wiring",) if parts else ()


def _describe_faults(faults: Sequence[ChannelFault]) -> str:
    """Return the faults of one channel in words."""
    clipped, dead, missing = (max(getattr(fault, name) for fault in faults) for name in ("clipped", "dead", "missing"))
    what = "channel" if any(fault.is_left_out for fault in faults) else "this part of the record"
    words = (
        (clipped, f"clipped in {100 * clipped:.2g} % of its samples, which distorts the motion"),
        (dead, f"dead in {100 * dead:.2g} %, {what} left out"),
        (missing, f"missing in {100 * missing:.2g} %, this part of the record left out"),
    )
    return ", ".join(word for share, word in words if share)


def _dead_samples(recording: Recording, row: int) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Return the indices of the samples in long runs of one value."""
    breaks = [gap.index for gap in recording.gaps]
    starts, lengths = stuck_runs(recording.samples[row], recording.sampling_rate, breaks=breaks)
    shortest = max(REST_DURATION * recording.sampling_rate, REST_RUN_SHARE * recording.n_samples)
    is_long = lengths >= shortest
    runs = [np.arange(start, start + n) for start, n in zip(starts[is_long], lengths[is_long], strict=True)]
    return np.concatenate(runs) if runs else np.zeros(0, dtype=np.intp)


#: Function called with the current step in words and the share that is done, 0 to 1.
Progress = Callable[[str, float], None]


@dataclass(frozen=True, eq=False, slots=True)
class CorrelatedRecords:
    """Correlations, spectra and harmonics of one record, or of all records of one condition.

    Parameters
    ----------
    plan
        Decisions made from the first usable record.
    channels
        Outputs.
    segments
        Correlations of all segments, the power of loud segments limited.
    counts
        Number of segments of each record.
    levels
        Correlations by segment and by the level just before; None where they are not needed.
    spectra, edited_spectra
        Spectral matrices of all records before and after cepstrum editing (None without editing).
    harmonics
        Lines that at least half of the records show.
    notes
        Records that were left out and why, and faults of channels, one sentence each.
    lines
        Spectra of the prepared records for the refinement of modes; None where nothing is refined.
    """

    plan: Plan
    channels: tuple[Channel, ...]
    segments: SegmentCorrelations
    counts: tuple[int, ...]
    levels: LevelCorrelations | None
    spectra: SpectralMatrix
    edited_spectra: SpectralMatrix | None
    harmonics: tuple[Harmonic, ...]
    notes: tuple[str, ...]
    lines: RecordSpectra | None


class RunningRecords:
    """Correlations of the records of one condition, prepared one at a time as planned from the first usable one.

    Parameters
    ----------
    method
        Method, which sorts and cuts the records.
    settings
        Settings as given.
    vehicle
        Vehicle whose sensors are the outputs and whose modes give the band; None: from the data.
    total_duration
        Duration of all records [s]; None: that of the first usable one.
    """

    def __init__(
        self,
        method: Method,
        *,
        settings: IdentificationSettings,
        vehicle: AnyVehicle | None,
        total_duration: float | None = None,
    ) -> None:
        self._method = method
        self._settings = settings
        self._vehicle = vehicle
        self._total_duration = total_duration
        self._n_records = 0
        self._parts: list[CorrelatedRecords] = []
        self._left_out: dict[int, DataError] = {}
        self._faults: list[tuple[ChannelFault, ...]] = []
        self._notes: dict[str, None] = {}

    @property
    def n_records(self) -> int:
        """Number of records so far, including those that were left out."""
        return self._n_records

    @property
    def correlated(self) -> CorrelatedRecords:
        """Correlations of all usable records so far.

        Raises
        ------
        DataError
            If there is no record, or no record is usable, with the reason of the first.
        ParameterError
            If records differ in channels or sampling rate.
        """
        if not self._parts:
            nothing = DataError("there is no recording to identify modes from: give at least one")
            raise next(iter(self._left_out.values()), nothing)
        levels = [record.levels for record in self._parts if record.levels is not None]
        edited = [record.edited_spectra for record in self._parts if record.edited_spectra is not None]
        lines = [record.lines for record in self._parts if record.lines is not None]
        return replace(
            self._parts[0],
            segments=with_limited_power(join_segments([record.segments for record in self._parts])),
            counts=tuple(count for record in self._parts for count in record.counts),
            levels=joined_levels(levels) if levels else None,
            spectra=reduce(add, [record.spectra for record in self._parts]),
            edited_spectra=reduce(add, edited) if edited else None,
            harmonics=_common_harmonics([record.harmonics for record in self._parts]),
            notes=(
                *self._notes,
                *(f"record {number} left out: {error}" for number, error in self._left_out.items()),
                *note_on_faults(self._faults),
            ),
            lines=reduce(add, lines) if lines else None,
        )

    def update(self, record: Recording) -> None:
        """Prepare and correlate a record, as planned from the first usable one; leave out one that is not usable.

        Parameters
        ----------
        record
            Record as read.

        Raises
        ------
        ParameterError
            If a setting does not suit the record, or it lacks a sensor of the vehicle file.
        """
        self._n_records += 1
        try:
            self._note(record)
            usable_part, faults = self._usable(record)
            self._faults.append(faults)
            if self._parts:
                self._parts.append(self._next(usable_part, faults))
            else:
                self._parts.append(self._first(usable_part, is_drive(record)))
        except DataError as error:
            self._left_out[self._n_records] = error

    def _note(self, record: Recording) -> None:
        """Note what is unusual in a record as read, in the layout of its sensors, and in the vehicle file."""
        vehicle = self._vehicle
        if self._n_records == 1 and vehicle is not None:
            self._notes.update(dict.fromkeys(plausibility_notes(vehicle)))
        self._notes.update(dict.fromkeys(doubts_of(record)))
        if vehicle is not None:
            self._notes.update(dict.fromkeys(layout_notes(record, vehicle)))

    def _usable(self, record: Recording) -> tuple[Recording, tuple[ChannelFault, ...]]:
        """Return the usable part of a record and the faults of its channels."""
        vehicle = self._vehicle
        if vehicle is not None:
            check_present(record.names, vehicle.sensor, allow_missing=self._settings.allow_missing)
        outputs = [name for name in output_channels(record, vehicle) if name in record.names]
        has_sensors = vehicle is not None and bool(vehicle.sensor)
        left_out = [] if has_sensors else [name for name in channels_without_motion(record) if name not in outputs]
        if left_out:
            self._notes[f"channels that are no motion take no part: {', '.join(left_out)}"] = None
        living, faults = without_dead_parts(record, outputs) if outputs else (record, ())
        return usable(living, vehicle=vehicle, allow_missing=True), faults  # a dead channel is not missing

    def _first(self, recording: Recording, is_driven: bool) -> CorrelatedRecords:
        """Plan from the first usable record, and correlate it."""
        method, settings = self._method, self._settings
        duration = self._total_duration or recording.duration
        preparation = plan_preparation(
            recording, settings=settings, vehicle=self._vehicle, is_drive=is_driven, total_duration=duration
        )
        harmonics = _harmonics(recording, preparation, settings, self._vehicle)
        if harmonics and settings.band is None and settings.ladder is None and self._vehicle is None:
            searched = highest_line(preparation)
            preparation = plan_preparation(
                recording, settings=settings, harmonics=harmonics, searched=searched, is_drive=is_driven
            )
        if method.has_long_spectra:
            preparation = with_long_segments(preparation, recording, total_duration=duration, segment=settings.segment)
        prepared = prepare(recording, preparation, lifter=settings.lifter)
        own = COV if _is_by_level(method, settings) else method
        plan = make_plan(preparation, prepared, harmonics, settings=settings, method=own, total_duration=duration)
        if plan.preparation.high_pass != preparation.high_pass:
            prepared = without_slow_motion(prepared, plan.preparation.high_pass)
        return _correlate(method, prepared, harmonics, plan, settings)

    def _next(self, recording: Recording, faults: Sequence[ChannelFault]) -> CorrelatedRecords:
        """Correlate a record after the first, whose channels must not be left out of it."""
        plan = self._parts[0].plan
        for fault in faults:
            if fault.is_left_out and fault.channel in plan.preparation.channels:
                raise DataError(
                    f"channel {fault.channel!r} is dead in {100 * fault.dead:.2g} % of it, but not in the first record"
                )
        prepared = prepare(recording, plan.preparation, lifter=self._settings.lifter)
        harmonics = _harmonics(recording, plan.preparation, self._settings, self._vehicle)
        return _correlate(self._method, prepared, harmonics, plan, self._settings)


def _harmonics(
    recording: Recording, plan: PreparationPlan, settings: IdentificationSettings, vehicle: AnyVehicle | None
) -> tuple[Harmonic, ...]:
    """Return the known harmonics, in the bands of this record, or those that it shows."""
    speed = speed_channel(recording, vehicle)
    if settings.harmonics is not None:
        return with_present_bands(settings.harmonics, recording, speed=speed)
    return search_harmonics(recording, plan, speed=speed)


def _is_by_level(method: Method, settings: IdentificationSettings) -> bool:
    """Return whether products are sorted by the level just before them."""
    return method.is_sorted and not settings.has_own_levels


def _correlate(
    method: Method,
    prepared: Prepared,
    harmonics: tuple[Harmonic, ...],
    plan: Plan,
    settings: IdentificationSettings,
) -> CorrelatedRecords:
    """Correlate the segments of one prepared record."""
    # The thesis keeps the lines in and judges the poles on them.
    motion = prepared.motion if settings.ladder is not None else subtract_lines(prepared.motion, harmonics)
    n_lags, references = plan.ladder.n_lags, settings.references
    is_by_level = _is_by_level(method, settings)
    segments = correlate_segments(
        motion,
        n_lags=n_lags,
        segment=plan.segment,
        references=references,
        is_continued=is_by_level or not method.has_own_segments,
    )
    levels = None
    if is_by_level:
        levels = correlate_by_level(motion, n_lags=n_lags, segment=plan.segment, references=references)
    return CorrelatedRecords(
        plan=plan,
        channels=motion.channels,
        segments=segments,
        counts=(segments.n_segments,),
        levels=levels,
        spectra=prepared.spectra,
        edited_spectra=prepared.edited_spectra,
        harmonics=harmonics,
        notes=(),
        lines=record_spectra(motion, plan) if settings.refine and settings.lifter is None else None,
    )


def _common_harmonics(records: Sequence[Sequence[Harmonic]]) -> tuple[Harmonic, ...]:
    """Return the lines that at least half of the records show, each as in the record where it is most prominent.

    Lines proportional to speed have the band of all records.
    """
    lines = sorted((line for lines in records for line in lines), key=lambda line: -line.prominence)
    n_records = sum(_same(lines, others).any(axis=1) for others in records) if lines else np.zeros(0)
    common = [
        line for line, n in zip(lines, np.broadcast_to(n_records, len(lines)), strict=True) if 2 * n >= len(records)
    ]
    is_same = _same(common, common)
    kept: list[int] = []
    for row in range(len(common)):
        if not is_same[row, kept].any():
            kept.append(row)
    chosen = [_over_all(common[row], [common[k] for k in np.flatnonzero(is_same[row])]) for row in kept]
    chosen.sort(key=lambda line: (line.kind, line.frequency))
    return without_side_lines(in_families(chosen) if len(records) > 1 else chosen)


def _over_all(line: Harmonic, same: Sequence[Harmonic]) -> Harmonic:
    """Return a line with the band that it sweeps in all records if it is proportional to speed."""
    if line.kind != "speed":
        return line
    return replace(line, band=(min(each.band[0] for each in same), max(each.band[1] for each in same)))


def _same(lines: Sequence[Harmonic], others: Sequence[Harmonic]) -> Booleans:
    """Return which lines are of one kind and within the coarser resolution of each other, shape (lines, others)."""
    width = np.maximum.outer([line.resolution for line in lines], [other.resolution for other in others])
    distance = np.abs(np.subtract.outer([line.frequency for line in lines], [other.frequency for other in others]))
    is_one_kind = np.equal.outer([line.kind == "speed" for line in lines], [other.kind == "speed" for other in others])
    return np.asarray(is_one_kind & (distance <= width), dtype=np.bool_)
