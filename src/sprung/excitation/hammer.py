"""Hammer blows at random positions and times."""

import math
from dataclasses import dataclass

import numpy as np

from sprung._arrays import Real
from sprung._checks import check_number


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

    def __post_init__(self) -> None:
        check_number("rate", self.rate, above=0)
        check_number("duration", self.duration, above=0)

    @property
    def n_inputs(self) -> int:
        """Number of inputs: four corners."""
        return 4

    @property
    def is_smooth(self) -> bool:
        """True: forces are continuous between samples."""
        return True

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
