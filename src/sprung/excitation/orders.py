"""Harmonics that follow a speed, such as those of wheels and engine; sums and stacks of excitations."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from sprung._arrays import Real
from sprung._checks import check_number
from sprung.errors import ParameterError
from sprung.excitation.noise import Excitation, FunctionOfTime
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
