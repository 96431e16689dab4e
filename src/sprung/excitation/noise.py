"""Random forces, noise in a band, and hammer blows at random positions and times."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from sprung._arrays import Real
from sprung._checks import check_number
from sprung.errors import ParameterError

#: Order of the Butterworth filter that limits noise to a band (each edge falls by 24 dB per octave).
BAND_ORDER = 4

# Lowest edge of a band relative to the sampling rate: below it the filter's transient would fill the memory.
_LOWEST_EDGE = 1e-6


class Excitation(Protocol):
    """Excitation of a vehicle: rows of forces [N] or base displacements [m]."""

    @property
    def n_inputs(self) -> int:
        """Number of rows."""

    @property
    def is_smooth(self) -> bool:
        """Whether the inputs are linear between samples (first-order hold) instead of held (zero-order hold)."""

    def samples(
        self, n_samples: int, *, sampling_rate: float, generator: np.random.Generator, start: float = 0.0
    ) -> Real:
        """Return `n_samples` of every input from time `start` [s] on, shape (inputs, samples)."""


class FunctionOfTime(ABC):
    """Excitation whose samples are its values at their times."""

    __slots__ = ()
    #: Whether the values are continuous between samples.
    is_smooth: ClassVar[bool] = True

    @property
    @abstractmethod
    def n_inputs(self) -> int:
        """Number of inputs."""

    @abstractmethod
    def at(self, time: Real, generator: np.random.Generator) -> Real:
        """Return the inputs at rising times [s], shape (inputs, times); `generator` draws what is random in them."""

    def samples(
        self, n_samples: int, *, sampling_rate: float, generator: np.random.Generator, start: float = 0.0
    ) -> Real:
        """Return `n_samples` of every input from time `start` [s] on, shape (inputs, samples)."""
        return self.at(start + np.arange(n_samples) / sampling_rate, generator)


@dataclass(frozen=True, slots=True)
class RandomInputs:
    """Independent Gaussian noise on every input.

    Parameters
    ----------
    n_inputs
        Number of rows, at least 1.
    standard_deviation
        Standard deviation of each sample [N, or m for base displacements], above 0.
    band
        Lower and upper edge [Hz]; None for white noise up to half the sampling rate.

    Raises
    ------
    ParameterError
        If a number is out of range.
    """

    n_inputs: int
    standard_deviation: float = 1.0
    band: tuple[float, float] | None = None
    is_smooth: ClassVar[bool] = False  # noise is held from sample to sample

    def __post_init__(self) -> None:
        check_number("n_inputs", self.n_inputs, at_least=1)
        check_number("standard_deviation", self.standard_deviation, above=0)

    def samples(
        self, n_samples: int, *, sampling_rate: float, generator: np.random.Generator, start: float = 0.0
    ) -> Real:
        """Return `n_samples` of every input, shape (inputs, samples)."""
        del start  # noise has no phase
        shape = (self.n_inputs, n_samples)
        return self.standard_deviation * noise(shape, band=self.band, sampling_rate=sampling_rate, generator=generator)


def noise(
    shape: tuple[int, ...],
    *,
    band: tuple[float, float] | None,
    sampling_rate: float,
    generator: np.random.Generator,
) -> Real:
    """Return stationary Gaussian noise of standard deviation 1, white or in a band.

    Parameters
    ----------
    shape
        Shape of the result; the last axis is time.
    band
        Lower and upper edge [Hz], at -3 dB; None for white noise. A lower edge of 0, or an upper edge at or
        above half the sampling rate, means no limit on that side.
    sampling_rate
        Sampling rate [Hz], above 0.
    generator
        Source of the randomness.

    Raises
    ------
    ParameterError
        If the band is empty or lies above half the sampling rate.

    Notes
    -----
    Band-limited noise is white noise through a causal Butterworth filter of order `BAND_ORDER` at each edge,
    with its transient removed, divided by the filter's gain for white noise: the standard deviation is 1 in
    expectation.

    Examples
    --------
    >>> samples = noise((1, 20_000), band=(0.0, 40.0), sampling_rate=200.0, generator=np.random.default_rng(1))
    >>> print(f"{samples.std():.1f}")
    1.0
    >>> spectrum = np.abs(np.fft.rfft(samples[0])) ** 2
    >>> bool(spectrum[8000:].sum() < 0.01 * spectrum.sum())  # above 80 Hz
    True
    """
    check_number("sampling_rate", sampling_rate, above=0)
    if band is None:
        return generator.standard_normal(shape)
    from scipy.signal import butter, sosfilt

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
    return sosfilt(sections, white)[..., transient:] / gain


@dataclass(frozen=True, slots=True)
class HammerBlows:
    """Blows on a plate, as forces at its four corners.

    Parameters
    ----------
    rate
        Mean number of blows per second.
    strength
        Smallest and largest peak force [N].
    duration
        Duration of a half-sine blow [s].

    Raises
    ------
    ParameterError
        If a number is out of range.

    Notes
    -----
    A blow at a random position between the corners is distributed over them by bilinear weights, which preserve its
    force and both its moments exactly. Inputs: front left, front right, rear left, rear right.
    """

    rate: float = 0.7
    strength: tuple[float, float] = (2.0, 10.0)
    duration: float = 0.01
    n_inputs: ClassVar[int] = 4  # corners
    is_smooth: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_number("rate", self.rate, above=0)
        check_number("duration", self.duration, above=0)

    def samples(
        self, n_samples: int, *, sampling_rate: float, generator: np.random.Generator, start: float = 0.0
    ) -> Real:
        """Return the forces from time `start` [s] on, shape (4, samples) [N]."""
        del start  # blows have no phase
        forces = np.zeros((4, n_samples))
        length = n_samples / sampling_rate
        for _ in range(generator.poisson(self.rate * length)):
            begin, peak = generator.uniform(0, length), -generator.uniform(*self.strength)
            weights = corner_weights(*generator.uniform(0, 1, size=2))
            first, last = (math.ceil(t * sampling_rate) for t in (begin, begin + self.duration))
            time = np.arange(first, min(last, n_samples)) / sampling_rate - begin
            forces[:, first:last] += weights[:, None] * peak * np.sin(np.pi * time / self.duration)
        return forces


def corner_weights(forward: float, left: float) -> Real:
    """Return the shares of the four corners in a force at a position between them, shape (4,).

    Parameters
    ----------
    forward, left
        Relative position: 0 at the rear and on the right, 1 at the front and on the left.
    """
    return np.array([forward * left, forward * (1 - left), (1 - forward) * left, (1 - forward) * (1 - left)])
