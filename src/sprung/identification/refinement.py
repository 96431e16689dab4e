"""Refinement of identified modes by the Whittle likelihood of the records' spectra: decisions and result."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sprung._arrays import Indices, Real
from sprung._checks import freeze
from sprung.identification.band_fits import BandFit, Observed, RecordSpectra, fits_of_bands, refined_modes
from sprung.likelihood.modal_spectra import LineSpectra
from sprung.modal import Modes, join_modes
from sprung.recording import Channel
from sprung.signals.harmonics import Harmonic


@dataclass(frozen=True, slots=True)
class RefinementRules:
    """Which modes are refined, and which refined values are used."""

    #: Largest damping ratio: broader peaks are not those of one mode.
    max_damping: float = 0.15
    #: Fewest lines of the longest stretch in the half-power half-width: fewer do not resolve the peak.
    min_lines: float = 1.5
    #: Largest distance from the start, in standard deviations of the change.
    max_distance: float = 3.0
    #: Largest change of the frequency in half-widths, where the standard deviation of the start is unknown.
    max_widths: float = 0.5
    #: Largest change of damping by a factor.
    max_ratio: float = 2.0


_RULES = RefinementRules()
#: Why a mode is in no fit.
_TOO_LITTLE = "spectra do not determine them"
#: Most frequencies listed for one reason.
_MAX_LISTED = 4


@dataclass(frozen=True, eq=False, slots=True)
class Refinement:
    """What the refinement of identified modes changed.

    Parameters
    ----------
    start
        Modes before the refinement.
    bands
        Fit of each band.
    distances
        Largest change of natural frequency and damping ratio of each mode, in standard deviations of such changes;
        NaN where the mode was not fitted, or the start has no standard deviation; shape (modes,).
    reasons
        Why each mode keeps the values of the start; empty for a refined mode.
    """

    start: Modes
    bands: tuple[BandFit, ...]
    distances: Real
    reasons: tuple[str, ...]

    def __post_init__(self) -> None:
        freeze(self, distances=1)

    def of(self, modes: Modes, origins: Indices, *, instead: str = "") -> "Refinement":
        """Return the refinement of modes of which some are the refined ones.

        Parameters
        ----------
        modes
            Modes as they are used.
        origins
            Index here of each of these modes, -1 for one from elsewhere; shape (modes,).
        instead
            Why modes from elsewhere are not refined.
        """
        numbers = {int(origin): k for k, origin in enumerate(origins) if origin >= 0}
        places = [tuple(numbers[k] for k in band.modes if k in numbers) for band in self.bands]
        chosen = np.where(origins >= 0, origins, len(self.start) + np.arange(len(modes)))
        return Refinement(
            start=join_modes([self.start, modes]).take(chosen),
            bands=tuple(replace(band, modes=own) for band, own in zip(self.bands, places, strict=True) if own),
            distances=np.append(self.distances, np.nan)[origins],
            reasons=tuple((*self.reasons, instead)[k] for k in origins),
        )

    @property
    def notes(self) -> tuple[str, ...]:
        """One note on the modes that keep the values of the start, by reason; none if all are refined."""
        by_reason: dict[str, list[str]] = {}
        for frequency, reason in zip(self.start.natural_frequency, self.reasons, strict=True):
            if reason:
                by_reason.setdefault(reason, []).append(f"{frequency:.4g}")
        parts = [f"{_listed(frequencies)} Hz ({reason})" for reason, frequencies in by_reason.items()]
        return ("modes not refined: " + "; ".join(parts),) if parts else ()


def _listed(frequencies: Sequence[str]) -> str:
    """Return the first frequencies, and how many more there are."""
    more = len(frequencies) - _MAX_LISTED
    return ", ".join(frequencies[:_MAX_LISTED]) + (f" and {more} more" if more > 0 else "")


def refined_by_spectra(
    modes: Modes, spectra: RecordSpectra, channels: Sequence[Channel], *, harmonics: Sequence[Harmonic] = ()
) -> tuple[Modes, Refinement]:
    """Refine identified modes to the largest likelihood of the records' spectra.

    Parameters
    ----------
    modes
        Identified modes.
    spectra
        Spectra of the records in the units of the mode shapes, from `record_spectra`.
    channels
        Channels of the mode shapes, whose quantities give the responses.
    harmonics
        Lines of the excitation, which are left out.

    Returns
    -------
    Modes, Refinement
        Modes with refined values, and with their standard deviations and those of their shapes; a mode keeps its values
        where it cannot be refined: it is heavily damped, its peak is narrower than the records resolve, the model does
        not fit, or the largest likelihood is farther away than the standard deviations allow.

    Notes
    -----
    Modes whose bands overlap are fitted together. Bands are first as wide as the spectra, then narrower, until the
    model fits within chance.

    References
    ----------
    P. Whittle: see `ModalModel`.
    """
    n_modes = len(modes)
    reasons = [_why_not(modes, k, spectra.lines.longest) for k in range(n_modes)]
    data = _without_lines(spectra.lines.spectra(), harmonics)
    values, bands = modes, []
    distances = np.full(n_modes, np.nan)
    if data.frequencies.size and not all(reasons):
        observed = Observed(data, tuple(channels), spectra.sampling_rate)
        for fit in fits_of_bands(modes, observed, is_refinable=np.array([not reason for reason in reasons])):
            bands.append(fit.band)
            bad = "" if fit.band.fits else "spectra deviate from the model beyond chance"
            bad = bad if fit.band.is_converged else "search did not converge"
            if bad:
                reasons = [reason or (bad if k in fit.modes else "") for k, reason in enumerate(reasons)]
                continue
            refined = refined_modes(fit, modes, spectra)
            for place, k in enumerate(fit.modes):
                distances[k], far = _distance(modes.take(fit.modes), refined, place)
                reasons[k] = reasons[k] or far
                if not reasons[k]:
                    order = np.where(np.arange(n_modes) == k, n_modes + place, np.arange(n_modes))
                    values = join_modes([values, refined]).take(order)
    fitted = {k for band in bands for k in band.modes}
    reasons = [reason or ("" if k in fitted else _TOO_LITTLE) for k, reason in enumerate(reasons)]
    return values, Refinement(modes, tuple(bands), distances, tuple(reasons))


def _why_not(modes: Modes, k: int, longest: float) -> str:
    """Return why a mode cannot be refined, before any fit; empty if it can."""
    damping, half_width = modes.damping_ratio[k], modes.damping_ratio[k] * modes.natural_frequency[k]
    if damping > _RULES.max_damping:
        return f"damped by more than {100 * _RULES.max_damping:.0f} %"
    if half_width * longest < _RULES.min_lines:
        return f"peak too narrow for stretches of {longest:.3g} s: record longer"
    return ""


def _without_lines(data: LineSpectra, harmonics: Sequence[Harmonic]) -> LineSpectra:
    """Return the spectra without the bins that a line of the excitation may reach."""
    is_used = np.ones(data.frequencies.size, dtype=np.bool_)
    for line in harmonics:
        margin = line.resolution if line.kind == "constant" else 0.0
        is_used &= (data.frequencies < line.band[0] - margin) | (data.frequencies > line.band[1] + margin)
    return data.take(is_used)


def _distance(start: Modes, refined: Modes, place: int) -> tuple[float, str]:
    """Return the change of a mode in standard deviations of changes by chance, and why it is too large, if it is.

    Notes
    -----
    Where the refined estimate is efficient, the variance of the change is the difference of the variances.

    References
    ----------
    J. A. Hausman, Specification tests in econometrics, Econometrica 46 (1978), 1251-1271.
    """
    width = start.damping_ratio[place] * start.natural_frequency[place]
    change = abs(refined.natural_frequency[place] - start.natural_frequency[place])
    ratio = refined.damping_ratio[place] / start.damping_ratio[place]
    in_damping = abs(refined.damping_ratio[place] - start.damping_ratio[place])
    distance = float(
        max(
            change / _of_change(start.natural_frequency_std[place], refined.natural_frequency_std[place]),
            in_damping / _of_change(start.damping_ratio_std[place], refined.damping_ratio_std[place]),
        )
    )
    is_known = bool(np.isfinite(distance))
    is_far = distance > _RULES.max_distance if is_known else change > _RULES.max_widths * width
    is_other = not 1 / _RULES.max_ratio < ratio < _RULES.max_ratio and not (
        is_known and distance < _RULES.max_distance / 2
    )
    return distance, "refined values too far from those of the subspace" if is_far or is_other else ""


def _of_change(before: float, after: float) -> float:
    """Return the standard deviation of the change of an estimate by an efficient one, at least half that of both."""
    return float(np.sqrt(np.maximum(before**2 - after**2, (before**2 + after**2) / 4)))
