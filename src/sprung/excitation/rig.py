"""A bogie on a roller rig."""

from dataclasses import dataclass

import numpy as np

from sprung._arrays import Real
from sprung._checks import check_number
from sprung.errors import ParameterError
from sprung.excitation.speed import SpeedProfile


@dataclass(frozen=True, eq=False, slots=True)
class RollerRig:
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

    def __post_init__(self) -> None:
        for name in ("random", "joints", "joint"):
            check_number(name, getattr(self, name), at_least=0)
        if not any(self.is_driven):
            raise ParameterError(f"is_driven={self.is_driven} must have at least one driven wheelset: set one to True")

    @property
    def n_inputs(self) -> int:
        """Number of inputs: two wheels on each wheelset."""
        return 2 * len(self.is_driven)

    @property
    def is_smooth(self) -> bool:
        """False: roughness and pulses are held from sample to sample."""
        return False

    def samples(
        self, n_samples: int, *, sampling_rate: float, generator: np.random.Generator, start: float = 0.0
    ) -> Real:
        """Return the height of the ground under every wheel from time `start` [s] on, shape (wheels, samples) [m]."""
        time = start + np.arange(n_samples) / sampling_rate
        turns = self.rotation.distance(time)
        mean = float(np.mean(self.rotation.speeds)) or 1.0
        growth = (self.rotation.speed(time) / mean) ** self.speed_exponent
        motion = np.zeros((self.n_inputs, n_samples))
        for axle in np.flatnonzero(self.is_driven):
            regular = np.zeros(n_samples)
            for order, amplitude in enumerate(self.harmonics, start=1):
                regular += amplitude * growth * np.sin(2 * np.pi * order * turns + generator.uniform(0, 2 * np.pi))
            regular[1:] += self.joint * np.diff(np.floor(self.joints * turns))
            sides = regular * np.array([[1 + self.asymmetry / 2], [1 - self.asymmetry / 2]])
            motion[2 * axle : 2 * axle + 2] = sides + self.random * growth * generator.standard_normal((2, n_samples))
        return motion
