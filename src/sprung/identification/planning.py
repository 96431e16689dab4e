"""What identification chooses from the data: band, sampling rate, block rows, orders and segments."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import combinations
from typing import TypeVar

import numpy as np

from sprung._arrays import Real
from sprung._checks import check_number
from sprung.errors import DataError, ParameterError
from sprung.identification.preparation import Prepared
from sprung.identification.settings import IdentificationSettings, Plan
from sprung.recording import Recording
from sprung.signals.conditioning import detrend
from sprung.signals.harmonics import Harmonic
from sprung.signals.spectrum import SpectralMatrix, spectral_matrix
from sprung.vehicles import structure
from sprung.vehicles.usable import AnyVehicle, speed_channel

#: The band ends this many times above the frequency below which this share of the coherent power (per octave) lies.
_MARGIN, _POWER_BELOW, _POWER_ABOVE = 1.25, 0.99, 0.01
_CHANCE_OF_COHERENCE = 1e-3
#: Of a vehicle's own modes, the band reaches from this share of the lowest to this multiple of the highest.
_BELOW_LOWEST, _ABOVE_HIGHEST = 0.3, 1.5
#: Least sampling rate over the band's upper edge: decimation passes up to 0.8 of the new Nyquist frequency.
#: A given band may end right above its modes: heavily damped ones then need more room.
_RATE_OVER_BAND, _RATE_OVER_GIVEN_BAND = 3.0, 5.0
#: Lags span this many periods of the slowest motion, but no more than a multiple of the lag up to which most of the
#: power of the cross-correlations lies (heavily damped motion forgets before it has swung often), within these numbers
#: of block rows and this size of matrix.
_POWER_REMEMBERED, _MEMORIES_OF_LAGS = 0.8, 4.0
_PERIODS_OF_LAGS, _FEWEST_ROWS, _MOST_ROWS, _LARGEST_MATRIX = 4.0, 20, 100, 400
#: Half of the largest model order lies between these.
_LARGEST_ORDERS = (20, 30)
_FEWEST_SAMPLES = 200
_BLOCKS_OF_A_RECORD, _SEGMENTS_OF_A_SUBSET, _LAG_SPANS_OF_A_SEGMENT = 48, 12, 3.0
_SPECTRUM_AVERAGES = 24
#: A fundamental with this many multiples is a pulse train; lags reach up to this share of its period.
_LINES_OF_A_PULSE_TRAIN, _OF_PULSE_PERIOD = 5, 0.9


def make_plan(recording: Recording, *, settings: IdentificationSettings, vehicle: AnyVehicle | None = None) -> Plan:
    """Choose channels, band and sampling rate from the first record, where the settings leave them open.

    Parameters
    ----------
    recording
        From `usable`.
    settings
        As given.
    vehicle
        Its modes give the band where the settings do not.

    Returns
    -------
    Plan
        Block rows, orders and segments are still as given: `sized` completes it.

    Raises
    ------
    DataError
        If no stretch of the record is long enough to tell anything.
    ParameterError
        If the wanted rate is above the recording's.

    Notes
    -----
    Band: of the coherent part of all cross spectra (of the spectrum, for one channel), weighted with 1/frequency, 1 %
    lies below its lower edge and 99 % below its upper edge over 1.25. Sampling rate: an integer part of the original
    one, at least 3 times the upper edge (5 times that of a given band).
    """
    speed = speed_channel(recording, vehicle)
    outputs = [name for name in recording.names if name != speed]
    longest = _longest(recording)
    _check_length(longest, recording.sampling_rate)
    motion = detrend(recording.select(outputs))
    rate_over_band = _RATE_OVER_BAND
    if settings.band is not None:
        band, source, rate_over_band = settings.band, "given", _RATE_OVER_GIVEN_BAND
    elif vehicle is not None:
        band, source = _band_of_vehicle(vehicle, recording.sampling_rate), "around the vehicle's own modes"
    else:
        band, source = _band_of_content(motion), "where the channels move together"
    notes = []
    if len(outputs) == 1:
        notes.append("one channel: what its sensor adds cannot be told from motion, so modes are less certain")
    fastest = recording.sampling_rate
    check_number("the band's lower edge", band[0], at_most=fastest / 2, advice="it is above half the sampling rate")
    rate = settings.decimate_to or _chosen_rate(fastest, rate_over_band * band[1])
    check_number("decimate_to", rate, at_most=fastest * (1 + 1e-9), advice="decimation only lowers the sampling rate")
    return Plan(
        channels=tuple(outputs),
        speed=speed,
        factors=dict(zip(motion.names, 1 / np.std(motion.samples, axis=1), strict=True)),
        sampling_rate=fastest,
        settings=replace(settings, decimate_to=rate),
        band=band,
        spectrum_segment=max(min(recording.duration / _SPECTRUM_AVERAGES, longest / fastest), 8 / rate),
        notes=(
            f"band {band[0]:.3g} to {min(band[1], rate / 2):.3g} Hz ({source}), sampled at {rate:.5g} Hz",
            *notes,
        ),
    )


def sized(plan: Plan, prepared: Prepared, *, method: str, total_duration: float) -> Plan:
    """Choose block rows, largest order and length of segments, where the settings leave them open.

    Parameters
    ----------
    plan
        From `make_plan`.
    prepared
        The first record, prepared with it.
    method
        "cov", "acs" or "coss".
    total_duration
        Of all records [s].

    Raises
    ------
    DataError
        If the record is too short for the block rows.

    Notes
    -----
    Lags: four periods of the band's lower edge, or four times the lag up to which 80 % of the power of the
    cross-correlations lies, whichever is less; 20 to 100 block rows, at most 400 rows in the matrix. Lags stay below
    the period of a pulse train (five or more multiples of one line): its pulses then act like any random excitation.
    """
    motion = prepared.motion
    rate = motion.sampling_rate
    spectra = prepared.edited_spectra or prepared.spectra
    span = min(_PERIODS_OF_LAGS / max(plan.band[0], 1e-9), _MEMORIES_OF_LAGS * _memory(spectra, plan.band))
    if prepared.edited_spectra is None:
        span = min([span, *(_OF_PULSE_PERIOD / line for line in _pulse_trains(prepared.harmonics))])
    settings = _with_sizes(plan.settings, len(plan.channels), rate, span, _longest(motion))
    plan = replace(plan, settings=settings)
    chosen = _chosen_segment(method, settings.n_subsets, total_duration, plan.n_lags / rate)
    segment = settings.segment or min(chosen, _longest(motion) / rate)
    return replace(plan, settings=replace(settings, segment=segment))


def _longest(recording: Recording) -> int:
    """Return the number of samples of the longest stretch."""
    return max(int(stretch.stop - stretch.start) for stretch in recording.stretches())


def _check_length(n_samples: int, rate: float) -> None:
    """Refuse what is too short to tell anything."""
    if n_samples < _FEWEST_SAMPLES:
        raise DataError(
            f"the longest stretch without a gap has {n_samples} samples at {rate:.4g} Hz, but identification needs"
            f" {_FEWEST_SAMPLES} or more: record longer, or decimate less"
        )


def _pulse_trains(harmonics: Sequence[Harmonic]) -> list[float]:
    """Return the fundamental frequencies of constant lines with many multiples."""
    fundamentals = [line.fundamental for line in harmonics if line.kind == "constant" and line.fundamental]
    return [line for line in set(fundamentals) if fundamentals.count(line) >= _LINES_OF_A_PULSE_TRAIN]


def _band_of_vehicle(vehicle: AnyVehicle, sampling_rate: float) -> tuple[float, float]:
    """Return a band around all modes of the vehicle."""
    frequencies = structure(vehicle).modes().natural_frequency
    return _BELOW_LOWEST * frequencies.min(), min(_ABOVE_HIGHEST * frequencies.max(), sampling_rate / 2)


def _band_of_content(motion: Recording) -> tuple[float, float]:
    """Return the band in which the channels move together."""
    length = max(min(_longest(motion) // _SPECTRUM_AVERAGES, 8192), 16)
    spectra = spectral_matrix(motion, segment_length=length / motion.sampling_rate)
    frequencies = spectra.frequencies
    power = _coherent_power(spectra)
    power[:3] = 0
    share = np.cumsum(power / np.maximum(frequencies, frequencies[1]))
    if share[-1] <= 0:
        return 0.0, float(frequencies[-1])
    low, high = np.searchsorted(share / share[-1], [_POWER_ABOVE, _POWER_BELOW])
    return float(frequencies[low]), float(min(_MARGIN * frequencies[high], frequencies[-1]))


def _memory(spectra: SpectralMatrix, band: tuple[float, float]) -> float:
    """Return the lag up to which 80 % of the power of the cross-correlations lies, of the motion's integral [s]."""
    frequencies, n_channels = spectra.frequencies, len(spectra.names)
    total = np.maximum(spectra.densities.sum(axis=1), np.finfo(float).tiny)
    is_used = ~np.eye(n_channels, dtype=bool) if n_channels > 1 else np.ones((1, 1), dtype=bool)
    in_band = (band[0] <= frequencies) & (frequencies <= band[1]) & (frequencies > 0)
    weights = np.where(in_band, 1 / np.maximum(frequencies, frequencies[1]) ** 2, 0)
    correlations = np.fft.irfft((spectra.matrix * weights / np.sqrt(np.outer(total, total))[:, :, None])[is_used])
    power = np.sum(correlations[:, : correlations.shape[1] // 2] ** 2, axis=0)
    power = np.maximum(power - np.median(power[power.size // 2 :]), 0)
    share = np.cumsum(power)
    return float(np.searchsorted(share, _POWER_REMEMBERED * share[-1]) / (2 * frequencies[-1]))


def _coherent_power(spectra: SpectralMatrix) -> Real:
    """Return the power that the channels share, channels scaled alike, in the bins where they share any."""
    densities = spectra.densities
    densities = np.maximum(densities, np.finfo(float).tiny)
    scale = densities.sum(axis=1, keepdims=True)
    if len(densities) == 1:
        return densities[0] / scale[0]
    chance = 1 - _CHANCE_OF_COHERENCE ** (1 / max(spectra.n_segments - 1, 1))
    power = np.zeros(densities.shape[1])
    for i, j in combinations(range(len(densities)), 2):
        coherence = np.abs(spectra.matrix[i, j]) ** 2 / (densities[i] * densities[j])
        power += (
            np.abs(spectra.matrix[i, j]) / np.sqrt(scale[i] * scale[j]) * np.sqrt(np.maximum(coherence - chance, 0))
        )
    return power


def _chosen_rate(sampling_rate: float, least: float) -> float:
    """Return the lowest integer part of the rate that is not below the least."""
    return sampling_rate / max(1, int(sampling_rate / least))


def _with_sizes(
    settings: IdentificationSettings, n_outputs: int, rate: float, lag_span: float, n_samples: int
) -> IdentificationSettings:
    """Choose block rows and largest order where they are not given, and check that the longest stretch carries them."""
    _check_length(n_samples, rate)
    lags_per_row = 3 if settings.is_hankel else 2
    most = min(_MOST_ROWS, max(_FEWEST_ROWS, _LARGEST_MATRIX // n_outputs), n_samples // (4 * lags_per_row))
    rows = min(max(int(np.ceil(lag_span * rate / 2)), _FEWEST_ROWS), most)
    rows = settings.block_rows or rows
    largest = max(rows, settings.row_ladder[1] if settings.row_ladder else 0)
    if lags_per_row * largest > n_samples:
        raise DataError(
            f"block_rows={largest} needs {lags_per_row * largest} lags, but the longest stretch without a gap has"
            f" {n_samples} samples at {rate:.4g} Hz: record longer or use block_rows <= {n_samples // lags_per_row}"
        )
    sizes = [n_outputs, len(settings.references or ()) or n_outputs]
    if settings.has_disjoint_references:
        sizes = [min(len(outputs), len(references)) for outputs, references in disjoint_splits(range(n_outputs))]
    carried = (rows - 1) * min(sizes)
    largest_order = 2 * int(np.clip(max(0.3 * rows, 3 * n_outputs), *_LARGEST_ORDERS))
    return replace(settings, block_rows=rows, max_order=settings.max_order or min(largest_order, carried - carried % 2))


Name = TypeVar("Name")


def disjoint_splits(channels: Iterable[Name]) -> tuple[tuple[tuple[Name, ...], tuple[Name, ...]], ...]:
    """Return pairs of disjoint outputs and references such that every two channels are apart in some pair.

    Parameters
    ----------
    channels
        Two or more.

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


def _chosen_segment(method: str, n_subsets: int, duration: float, lag_span: float) -> float:
    """Return the length of segments: enough of them for each subset, each long against the lags."""
    if method == "cov":
        return max(duration / _BLOCKS_OF_A_RECORD, lag_span)
    n_segments = _SEGMENTS_OF_A_SUBSET * (n_subsets if method == "coss" else 1)
    return max(duration / n_segments, _LAG_SPANS_OF_A_SEGMENT * lag_span)
