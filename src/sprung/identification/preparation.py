"""What identification does to recordings first."""

from dataclasses import dataclass, replace

from sprung.identification.settings import Plan
from sprung.recording import Recording
from sprung.signals.cepstrum import edit
from sprung.signals.conditioning import band_pass, decimate, detrend, scale
from sprung.signals.harmonics import Harmonic, find_harmonics
from sprung.signals.spectrum import SpectralMatrix, spectral_matrix

#: Rates of records within this share of each other are one: those of one logger, by different clocks.
_SAME_RATE = 5e-4
#: Chance of finding any line in a record without one.
_FALSE_LINES = 1e-4
#: Lines of wheels and engines are searched for below half of this rate [Hz], also where modes are sought far lower.
_RATE_FOR_LINES = 200.0


@dataclass(frozen=True, eq=False, slots=True)
class Prepared:
    """A record ready for correlation.

    Parameters
    ----------
    motion
        Outputs: edited, decimated, without motion below the band, RMS about 1.
    spectra, edited_spectra
        Of the decimated outputs before and after cepstrum editing (None without).
    harmonics
        Lines of the excitation in the decimated record before editing.
    """

    motion: Recording
    spectra: SpectralMatrix
    edited_spectra: SpectralMatrix | None
    harmonics: tuple[Harmonic, ...]


def prepare(recording: Recording, plan: Plan) -> Prepared:
    """Do to one record what the plan says.

    Parameters
    ----------
    recording
        From `usable`, with the plan's channels.
    plan
        From `make_plan`.
    """
    settings = plan.settings
    if abs(recording.sampling_rate / plan.sampling_rate - 1) <= _SAME_RATE:
        recording = replace(recording, sampling_rate=plan.sampling_rate)
    rate = min(settings.decimate_to or recording.sampling_rate, recording.sampling_rate)
    centred = detrend(recording.select(plan.channels))
    harmonics = settings.harmonics
    if harmonics is None:
        searched = _decimated(recording, max(rate, _RATE_FOR_LINES))
        harmonics = find_harmonics(searched, speed=plan.speed, false_alarm_rate=_FALSE_LINES)
    slow = _decimated(recording, rate)
    spectra = spectral_matrix(slow.select(plan.channels), segment_length=plan.spectrum_segment)
    motion, edited_spectra = detrend(slow.select(plan.channels)), None
    if settings.lifter is not None:
        motion = _decimated(edit(centred, settings.lifter), rate)
        edited_spectra = spectral_matrix(motion, segment_length=plan.spectrum_segment)
    if settings.band is not None and settings.band[0] > 0:
        motion = band_pass(motion, settings.band[0] / 2, None)
    return Prepared(scale(motion, plan.factors), spectra, edited_spectra, harmonics)


def _decimated(recording: Recording, rate: float) -> Recording:
    """Return the recording at the rate."""
    return recording if rate >= recording.sampling_rate else decimate(recording, rate)
