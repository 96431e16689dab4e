"""Choices from the data (band, sampling rate, block rows, orders, segments) and the preparation that they ask for."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from scipy import special

from sprung._arrays import Booleans, Complex, Real
from sprung._checks import check_number
from sprung.errors import DataError, ParameterError
from sprung.identification.ladders import Ladder, OrderLadder, suitable_ladder
from sprung.identification.settings import IdentificationSettings, Method, Plan, PreparationPlan
from sprung.modal import Modes, unit_shapes
from sprung.recording import Recording
from sprung.signals.conditioning import PASS_BAND, band_pass, decimate, detrend, scale
from sprung.signals.harmonics import Harmonic, find_harmonics, subtract_lines
from sprung.signals.spectrum import Exponential, Lifter, SpectralMatrix, edit, spectral_matrix, subtract_lifter_damping
from sprung.vehicles import structure
from sprung.vehicles.labels import body_range
from sprung.vehicles.sensor_layout import AnyVehicle, speed_channel


@dataclass(frozen=True, slots=True)
class PlanningRules:
    """Rules by which band, sampling rate, ladder and segments follow from the data."""

    #: Largest relative difference of sampling rates that count as one: loggers of one kind differ by their clocks.
    same_rate: float = 5e-4
    #: Probability of calling anything a harmonic in a record without any.
    false_lines: float = 1e-4
    #: Lines are searched for below half of this rate [Hz], where wheels and engines turn, even if modes lie far lower.
    rate_for_lines: float = 200.0
    #: The band begins above this share of the coherent power, per octave.
    power_above: float = 0.01
    #: The band ends above this share of it ...
    power_below: float = 0.99
    #: ... times this margin, as a peak at the edge has an upper half.
    margin: float = 1.25
    #: Probability that the coherence of independent channels counts as significant in a bin.
    chance_of_coherence: float = 1e-3
    #: The band around a vehicle's modes begins at this share of the lowest, for loads and soft springs ...
    below_lowest: float = 0.3
    #: ... and ends at this multiple of the highest.
    above_highest: float = 1.5
    #: Least sampling rate over the band's upper edge: decimation passes 0.8 of the new Nyquist frequency.
    rate_over_band: float = 3.0
    #: The same for a given band, which may end just above its modes: heavily damped ones then need more margin.
    rate_over_given_band: float = 5.0
    #: The same for the highest plausible frequency of a mode of the body, where those modes alone are of interest.
    rate_over_body: float = 11.0
    #: The lags span this many periods of the slowest motion ...
    periods_of_lags: float = 4.0
    #: ... but at most this multiple of the memory, as heavily damped motion decays before many periods ...
    memories_of_lags: float = 4.0
    #: ... which is the lag up to which this share of the power of the cross-correlations lies.
    power_remembered: float = 0.8
    #: Fewest block rows: fewer do not separate modes from noise.
    min_rows: int = 20
    #: Most block rows ...
    max_rows: int = 100
    #: ... and most rows of the block matrix, as the time rises with the third power.
    max_matrix: int = 400
    #: Fewest periods of a mode within the lags.
    min_periods: float = 1.2
    #: Highest mode over the sampling rate, where decimation passes everything.
    highest_mode: float = 0.4
    #: Bounds of half the largest model order.
    half_orders: tuple[int, int] = (20, 30)
    #: Lags from one block row to the next grow by this factor from realisation to realisation ...
    stride: int = 3
    #: ... of which there are at most this many ...
    max_strides: int = 3
    #: ... where the block rows would otherwise span less than this share of the time that the lags are to span.
    spanned: float = 0.67
    #: Least ratio of the whole record to the span of the lags.
    record_over_lags: float = 11.0
    #: Least ratio of a stretch to it.
    stretch_over_lags: float = 4.0
    #: The high-pass over the lowest natural frequency that the lags resolve.
    high_pass: float = 0.6
    #: Least share of a channel's power below it for which there is one: it costs accuracy of heavily damped modes.
    slow_share: float = 0.2
    #: Fewest samples of the longest stretch after decimation, where the rate is chosen, ...
    min_samples: int = 200
    #: ... and at all: 100 samples show two thirds of the modes that 200 show, and no more that are none.
    fewest_samples: int = 100
    #: Segments of all records (Cov-SSI): blocks for the standard deviations.
    blocks_of_a_record: int = 48
    #: Shortest of them over the span of the lags.
    lag_spans_of_a_block: float = 1.2
    #: Fewest of them of a drive, as its body needs no longer lags and standard deviations need ten.
    blocks_of_a_drive: int = 10
    #: Segments of a subset.
    segments_of_a_subset: int = 12
    #: Shortest of them over the span of the lags.
    lag_spans_of_a_segment: float = 3.0
    #: Segments of the spectra.
    averages: int = 24
    #: Segments of those for the lowest frequencies, from their second line.
    min_averages: int = 6
    #: Longest segment of the spectra from which the band is chosen [samples].
    max_spectrum: int = 8192
    #: Slow motion ends, and resonance begins, where the power common to the channels rises by this factor.
    rise: float = 4.0
    #: Probability that the channels of a record without common motion show a peak of coherence at any frequency.
    chance_of_peak: float = 1e-3
    #: Overlapping segments of the spectra that are worth one independent segment.
    segments_of_one: float = 1.06
    #: Fewest periods of a segment of the spectra in a peak: slower motion is drift.
    periods_of_peak: int = 4
    #: Band [Hz] that the content of a drive holds, ...
    of_body: tuple[float, float] = (0.8, 8.0)
    #: ... and the band that is searched for the modes of the body and of wheels where it does not.
    of_drive: tuple[float, float] = (0.4, 20.0)
    #: Share of its frequency up to which a line of an engine or a machine wanders.
    wandering: float = 0.03
    #: A fundamental with this many multiples is a pulse train ...
    lines_of_a_pulse_train: int = 5
    #: ... whose pulses act like any random excitation at lags up to this share of its period.
    of_pulse_period: float = 0.9


_RULES = PlanningRules()


@dataclass(frozen=True, eq=False, slots=True)
class Prepared:
    """A record ready for correlation.

    Parameters
    ----------
    motion
        Outputs: edited, decimated, without motion below the band, RMS about 1.
    spectra, edited_spectra
        Spectral matrices of the decimated outputs before and after cepstrum editing (None without editing).
    """

    motion: Recording
    spectra: SpectralMatrix
    edited_spectra: SpectralMatrix | None


def prepare(recording: Recording, plan: PreparationPlan, *, lifter: Lifter | None = None) -> Prepared:
    """Prepare one record as planned.

    Parameters
    ----------
    recording
        Usable part of a record (`sprung.vehicles.sensor_layout`), with the channels of the plan.
    plan
        Decisions from `plan_preparation`.
    lifter
        Lifter for cepstrum editing; None: no editing.

    Returns
    -------
    Prepared

    Raises
    ------
    DataError
        If a channel has missing values, or the record is too short for the filters or the spectra.
    ParameterError
        If a channel of the plan is missing.
    """
    outputs = _at_common_rate(recording, plan).select(plan.channels)
    decimated = _decimate_to(outputs, plan.decimate_to)
    spectra = spectral_matrix(decimated, segment_length=plan.spectrum_segment)
    motion, edited_spectra = detrend(decimated, degree=plan.trend), None
    if lifter is not None:
        motion = _decimate_to(edit(detrend(outputs, degree=plan.trend), lifter), plan.decimate_to)
        edited_spectra = spectral_matrix(motion, segment_length=plan.spectrum_segment)
    return without_slow_motion(Prepared(scale(motion, plan.factors), spectra, edited_spectra), plan.high_pass)


def without_slow_motion(prepared: Prepared, edge: float) -> Prepared:
    """Return the record with the motion below an edge [Hz] filtered out; 0: as it is."""
    return replace(prepared, motion=band_pass(prepared.motion, edge, None)) if edge > 0 else prepared


def search_harmonics(recording: Recording, plan: PreparationPlan, *, speed: str | None) -> tuple[Harmonic, ...]:
    """Search one record for harmonics of the excitation, up to 100 Hz or the band of the identification.

    Parameters
    ----------
    recording
        Usable part of a record, before preparation.
    plan
        Decisions from `plan_preparation`.
    speed
        Name of the speed channel; None without one.

    Returns
    -------
    tuple of Harmonic

    Raises
    ------
    DataError
        If a channel has missing values, or there is no channel to search.
    """
    searched = _decimate_to(_at_common_rate(recording, plan), _rate_for_lines(plan))
    return find_harmonics(searched, speed=speed, false_alarm_rate=_RULES.false_lines)


def highest_line(plan: PreparationPlan) -> float:
    """Return the frequency up to which `search_harmonics` shows lines in full [Hz], infinite without decimation."""
    rate = _rate_for_lines(plan)
    return float(PASS_BAND * rate / 2) if rate < plan.sampling_rate else math.inf


def _rate_for_lines(plan: PreparationPlan) -> float:
    """Return the sampling rate at which lines are searched for [Hz]."""
    return max(plan.decimate_to, _RULES.rate_for_lines)


def as_measured(modes: Modes, plan: PreparationPlan, lifter: Lifter | None) -> Modes:
    """Return modes without the effects of scaling the channels and of an exponential lifter.

    Parameters
    ----------
    modes
        Modes of prepared records.
    plan
        Decisions on the preparation.
    lifter
        Lifter of the preparation; None: no editing.
    """
    return replace(
        modes, poles=without_lifter(modes.poles, lifter), mode_shapes=unit_shapes(modes.mode_shapes / plan.scales)
    )


def without_lifter(poles: Complex, lifter: Lifter | None) -> Complex:
    """Return poles [rad/s] without the damping that an exponential lifter adds."""
    return subtract_lifter_damping(poles, lifter.time_constant) if isinstance(lifter, Exponential) else poles


def _at_common_rate(recording: Recording, plan: PreparationPlan) -> Recording:
    """Return the recording at the rate of the first record, where the two differ only by their clocks."""
    if abs(recording.sampling_rate / plan.sampling_rate - 1) > _RULES.same_rate:
        return recording
    return replace(recording, sampling_rate=plan.sampling_rate)


def _decimate_to(recording: Recording, rate: float) -> Recording:
    """Return the recording at `rate`, or as it is where its own rate is not higher."""
    return recording if rate >= recording.sampling_rate else decimate(recording, rate)


def plan_preparation(
    recording: Recording,
    *,
    settings: IdentificationSettings,
    vehicle: AnyVehicle | None = None,
    harmonics: Sequence[Harmonic] = (),
    searched: float = math.inf,
    is_drive: bool = False,
    total_duration: float = 0.0,
) -> PreparationPlan:
    """Choose channels, band and sampling rate from the first record, where the settings leave them open.

    Parameters
    ----------
    recording
        Usable part of the first record (`sprung.vehicles.sensor_layout`).
    settings
        Settings as given.
    vehicle
        Vehicle whose modes give the band where the settings do not.
    harmonics
        Lines of the excitation, which do not count as content of the band.
    searched
        Frequency up to which lines were searched for [Hz]: beyond it they are not distinguished from content.
    is_drive
        Whether the record is one of a vehicle that drives (`is_drive`); the band then holds its body's.
    total_duration
        Duration of all records [s]: one of fewer than 200 samples is no plan for longer ones.

    Returns
    -------
    PreparationPlan

    Raises
    ------
    DataError
        If no stretch of the record is long enough.
    ParameterError
        If the rate or the band of the settings is above what the record has.

    Notes
    -----
    Band: of the coherent part of all cross spectra (of the spectrum, for one channel), weighted with 1/frequency, 1 %
    lies below the lower edge and 99 % below the upper edge over 1.25. Slow motion, whose power falls with the frequency
    until it first rises to four times its least, does not count, nor do frequencies above 0.4 of the rate, where hum is
    folded and no mode is sought. Where the coherence has a significant peak between
    slow motion and the lower edge, the band begins there: a weak first mode needs long lags all the same. On a drive
    whose band would not hold 0.8 to 8 Hz, slow motion ends at 0.4 Hz, and the band ends at 20 Hz or above: modes of the
    body are damped too much to rise. Lines of constant frequency are subtracted before; drifting ones are left out with
    3 % on both sides. Sampling rate: the lowest integer submultiple of the original one that is at least 3 times the
    upper edge (5 times that of a given band).
    """
    speed = speed_channel(recording, vehicle)
    is_drive = is_drive and settings.band is None and settings.ladder is None and vehicle is None
    outputs = [name for name in recording.names if name != speed]
    fastest = recording.sampling_rate
    is_alone = total_duration <= recording.duration
    fewest = _RULES.fewest_samples if is_alone else _RULES.min_samples
    _check_length(_longest(recording), fastest, recording, fewest=fewest)
    trend = 1 if settings.ladder is None else 0
    motion = detrend(recording.select(outputs), degree=trend)
    rate_over_band = _RULES.rate_over_band
    if settings.band is not None:
        band, source, rate_over_band = settings.band, "given", _RULES.rate_over_given_band
    elif vehicle is not None:
        band, source = _band_of_vehicle(vehicle, fastest), "around the modes of the vehicle file"
    else:
        band = _band_of_content(motion, harmonics, searched, settings)
        source = "where the channels are coherent" if len(outputs) > 1 else "where most of the power is"
        if is_drive and (band[0] > _RULES.of_body[0] or band[1] < _RULES.of_body[1]):
            band = _band_of_content(motion, harmonics, searched, settings, least_band=_RULES.of_drive)
            source = "where bodies and wheels of vehicles move"
    check_number("the band's lower edge", band[0], at_most=fastest / 2, advice="it is above half the sampling rate")
    least = max(rate_over_band * band[1], _RULES.min_samples * fastest / _longest(recording))
    rate = settings.decimate_to or _lowest_rate(fastest, least)
    check_number("decimate_to", rate, at_most=fastest * (1 + 1e-9), advice="decimation only lowers the sampling rate")
    chosen = "settings for" if settings.band is None else "band"  # which modes may leave, or not
    notes = [f"{chosen} {band[0]:.3g} to {min(band[1], rate / 2):.3g} Hz ({source}), sampled at {rate:.5g} Hz"]
    if len(outputs) == 1:
        notes.append("one channel: sensor noise cannot be separated from motion, so modes are less certain")
    return PreparationPlan(
        channels=tuple(outputs),
        factors=dict(zip(motion.names, 1 / np.std(motion.samples, axis=1), strict=True)),
        sampling_rate=fastest,
        decimate_to=rate,
        high_pass=settings.band[0] / 2 if settings.band is not None else 0.0,
        band=band,
        spectrum_segment=_spectrum_segment(recording, band, rate),
        notes=tuple(notes),
        trend=trend,
        is_drive=is_drive,
    )


def rate_for_body(vehicle: AnyVehicle, sampling_rate: float) -> float:
    """Return a sampling rate at which the modes of the body are identified, if not those of the wheels.

    Parameters
    ----------
    vehicle
        Vehicle.
    sampling_rate
        Sampling rate of the recordings [Hz].

    Returns
    -------
    float
        Lowest integer submultiple of the sampling rate that is at least 11 times the highest plausible frequency of a
        mode of the body (`sprung.vehicles.labels.body_range`), or that of `plan_preparation` if it is lower [Hz].

    Examples
    --------
    >>> from sprung.vehicles import read_vehicle
    >>> rate_for_body(read_vehicle("zafira"), 1000.0)
    40.0
    """
    body = _RULES.rate_over_body * body_range(structure(vehicle).modes())[1]
    return _lowest_rate(sampling_rate, min(body, _RULES.rate_over_band * _band_of_vehicle(vehicle, sampling_rate)[1]))


def make_plan(
    preparation: PreparationPlan,
    prepared: Prepared,
    harmonics: Sequence[Harmonic],
    *,
    settings: IdentificationSettings,
    method: Method,
    total_duration: float,
) -> Plan:
    """Choose the ladder and the length of segments from the first prepared record, where the settings leave them open.

    Parameters
    ----------
    preparation
        Decisions from `plan_preparation`.
    prepared
        First record, prepared as decided.
    harmonics
        Harmonics of the first record.
    settings
        Settings as given.
    method
        Method, which needs its own segments and its own ladder.
    total_duration
        Duration of all records [s].

    Returns
    -------
    Plan

    Raises
    ------
    DataError
        If the record is too short for the block rows.
    ParameterError
        If references are to be disjoint with fewer than two channels.

    Notes
    -----
    High-pass, where no band is given: at 0.6 times the lowest frequency of which the lags hold 1.2 periods, if some
    channel has a fifth of its power below that frequency. Lags: four periods of the band's lower edge, or four times
    the lag up to which 80 % of the power of the cross-correlations lies, whichever is less, but at most an eleventh of
    the record, and on a drive 1.2 periods, as its body is heavily damped; 20 to 100 block rows, at most 400 rows in the
    matrix. Where these are too few to span the lags, there are realisations of decimated correlations as well. Lags
    stay below the period of a pulse train (five or more multiples of one line): its pulses then act like any random
    excitation.
    """
    motion = prepared.motion
    rate, band, stretch = motion.sampling_rate, preparation.band, _usual_stretch(motion)
    spectra = prepared.edited_spectra or prepared.spectra
    n_periods = _RULES.min_periods if preparation.is_drive else _RULES.periods_of_lags
    lag_span = min(n_periods / max(band[0], 1e-9), _RULES.memories_of_lags * _memory(spectra, band))
    if prepared.edited_spectra is None:
        lag_span = min([lag_span, *(_RULES.of_pulse_period / line for line in _pulse_trains(harmonics))])
    lag_span = min(lag_span, total_duration / _RULES.record_over_lags, stretch / rate / _RULES.stretch_over_lags)
    longest_lags = total_duration / (_RULES.blocks_of_a_drive * _RULES.lag_spans_of_a_block)
    spans = (lag_span, longest_lags if preparation.is_drive else total_duration / _RULES.record_over_lags)
    ladder = _ladder(settings, len(preparation.channels), rate, spans, _longest(motion))
    if method.has_polynomials and isinstance(ladder, OrderLadder):
        n_references = len(settings.references or preparation.channels)
        given = {"block_rows": settings.block_rows, "max_order": settings.max_order}
        ladder = suitable_ladder(ladder.block_rows, n_references, **given)
    low, high = settings.band or (0.0, np.inf)
    slowest = _RULES.min_periods * rate / ladder.span
    share = _slow_share(motion, spectra, preparation.factors, slowest)
    if settings.band is None and settings.ladder is None and share > _RULES.slow_share:
        preparation = replace(preparation, high_pass=_RULES.high_pass * slowest)
    segment = min(_segment(method, settings, total_duration, ladder.n_lags / rate), _longest(motion) / rate)
    mode_band = (max(low, slowest), min(high, _RULES.highest_mode * preparation.decimate_to))
    if settings.band is None:
        of_band, *others = preparation.notes
        sought = f"modes sought from {mode_band[0]:.3g} to {mode_band[1]:.3g} Hz, {of_band}"
        preparation = replace(preparation, notes=(sought, *others))
    return Plan(preparation, settings.segment or segment, ladder, mode_band)


def _longest(recording: Recording) -> int:
    """Return the number of samples of the longest stretch."""
    return max(int(stretch.stop - stretch.start) for stretch in recording.stretches())


def _usual_stretch(recording: Recording) -> int:
    """Return the number of samples of a stretch such that half of the record lies in stretches as long or longer."""
    lengths = np.sort([stretch.stop - stretch.start for stretch in recording.stretches()])[::-1]
    return int(lengths[np.searchsorted(np.cumsum(lengths), lengths.sum() / 2)])


def _spectrum_segment(recording: Recording, band: tuple[float, float], rate: float) -> float:
    """Return the length of the segments of spectra, which resolve the band's lower edge if the record does [s]."""
    duration, stretch = recording.duration, _usual_stretch(recording) / recording.sampling_rate
    slow = min(_RULES.periods_of_lags / max(band[0], 1e-9), duration / _RULES.min_averages)
    return max(min(max(duration / _RULES.averages, slow), stretch), 8 / rate)


