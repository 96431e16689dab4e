"""Base motion of a wheel on a roller rig: random, harmonic, pulses."""

import math
from dataclasses import dataclass

import numpy as np

from sprung._arrays import Indices, Real
from sprung._checks import check_number
from sprung.errors import ParameterError
from sprung.excitation.noise import noise


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
        """Number of inputs: one base."""
        return 1

    @property
    def is_smooth(self) -> bool:
        """False: noise and pulses are held from sample to sample."""
        return False

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
