"""
An excitation of your own
=========================

Roads, tracks, rigs, hammer blows and noise come with the package. Anything else is a class with three members: the
number of inputs, whether it is smooth, and its samples. The example is a mast in gusty wind.
"""

from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np
from scipy.signal import lfilter

import sprung
from sprung.signals.spectrum import spectral_matrix
from sprung.vehicles import chain

# %%
# The excitation
# --------------
# White forces whose size varies slowly at random. An excitation is a frozen value; randomness comes from the generator
# that it is given, so that one seed gives one record. ``start`` is the time of the first sample, for excitations that
# depend on time.


@dataclass(frozen=True)
class Gusts:
    """Random forces with a slowly varying size.

    Parameters
    ----------
    n_inputs
        Number of forces.
    force
        Standard deviation in calm wind [N].
    gustiness
        Standard deviation of ln(size).
    time_constant
        Time over which the size varies [s].
    """

    n_inputs: int
    force: float = 1.0
    gustiness: float = 0.6
    time_constant: float = 20.0
    is_smooth: bool = False

    def samples(self, n_samples, *, sampling_rate, generator, start=0.0):
        """Return the forces, shape (inputs, samples)."""
        forget = np.exp(-1 / (self.time_constant * sampling_rate))
        steps = np.sqrt(1 - forget**2) * generator.standard_normal(n_samples)
        steps[0] = generator.standard_normal()
        sizes = np.exp(self.gustiness * lfilter([1.0], [1.0, -forget], steps))
        return self.force * sizes * generator.standard_normal((self.n_inputs, n_samples))


# %%
# A mast in the wind
# ------------------
# A simulation takes a structure, an excitation and a duration. Compare with steady forces of the same seed.

mast = chain(4, mass=400.0, stiffness=[2.2e6, 1.8e6, 1.5e6, 1.2e6], damping=[2.2e3, 1.8e3, 1.5e3, 1.2e3])
gusty = sprung.simulate(mast, Gusts(4), duration=900.0, sampling_rate=50.0, snr=20, seed=5)
steady = sprung.simulate(mast, sprung.usual_excitation(mast), duration=900.0, sampling_rate=50.0, snr=20, seed=5)

figure, axes = plt.subplots(figsize=(8, 3), layout="constrained")
time = np.arange(gusty.n_samples) / gusty.sampling_rate
axes.plot(time, 1e3 * gusty.samples[3], linewidth=0.4, label="gusts")
axes.plot(time, 1e3 * steady.samples[3], linewidth=0.4, label="steady")
axes.set(xlabel="time [s]", ylabel="acceleration of the top [mm/s²]", xlim=(0, 900))
axes.legend(frameon=False)
plt.show()

# %%
# An oracle
# ---------
# Every excitation needs a known answer to be tested against. The variance of these forces is
# force² exp(2 gustiness²), whatever the time constant.

drawn = Gusts(4, time_constant=1.0).samples(2_000_000, sampling_rate=50.0, generator=np.random.default_rng(1))
print(f"variance {drawn.var():.3f}, expected {np.exp(2 * 0.6**2):.3f}")

# %%
# Are the modes those of the mast?
# --------------------------------
# Identification assumes stationary excitation, which gusts are not. As the weight of powerful segments is limited, they
# do not dominate the averages, and the modes are about those of the steady record.

exact = mast.modes()
for name, recording in (("gusts", gusty), ("steady", steady)):
    modes = sprung.cov_ssi(recording).modes
    values = ", ".join(
        f"{f:.3f} Hz {100 * xi:.2f} %" for f, xi in zip(modes.natural_frequency, modes.damping_ratio, strict=True)
    )
    print(f"{name:>6}: {values}")
values = ", ".join(
    f"{f:.3f} Hz {100 * xi:.2f} %" for f, xi in zip(exact.natural_frequency, exact.damping_ratio, strict=True)
)
print(f" exact: {values}")

figure, axes = plt.subplots(figsize=(8, 3.5), layout="constrained")
for name, recording in (("gusts", gusty), ("steady", steady)):
    spectra = spectral_matrix(recording, segment_length=20.0)
    axes.semilogy(spectra.frequencies, spectra.densities[3], label=name, linewidth=0.9)
for frequency in exact.natural_frequency:
    axes.axvline(frequency, color="0.85", zorder=0)
axes.set(xlim=(0, 25), xlabel="frequency [Hz]", ylabel="density of the top [m²/s⁴/Hz]")
axes.legend(frameon=False)
plt.show()
