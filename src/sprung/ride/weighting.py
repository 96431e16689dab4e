"""Frequency weightings of vibration as people feel it."""

from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType

import numpy as np
from scipy.fft import next_fast_len

from sprung._arrays import Complex, Real
from sprung._checks import check_number, check_one_of


@dataclass(frozen=True, slots=True)
class Weighting:
    """Corner frequencies [Hz] and quality factors of a weighting; None: that step is left out.

    Parameters
    ----------
    low, high
        Band limits, second-order Butterworth filters.
    transition
        Zero, pole and quality factor of the transition from acceleration to velocity.
    step
        Zero, its quality factor, pole and its quality factor of the upward step.
    gain
        Factor.
    """

    low: float
    high: float
    transition: tuple[float | None, float, float] | None = None
    step: tuple[float, float, float, float] | None = None
    gain: float = 1.0

    def response(self, frequencies: Real) -> Complex:
        """Return the complex response at frequencies [Hz]."""
        s = 2j * np.pi * np.asarray(frequencies, dtype=np.float64)
        w1, w2 = 2 * np.pi * self.low, 2 * np.pi * self.high
        high_pass = s**2 / (s**2 + np.sqrt(2) * w1 * s + w1**2)
        total = self.gain * high_pass * w2**2 / (s**2 + np.sqrt(2) * w2 * s + w2**2)
        if self.transition is not None:
            zero, pole, quality = self.transition
            w4 = 2 * np.pi * pole
            numerator = 1.0 if zero is None else 1 + s / (2 * np.pi * zero)
            total = total * numerator * w4**2 / (s**2 + w4 / quality * s + w4**2)
        if self.step is not None:
            zero, q5, pole, q6 = self.step
            w5, w6 = 2 * np.pi * zero, 2 * np.pi * pole
            total = total * (s**2 + w5 / q5 * s + w5**2) / (s**2 + w6 / q6 * s + w6**2)
        return np.asarray(total, dtype=np.complex128)


class _Weightings(Enum):
    """Weightings of ISO 2631-1 and ISO 2631-4 (Wb), with the constants of ISO 8041-1, table 3."""

    Wk = Weighting(0.4, 100.0, (12.5, 12.5, 0.63), (2.37, 0.91, 3.35, 0.91))
    Wd = Weighting(0.4, 100.0, (2.0, 2.0, 0.63))
    Wf = Weighting(0.08, 0.63, (None, 0.25, 0.86), (0.0625, 0.80, 0.1, 0.80))
    Wc = Weighting(0.4, 100.0, (8.0, 8.0, 0.63))
    We = Weighting(0.4, 100.0, (1.0, 1.0, 0.63))
    Wj = Weighting(0.4, 100.0, None, (3.75, 0.91, 5.32, 0.91))
    Wb = Weighting(0.4, 100.0, (16.0, 16.0, 0.55), (2.5, 0.90, 4.0, 0.95), gain=1.024)


#: Weightings by name.
WEIGHTINGS = MappingProxyType({weighting.name: weighting.value for weighting in _Weightings})


def weighted(samples: Real, *, sampling_rate: float, weighting: str) -> Real:
    """Return weighted accelerations.

    Parameters
    ----------
    samples
        Accelerations without missing values, time last.
    sampling_rate
        Sampling rate [Hz], above 0.
    weighting
        A key of `WEIGHTINGS`, or "Sperling vertical", "Sperling lateral".

    Returns
    -------
    ndarray
        Shape of `samples`.

    Notes
    -----
    The response is exact at every frequency: the transform of the padded samples is multiplied by it. A bilinear filter
    would be wrong by several per cent near half the sampling rate.

    References
    ----------
    ISO 2631-1:1997, annex A; ISO 8041-1:2017, 5.6.

    Examples
    --------
    >>> import numpy as np
    >>> time = np.arange(4000) / 200
    >>> heard = weighted(np.sin(2 * np.pi * 5 * time), sampling_rate=200.0, weighting="Wk")
    >>> round(float(np.abs(heard[2000:]).max()), 2)
    1.04
    """
    check_number("sampling_rate", sampling_rate, above=0)
    n = samples.shape[-1]
    padded = next_fast_len(n + round(20 * sampling_rate), real=True)
    frequencies = np.asarray(np.fft.rfftfreq(padded, 1 / sampling_rate), dtype=np.float64)
    spectrum = np.fft.rfft(samples - samples.mean(axis=-1, keepdims=True), padded)
    spectrum = np.multiply(spectrum, response_of(weighting, frequencies))
    return np.asarray(np.fft.irfft(spectrum, padded)[..., :n])


def response_of(weighting: str, frequencies: Real) -> Complex:
    """Return the response of a weighting by name at frequencies [Hz]."""
    check_one_of("weighting", weighting, (*WEIGHTINGS, *SPERLING))
    if weighting in WEIGHTINGS:
        return WEIGHTINGS[weighting].response(frequencies)
    return np.asarray(SPERLING[weighting] * _sperling(frequencies), dtype=np.complex128)


#: Factor of Sperling's weighting by direction.
SPERLING = MappingProxyType({"Sperling vertical": 0.588, "Sperling lateral": 0.737})


def _sperling(frequencies: Real) -> Real:
    """Return Sperling's weighting without its factor, for accelerations in m/s^2."""
    f = np.asarray(frequencies, dtype=np.float64)
    above = 1.911 * f**2 + (0.25 * f**2) ** 2
    below = (1 - 0.277 * f**2) ** 2 + (1.563 * f - 0.0368 * f**3) ** 2
    return np.asarray(np.sqrt(above / below))
