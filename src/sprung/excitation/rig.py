"""A bogie on a roller rig, structures on a moving base, harmonics that follow a speed; sums of excitations."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from sprung._arrays import Indices, Real
from sprung._checks import check_number
from sprung.errors import ParameterError
from sprung.excitation.noise import Excitation, FunctionOfTime, noise
from sprung.excitation.route import SpeedProfile


@dataclass(frozen=True, eq=False, slots=True)
class Lines(FunctionOfTime):
    """Sines whose frequency is proportional to a speed.

    Parameters
    ----------
    speed
        Speed over time [m/s, or revolutions per second].
    orders
        Periods per metre (or revolution): 1 / (2 pi 0.3) for the first order of a wheel of 0.3 m radius.
    amplitudes
        Amplitude of each order at the reference speed [N, or m for base displacements].
    shares
        Factor with which the lines act on each input, shape (inputs,).
    reference_speed, speed_exponent
        Growth with the speed: amplitudes (speed / reference_speed)^speed_exponent; 2 for unbalance.
    phases
        Phase of each order at time 0 [rad]; None: random.

    Raises
    ------
    ParameterError
        If a number is out of range, or orders, amplitudes and phases differ in number.

    Notes
    -----
    The phase is 2 pi order distance(t): the integral of the frequency, so that it is continuous when the speed changes.
    """

    speed: SpeedProfile
    orders: tuple[float, ...]
    amplitudes: tuple[float, ...]
    shares: tuple[float, ...]
    reference_speed: float = 10.0
    speed_exponent: float = 0.0
    phases: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        check_number("reference_speed", self.reference_speed, above=0)
        for name in ("amplitudes", "phases"):
            values = getattr(self, name)
            if values is not None and len(self.orders) != len(values):
                raise ParameterError(f"{len(self.orders)} orders have {len(values)} {name}: give one for each order")

    @property
    def n_inputs(self) -> int:
        """Number of inputs: one for each share."""
        return len(self.shares)

    def at(self, time: Real, generator: np.random.Generator) -> Real:
        """Return the lines at rising times [s], shape (inputs, times)."""
        distance = self.speed.distance(time)
        growth = (self.speed.speed(time) / self.reference_speed) ** self.speed_exponent
        total = np.zeros(time.size)
        phases = generator.uniform(0, 2 * np.pi, len(self.orders)) if self.phases is None else self.phases
        for order, amplitude, phase in zip(self.orders, self.amplitudes, phases, strict=True):
            total += amplitude * np.sin(2 * np.pi * order * distance + phase)
        return np.outer(self.shares, growth * total)


@dataclass(frozen=True, slots=True)
class _Parts(ABC):
    """Several excitations, drawn one after the other."""

    parts: tuple[Excitation, ...]

    @property
    def is_smooth(self) -> bool:
        """Whether all parts are linear between samples."""
        return all(part.is_smooth for part in self.parts)

    def samples(
        self, n_samples: int, *, sampling_rate: float, generator: np.random.Generator, start: float = 0.0
    ) -> Real:
        """Return `n_samples` of every input from time `start` [s] on, shape (inputs, samples)."""
        drawn = [
            part.samples(n_samples, sampling_rate=sampling_rate, generator=generator, start=start)
            for part in self.parts
        ]
        return self._together(drawn)

    @abstractmethod
    def _together(self, drawn: list[Real]) -> Real:
        """Return the samples of all parts together."""


@dataclass(frozen=True, slots=True)
class Sum(_Parts):
    """Sum of excitations of the same inputs.

    Parameters
    ----------
    parts
        Excitations with the same number of inputs, at least one, drawn one after the other.

    Raises
    ------
    ParameterError
        If there are no parts, or their numbers of inputs differ.
    """

    def __post_init__(self) -> None:
        if len({part.n_inputs for part in self.parts}) != 1:
            counts = ", ".join(str(part.n_inputs) for part in self.parts)
            raise ParameterError(f"parts have {counts or 'no'} inputs, but must all have the same number: correct them")

    @property
    def n_inputs(self) -> int:
        """Number of inputs of each part."""
        return self.parts[0].n_inputs

    def _together(self, drawn: list[Real]) -> Real:
        return np.sum(drawn, axis=0)


@dataclass(frozen=True, slots=True)
class Stack(_Parts):
    """Excitations of different inputs, one below the other.

    Parameters
    ----------
    parts
        Excitations in the order of their inputs, at least one, drawn one after the other.

    Raises
    ------
    ParameterError
        If there are no parts.
    """

    def __post_init__(self) -> None:
        if not self.parts:
            raise ParameterError("a stack of excitations has no parts: give at least one")

    @property
    def n_inputs(self) -> int:
        """Number of inputs of all parts together."""
        return sum(part.n_inputs for part in self.parts)

    def _together(self, drawn: list[Real]) -> Real:
        return np.vstack(drawn)


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
        Frequencies [Hz] and phases [rad] of the sines, one phase for each frequency.
    pulse
        Height of the pulses, A3 [m], each one sample long.
    pulse_frequency
        Frequency of the pulse train [Hz], above 0.

    Raises
    ------
    ParameterError
        If a number is out of range, or frequencies and phases differ in number.

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
    n_inputs: ClassVar[int] = 1  # the base
    is_smooth: ClassVar[bool] = False  # noise and pulses are held from sample to sample

    def __post_init__(self) -> None:
        for name in ("random", "harmonic", "pulse"):
            check_number(name, getattr(self, name), at_least=0)
        check_number("pulse_frequency", self.pulse_frequency, above=0)
        if len(self.frequencies) != len(self.phases):
            raise ParameterError(
                f"{len(self.frequencies)} frequencies have {len(self.phases)} phases: give one phase for each frequency"
            )

    def samples(
        self, n_samples: int, *, sampling_rate: float, generator: np.random.Generator, start: float = 0.0
    ) -> Real:
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


def pulse_indices(n_samples: int, pulses_per_sample: float, *, first: int = 0) -> Indices:
    """Return the samples nearest to a pulse among `first` to `first + n_samples - 1`, counted from `first`.

    Examples
    --------
    >>> pulse_indices(10, 0.25).tolist()
    [0, 4, 8]
    """
    earliest = math.floor((first - 1) * pulses_per_sample)
    latest = math.ceil((first + n_samples) * pulses_per_sample)
    indices = np.rint(np.arange(earliest, latest + 1) / pulses_per_sample).astype(np.intp) - first
    return indices[(indices >= 0) & (indices < n_samples)]


@dataclass(frozen=True, eq=False, slots=True)
class RollerRig(FunctionOfTime):
    """Rollers under some or all wheelsets: roughness, rail joints on the rollers, harmonics of their rotation.

    Parameters
    ----------
    is_driven
        Whether each wheelset, front to rear, stands on driven rollers; the others stand on fixed ground.
    rotation
        Rotation of the rollers over time [revolutions per second].
    random
        Standard deviation of the roughness under each wheel at the mean speed [m], independent between wheels.
    joints, joint
        Number of joints in a revolution, and height of the pulse under both wheels at each [m], one sample long.
    harmonics
        Amplitude of the first, second ... harmonic of the rotation under both wheels [m].
    speed_exponent
        Power of the rotation over its mean with which roughness and harmonics grow.
    asymmetry
        Relative difference of joints and harmonics between left and right.

    Raises
    ------
    ParameterError
        If no wheelset is driven, or a number is out of range.
    """

    is_driven: tuple[bool, ...]
    rotation: SpeedProfile
    random: float = 1e-5
    joints: int = 0
    joint: float = 0.0
    harmonics: tuple[float, ...] = ()
    speed_exponent: float = 1.0
    asymmetry: float = 0.1
    is_smooth: ClassVar[bool] = False  # roughness and pulses are held from sample to sample

    def __post_init__(self) -> None:
        for name in ("random", "joints", "joint"):
            check_number(name, getattr(self, name), at_least=0)
        if not any(self.is_driven):
            raise ParameterError(f"is_driven={self.is_driven} must have at least one driven wheelset: set one to True")

    @property
    def n_inputs(self) -> int:
        """Number of inputs: two wheels on each wheelset."""
        return 2 * len(self.is_driven)

    def at(self, time: Real, generator: np.random.Generator) -> Real:
        """Return the height of the ground under every wheel at rising times [s], shape (wheels, times) [m]."""
        turns = self.rotation.distance(time)
        mean = float(np.mean(self.rotation.speeds)) or 1.0
        growth = (self.rotation.speed(time) / mean) ** self.speed_exponent
        motion = np.zeros((self.n_inputs, time.size))
        for axle in np.flatnonzero(self.is_driven):
            regular = np.zeros(time.size)
            for order, amplitude in enumerate(self.harmonics, start=1):
                regular += amplitude * growth * np.sin(2 * np.pi * order * turns + generator.uniform(0, 2 * np.pi))
            regular[1:] += self.joint * np.diff(np.floor(self.joints * turns))
            sides = regular * np.array([[1 + self.asymmetry / 2], [1 - self.asymmetry / 2]])
            motion[2 * axle : 2 * axle + 2] = sides + self.random * growth * generator.standard_normal((2, time.size))
        return motion