def _check_length(
    n_samples: int, rate: float, recording: Recording | None = None, *, fewest: int = _RULES.fewest_samples
) -> None:
    """Check that a stretch is long enough for any identification."""
    if n_samples < fewest:
        gaps = [gap.duration for gap in recording.gaps] if recording else []
        usual = float(np.median(gaps)) if gaps else np.inf
        is_short = recording and usual < _usual_stretch(recording) / recording.sampling_rate
        remedy = f"interpolate across the gaps, usually of {usual:.2g} s, with --bridge {1.1 * usual:.2g}, "
        raise DataError(
            f"the longest stretch without a gap has {n_samples} samples at {rate:.4g} Hz, but identification needs"
            f" {fewest} or more: {remedy if is_short else ''}record longer, or decimate less"
        )


def _pulse_trains(harmonics: Sequence[Harmonic]) -> list[float]:
    """Return the fundamental frequencies of constant lines with many multiples."""
    fundamentals = [line.fundamental for line in harmonics if line.kind == "constant" and line.fundamental]
    return [line for line in set(fundamentals) if fundamentals.count(line) >= _RULES.lines_of_a_pulse_train]


def _band_of_vehicle(vehicle: AnyVehicle, sampling_rate: float) -> tuple[float, float]:
    """Return a band around all modes of the vehicle [Hz]."""
    frequencies = structure(vehicle).modes().natural_frequency
    return _RULES.below_lowest * frequencies.min(), min(_RULES.above_highest * frequencies.max(), sampling_rate / 2)


