"""Runs of the chain of three masses, and modes by hand, that several tests share."""

from functools import cache

import numpy as np

from sprung.modal import Modes
from sprung.recording import Channel, Recording
from sprung.simulation import simulate, usual_excitation
from sprung.vehicles import chain

CHAIN = chain()
TRUTH = CHAIN.modes()


@cache
def run(seed=1, *, snr=10.0, band=None, duration=60.0, sampling_rate=500.0):
    """Return a record of the chain under white forces."""
    return simulate(
        CHAIN,
        usual_excitation(CHAIN),
        duration=duration,
        sampling_rate=sampling_rate,
        seed=seed,
        snr=snr,
        noise_band=band,
    )


def recorded(samples, sampling_rate=500.0):
    """Return accelerations acc_1, acc_2 ..."""
    samples = np.atleast_2d(samples)
    channels = tuple(Channel(f"acc_{k}", "acceleration") for k in range(1, len(samples) + 1))
    return Recording(samples, sampling_rate, channels)


def assert_same(one, other, *, deviations):
    """The same modes, each within a share of its standard deviation."""
    assert len(one.modes) == len(other.modes)
    for name in ("natural_frequency", "damping_ratio"):
        difference = np.abs(getattr(one.modes, name) - getattr(other.modes, name))
        assert np.all(difference <= deviations * getattr(one.modes, f"{name}_std") + 1e-9)


def pole(frequency, damping=0.02):
    """Return the continuous pole of a mode."""
    return 2 * np.pi * frequency * (-damping + 1j * np.sqrt(1 - damping**2))


def modes_of(frequency, damping, shapes, *, std=0.0, damping_std=None, stable_rate=0.5):
    """Return modes of channels s0, s1 ..."""
    frequency, shapes = np.atleast_1d(np.asarray(frequency, dtype=float)), np.asarray(shapes, dtype=complex)
    n = len(frequency)
    return Modes(
        poles=pole(frequency, np.broadcast_to(damping, n)),
        mode_shapes=shapes.reshape(n, -1),
        channels=tuple(f"s{k}" for k in range(shapes.shape[-1])),
        natural_frequency_std=np.full(n, std),
        damping_ratio_std=np.full(n, std / 10 if damping_std is None else damping_std),
        stable_rate=np.full(n, stable_rate),
        labels=(None,) * n,
    )
