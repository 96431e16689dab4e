"""Excitations: random forces, noise in a band, and the base motion of a wheel on a roller rig."""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfilt

from sprung._checks import check_number
from sprung.errors import ParameterError

#: Order of the Butterworth filter that limits noise to a band (each edge falls by 24 dB per octave).
BAND_ORDER = 4

# Lowest edge of a band relative to the sampling rate: below it the filter's transient would fill the memory.
_LOWEST_EDGE = 1e-6


class Excitation(Protocol):
    """What drives a vehicle: rows of forces [N] or base displacements [m]."""

    @property
    def n_inputs(self) -> int:
        """Number of rows."""

    def samples(
        self, n_samples: int, *, sampling_rate: float, generator: np.random.Generator, start: float = 0.0
    ) -> NDArray[np.float64]:
        """Return `n_samples` of every input from time `start` [s] on, shape (inputs, samples)."""


@dataclass(frozen=True, slots=True)
class RandomInputs:
    """Independent Gaussian noise on every input.

    Parameters
    ----------
    n_inputs
        Number of rows, at least 1.
    standard_deviation
        Of each sample, in N (or m for base displacements), above 0.
    band
        Lower and upper edge [Hz]; None for white noise up to half the sampling rate.
    """

    n_inputs: int
    standard_deviation: float = 1.0
    band: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        check_number("n_inputs", self.n_inputs, at_least=1)
        check_number("standard_deviation", self.standard_deviation, above=0)

    def samples(
        self, n_samples: int, *, sampling_rate: float, generator: np.random.Generator, start: float = 0.0
    ) -> NDArray[np.float64]:
        """Return `n_samples` of every input, shape (inputs, samples)."""
        del start  # noise has no phase
        shape = (self.n_inputs, n_samples)
        return self.standard_deviation * noise(shape, band=self.band, sampling_rate=sampling_rate, generator=generator)


@dataclass(frozen=True, slots=True)
class BaseMotion:
    """Displacement of the base under one wheel: random, harmonic and pulse train.

    Parameters
    ----------
    random
        Standard deviation of the random part, A1 [m].
    harmonic
        Amplitude of every sine, A2 [m].
    frequencies, phases
        Of the sines [Hz, rad]; as many phases as frequencies.
    pulse
        Height of the pulses, A3 [m], each one sample long.
    pulse_frequency
        Of the pulse train [Hz], above 0.

    Notes
    -----
    y = A1 randn + A2 sum_i sin(2 pi f_i t + phase_i) + A3 at t = n / pulse_frequency. A pulse falls on the sample
    nearest to its time, n runs over all integers: a record that starts in the steady state has one at t = 0.

    References
    ----------
    F. Liu, Online Identification of Vehicle Dynamic Systems for Condition Monitoring, University of Huddersfield
    (2020), eqs 5-5 to 5-8.
    """

    random: float = 1e-4
    harmonic: float = 0.0
    frequencies: tuple[float, ...] = ()
    phases: tuple[float, ...] = ()
    pulse: float = 0.0
    pulse_frequency: float = 3.65

    def __post_init__(self) -> None:
        for name in ("random", "harmonic", "pulse"):
            check_number(name, getattr(self, name), at_least=0)
        check_number("pulse_frequency", self.pulse_frequency, above=0)
        if len(self.frequencies) != len(self.phases):
            raise ParameterError(
                f"{len(self.frequencies)} frequencies have {len(self.phases)} phases: give one phase for each frequency"
            )

    @property
    def n_inputs(self) -> int:
        """One base moves."""
        return 1

    def samples(
        self, n_samples: int, *, sampling_rate: float, generator: np.random.Generator, start: float = 0.0
    ) -> NDArray[np.float64]:
        """Return the displacement from time `start` [s] on, shape (1, samples)."""
        first = round(start * sampling_rate)
        time = (first + np.arange(n_samples)) / sampling_rate
        motion = self.random * noise((n_samples,), band=None, sampling_rate=sampling_rate, generator=generator)
        for frequency, phase in zip(self.frequencies, self.phases, strict=True):
            motion += self.harmonic * np.sin(2 * np.pi * frequency * time + phase)
        motion[pulse_indices(n_samples, self.pulse_frequency / sampling_rate, first=first)] += self.pulse
        return motion[None]


#: Excitations of the four cases of section 5.3 of the thesis cited in `BaseMotion`.
QUARTER_CASES = (
    BaseMotion(),
    BaseMotion(pulse=5e-3),
    BaseMotion(pulse=5e-3, harmonic=1e-4, frequencies=(3.65,), phases=(math.pi / 3,)),
    BaseMotion(pulse=5e-3, harmonic=1e-4, frequencies=(3.65, 17.0), phases=(math.pi / 3, math.pi / 4)),
)


def pulse_indices(n_samples: int, pulses_per_sample: float, *, first: int = 0) -> NDArray[np.intp]:
    """Return which of the samples `first` to `first + n_samples - 1` are nearest to a pulse, counted from `first`."""
    earliest = math.floor((first - 1) * pulses_per_sample)
    latest = math.ceil((first + n_samples) * pulses_per_sample)
    indices = np.rint(np.arange(earliest, latest + 1) / pulses_per_sample).astype(np.intp) - first
    return indices[(indices >= 0) & (indices < n_samples)]


def noise(
    shape: tuple[int, ...],
    *,
    band: tuple[float, float] | None,
    sampling_rate: float,
    generator: np.random.Generator,
) -> NDArray[np.float64]:
    """Return stationary Gaussian noise of standard deviation 1, white or in a band.

    Parameters
    ----------
    shape
        The last axis is time.
    band
        Lower and upper edge [Hz], at -3 dB; None for white noise. A lower edge of 0 or an upper edge from half
        the sampling rate on is no edge.
    sampling_rate
        In Hz.
    generator
        Source of the randomness.

    Raises
    ------
    ParameterError
        Where the band is empty or lies above half the sampling rate.

    Notes
    -----
    Band-limited noise is white noise through a causal Butterworth filter of order `BAND_ORDER` at each edge,
    its transient cut off, divided by the filter's gain for white noise: the standard deviation is 1 in
    expectation.
    """
    check_number("sampling_rate", sampling_rate, above=0)
    if band is None:
        return generator.standard_normal(shape)
    low, high = band
    check_number("lower edge of the band", low, at_least=0)
    if low >= sampling_rate / 2:
        raise ParameterError(
            f"band {low:g} to {high:g} Hz lies above half the sampling rate {sampling_rate:g} Hz: lower it"
        )
    check_number("upper edge of the band", high, above=max(low, sampling_rate * _LOWEST_EDGE))
    if low > 0:
        check_number("lower edge of the band", low, at_least=sampling_rate * _LOWEST_EDGE, advice="use 0")
    filters = []
    if low > 0:
        filters.append(butter(BAND_ORDER, low, btype="highpass", output="sos", fs=sampling_rate))
    if high < sampling_rate / 2:
        filters.append(butter(BAND_ORDER, high, btype="lowpass", output="sos", fs=sampling_rate))
    if not filters:
        return generator.standard_normal(shape)
    sections = np.vstack(filters)
    # The slowest pole of order 4 decays with 0.38 times the edge's pulsation: 8 periods leave less than 1e-7.
    transient = math.ceil(8 * sampling_rate / (low or high))
    impulse = np.zeros(transient)
    impulse[0] = 1.0
    gain = np.linalg.norm(sosfilt(sections, impulse))
    white = generator.standard_normal((*shape[:-1], transient + shape[-1]))
    return np.asarray(sosfilt(sections, white)[..., transient:] / gain)