def _band_of_content(
    motion: Recording,
    harmonics: Sequence[Harmonic],
    searched: float,
    settings: IdentificationSettings,
    least_band: tuple[float, float] | None = None,
) -> tuple[float, float]:
    """Return the band in which the channels move together [Hz], from the frequencies searched for lines."""
    content = _content(subtract_lines(motion, harmonics))
    frequencies, widths = content.frequencies, content.widths
    if least_band is None:
        n_slow = _end_of_slow_motion(content.common)
    else:
        n_slow = int(np.searchsorted(frequencies, least_band[0]))
    is_used = (np.arange(frequencies.size) >= n_slow) & (frequencies <= searched)
    for line in harmonics:
        if line.kind != "constant":
            margin = np.maximum(2 * widths, _RULES.wandering * line.band[1])
            is_used &= (frequencies < line.band[0] - margin) | (frequencies > line.band[1] + margin)
    is_sought = is_used & (frequencies <= _RULES.highest_mode * motion.sampling_rate)
    is_used = is_sought if np.any(content.power[is_sought] > 0) else is_used
    share = np.cumsum(np.where(is_used, content.power * widths / frequencies, 0))
    if share[-1] <= 0:
        return 0.0, motion.sampling_rate / 2
    low, high = np.searchsorted(share / share[-1], [_RULES.power_above, _RULES.power_below])
    if settings.ladder is None:
        low = min([int(low), *_weak_peaks(content, is_used, n_slow, int(low))])
    highest = max(_RULES.margin * frequencies[high], least_band[1] if least_band else 0.0)
    return float(frequencies[low]), float(min(highest, motion.sampling_rate / 2))


