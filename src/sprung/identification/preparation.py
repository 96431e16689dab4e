"""Preparation of recordings for identification: decimation, cepstrum editing, filtering, search for harmonics."""

import math
from dataclasses import dataclass, replace

from sprung._arrays import Complex
from sprung.identification.settings import PreparationPlan
from sprung.modal import Modes, unit_shapes
from sprung.recording import Recording
from sprung.signals.cepstrum import Exponential, Lifter, edit, subtract_lifter_damping
from sprung.signals.conditioning import PASS_BAND, band_pass, decimate, detrend, scale
from sprung.signals.harmonics import Harmonic, find_harmonics
from sprung.signals.spectrum import SpectralMatrix, spectral_matrix

#: Largest relative difference of sampling rates that count as one: loggers of one kind differ by their clocks.
_SAME_RATE = 5e-4
#: Probability of calling anything a harmonic in a record without any.
_FALSE_LINES = 1e-4
#: Lines of wheels and engines are searched for below half of this rate [Hz], even where modes lie far lower.
_RATE_FOR_LINES = 200.0


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
        Usable part of a record (`sprung.vehicles.usable`), with the channels of the plan.
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
    return find_harmonics(searched, speed=speed, false_alarm_rate=_FALSE_LINES)


def highest_line(plan: PreparationPlan) -> float:
    """Return the frequency up to which `search_harmonics` shows lines in full [Hz], infinite without decimation."""
    rate = _rate_for_lines(plan)
    return float(PASS_BAND * rate / 2) if rate < plan.sampling_rate else math.inf


def _rate_for_lines(plan: PreparationPlan) -> float:
    """Return the sampling rate at which lines are searched for [Hz]."""
    return max(plan.decimate_to, _RATE_FOR_LINES)


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
    if abs(recording.sampling_rate / plan.sampling_rate - 1) > _SAME_RATE:
        return recording
    return replace(recording, sampling_rate=plan.sampling_rate)


def _decimate_to(recording: Recording, rate: float) -> Recording:
    """Return the recording at `rate`, or as it is where its own rate is not higher."""
    return recording if rate >= recording.sampling_rate else decimate(recording, rate)