@dataclass(frozen=True, eq=False, slots=True)
class _Content:
    """Frequencies above 0, their widths, the coherent power beyond chance and with it, and how probable chance is."""

    frequencies: Real
    widths: Real
    power: Real
    common: Real
    chance: Real
    periods: Real


def _content(motion: Recording) -> _Content:
    """Return what the spectra hold; the lowest frequencies are those of longer and fewer segments."""
    stretch = _usual_stretch(motion)
    parts: list[Real] = []
    start = 0.0
    for averages in (_RULES.averages, _RULES.min_averages):
        length = max(min(motion.n_samples // averages, stretch, _RULES.max_spectrum), 16)
        spectra = spectral_matrix(motion, segment_length=length / motion.sampling_rate)
        power, common, chance = _coherence(spectra)
        width = motion.sampling_rate / length
        rows = slice(3, None) if not parts else slice(1, int(np.ceil(start / width)))
        start = 3 * width
        frequencies, widths = spectra.frequencies, np.full(power.size, width)
        values = [frequencies, widths, power, common, chance, frequencies / width]
        parts.insert(0, np.array(values)[:, rows])
    return _Content(*np.concatenate(parts, axis=1))


def _coherence(spectra: SpectralMatrix) -> tuple[Real, Real, Real]:
    """Return the power density common to the channels beyond chance and with it, and the probability of chance.

    Each channel is scaled to unit power. With K independent segments -(K - 1) ln(1 - coherence) of a pair is
    exponentially distributed, the sum over pairs nearly as gamma; of a single channel nothing is chance.
    """
    densities = np.maximum(spectra.densities, np.finfo(float).tiny)
    scale = densities.sum(axis=1) * spectra.frequencies[1]
    first, second = np.triu_indices(len(densities), 1)
    if not first.size:
        return densities[0] / scale[0], densities[0] / scale[0], np.ones(densities.shape[1])
    cross = np.abs(spectra.matrix[first, second])
    coherence = cross**2 / (densities[first] * densities[second])
    density = cross / np.sqrt(scale[first] * scale[second])[:, None]
    by_chance = 1 - _RULES.chance_of_coherence ** (1 / max(spectra.n_segments - 1, 1))
    power = np.sum(density * np.sqrt(np.maximum(coherence - by_chance, 0)), axis=0)
    freedom = max(spectra.n_segments / _RULES.segments_of_one - 1, 1.0)
    surprise = -freedom * np.log(np.maximum(1 - coherence, np.finfo(float).eps))
    chance = special.gammaincc(first.size, surprise.sum(axis=0))
    return power, np.sum(density * np.sqrt(coherence), axis=0), np.asarray(chance)


def _weak_peaks(content: _Content, is_used: Booleans, start: int, end: int) -> list[int]:
    """Return where significant peaks of weak modes below the band begin, from `start` to `end`.

    A peak rises over the least power to both of its sides as resonance rises over slow motion.
    """
    common = content.common[start : end + 1]
    if common.size < 3:
        return []
    below = np.minimum.accumulate(common)
    above = np.minimum.accumulate(common[::-1])[::-1]
    is_peak = common > _RULES.rise * np.maximum(below, above)
    is_peak &= is_used[start : end + 1] & (
        content.chance[start : end + 1] < _RULES.chance_of_peak / content.chance.size
    )
    is_peak &= content.periods[start : end + 1] >= _RULES.periods_of_peak
    return [int(k) + start for k in np.flatnonzero(is_peak)]


def _end_of_slow_motion(common: Real) -> int:
    """Return the index of the least power before its first rise; 0 where it never rises."""
    least = np.minimum.accumulate(common)
    rises = np.flatnonzero(common > _RULES.rise * least)
    return int(np.argmin(common[: rises[0]])) if rises.size else 0


def _memory(spectra: SpectralMatrix, band: tuple[float, float]) -> float:
    """Return the lag below which 80 % of the power of the cross-correlations of the integrated motion lies [s]."""
    frequencies, n_channels = spectra.frequencies, len(spectra.names)
    total = np.maximum(spectra.densities.sum(axis=1), np.finfo(float).tiny)
    is_used = ~np.eye(n_channels, dtype=bool) if n_channels > 1 else np.ones((1, 1), dtype=bool)
    in_band = (band[0] <= frequencies) & (frequencies <= band[1]) & (frequencies > 0)
    weights = np.where(in_band, 1 / np.maximum(frequencies, frequencies[1]) ** 2, 0)
    correlations = np.fft.irfft((spectra.matrix * weights / np.sqrt(np.outer(total, total))[:, :, None])[is_used])
    power = np.sum(correlations[:, : correlations.shape[1] // 2] ** 2, axis=0)
    power = np.maximum(power - np.median(power[power.size // 2 :]), 0)
    share = np.cumsum(power)
    return float(np.searchsorted(share, _RULES.power_remembered * share[-1]) / (2 * frequencies[-1]))


def _slow_share(motion: Recording, spectra: SpectralMatrix, factors: Mapping[str, float], frequency: float) -> float:
    """Return the largest share of a channel's power below a frequency."""
    scales = np.array([factors[name] for name in motion.names])
    fast = spectra.densities[:, spectra.frequencies >= frequency].sum(axis=1) * spectra.frequencies[1] * scales**2
    power = np.maximum(np.var(motion.samples, axis=1), np.finfo(float).tiny)
    return float(np.max(1 - fast / power))


def _lowest_rate(sampling_rate: float, minimum: float) -> float:
    """Return the lowest integer submultiple of the sampling rate that is not below `minimum`."""
    return sampling_rate / max(1, int(sampling_rate / minimum))


def _ladder(
    settings: IdentificationSettings, n_outputs: int, rate: float, spans: tuple[float, float], n_samples: int
) -> Ladder:
    """Return the ladder of the settings, or one of lags near the first span [s] and within the second."""
    _check_length(n_samples, rate)
    if settings.ladder is not None:
        _check_block_rows(settings.ladder.last, settings.ladder.lags_per_row, n_samples, rate)
        return settings.ladder
    lags_per_row = OrderLadder.lags_per_row
    most = min(_RULES.max_rows, max(_RULES.min_rows, _RULES.max_matrix // n_outputs), n_samples // (4 * lags_per_row))
    wanted = int(np.ceil(spans[0] * rate / lags_per_row))
    rows = settings.block_rows or min(max(wanted, _RULES.min_rows), most)
    _check_block_rows(rows, lags_per_row, n_samples, rate)
    strides = [1]
    if settings.block_rows is None and settings.references is None:
        while len(strides) < _RULES.max_strides and rows * strides[-1] < _RULES.spanned * wanted:
            if lags_per_row * rows * strides[-1] * _RULES.stride > spans[1] * rate:
                break
            strides.append(strides[-1] * _RULES.stride)
    return OrderLadder(rows, settings.max_order or _largest_order(settings, n_outputs, rows), tuple(strides))


def _check_block_rows(rows: int, lags_per_row: int, n_samples: int, rate: float) -> None:
    """Check that a stretch holds the lags of a number of block rows."""
    if lags_per_row * rows > n_samples:
        raise DataError(
            f"block_rows={rows} needs {lags_per_row * rows} lags, but the longest stretch without a gap has"
            f" {n_samples} samples at {rate:.4g} Hz: record longer or use block_rows <= {n_samples // lags_per_row}"
        )


def _largest_order(settings: IdentificationSettings, n_outputs: int, rows: int) -> int:
    """Return a largest model order that suits the block rows and that every block matrix carries."""
    sizes = [n_outputs, len(settings.references or ()) or n_outputs]
    if settings.has_disjoint_references:
        sizes = [min(len(outputs), len(references)) for outputs, references in disjoint_splits(range(n_outputs))]
    carried = (rows - 1) * min(sizes)
    suitable = 2 * int(np.clip(max(0.3 * rows, 3 * n_outputs), *_RULES.half_orders))
    return min(suitable, carried - carried % 2)


Name = TypeVar("Name")


def disjoint_splits(channels: Iterable[Name]) -> tuple[tuple[tuple[Name, ...], tuple[Name, ...]], ...]:
    """Return pairs of disjoint outputs and references such that every two channels are separated in some pair.

    Parameters
    ----------
    channels
        Two or more channels.

    Returns
    -------
    tuple
        Pairs (outputs, references).

    Raises
    ------
    ParameterError
        If there are fewer than two channels.

    Examples
    --------
    >>> disjoint_splits("abc")
    ((('b',), ('a', 'c')), (('a', 'c'), ('b',)), (('c',), ('a', 'b')), (('a', 'b'), ('c',)))
    """
    members = tuple(channels)
    if len(members) < 2:
        raise ParameterError("disjoint outputs and references need at least two channels")
    splits = []
    for bit in range((len(members) - 1).bit_length()):
        ones = tuple(member for k, member in enumerate(members) if k >> bit & 1)
        zeros = tuple(member for k, member in enumerate(members) if not k >> bit & 1)
        splits += [(ones, zeros), (zeros, ones)]
    return tuple(splits)


def _segment(method: Method, settings: IdentificationSettings, duration: float, lag_span: float) -> float:
    """Return a length of segments that gives enough of them to each subset and is long against the lags [s]."""
    if not method.has_own_segments:
        lag_spans = _RULES.lag_spans_of_a_block if settings.ladder is None else 1.0
        return max(duration / _RULES.blocks_of_a_record, lag_spans * lag_span)
    n_segments = _RULES.segments_of_a_subset * (settings.n_subsets if method.is_sorted else 1)
    return max(duration / n_segments, _RULES.lag_spans_of_a_segment * lag_span)
