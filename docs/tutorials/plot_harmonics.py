"""
Harmonics, and the cepstrum
===========================

Wheels, engines and machines excite narrow lines at frequencies that are no modes. Lines of constant frequency are found
and subtracted before an identification. A lifter on the cepstrum is the older remedy; it needs no knowledge of the
lines, but adds damping.
"""

import matplotlib.pyplot as plt

import sprung
from sprung.excitation import Lines, RandomInputs, Sum, constant_speed
from sprung.signals.spectrum import spectral_matrix
from sprung.vehicles import chain

# %%
# A chain with an engine on its top
# ---------------------------------
# Three masses under random forces. An engine at 9.6 revolutions per second acts on the third one with its first,
# second and third orders; the second order, at 19.2 Hz, is next to the second mode.

structure = chain()
exact = structure.modes()
noise = RandomInputs(3)
engine = Lines(constant_speed(9.6), orders=(1.0, 2.0, 3.0), amplitudes=(2.0, 2.0, 1.0), shares=(0.0, 0.2, 1.0))


def simulated(excitation):
    """Return two minutes at 200 Hz."""
    return sprung.simulate(structure, excitation, duration=120.0, sampling_rate=200.0, snr=10, seed=3)


run, quiet = simulated(Sum((noise, engine))), simulated(noise)

figure, axes = plt.subplots(figsize=(8, 3.5), layout="constrained")
for recording, name in ((run, "with the engine"), (quiet, "without")):
    spectra = spectral_matrix(recording, segment_length=8.0)
    axes.semilogy(spectra.frequencies, spectra.densities[2], label=name, linewidth=0.9)
for frequency in exact.natural_frequency:
    axes.axvline(frequency, color="0.8", zorder=0)
axes.set(xlim=(0, 40), xlabel="frequency [Hz]", ylabel="density of acc_3 [m²/s⁴/Hz]")
axes.legend(frameon=False)
plt.show()

# %%
# Lines are found and subtracted
# ------------------------------
# The search is part of every identification. Lines are reported as harmonics, and the second mode is found although a
# line is next to it.


def show(name, modes):
    """Print the modes next to the exact ones."""
    found = ", ".join(
        f"{f:.2f} Hz {100 * xi:.2f} %" for f, xi in zip(modes.natural_frequency, modes.damping_ratio, strict=True)
    )
    print(f"{name:>22}: {found}")


identification = sprung.cov_ssi(run)
show("exact", exact)
show("lines subtracted", identification.modes)
for harmonic in identification.harmonics:
    print(f"line at {harmonic.frequency:.3f} Hz")

# %%
# Without the search (an empty tuple states that there are no lines), the line next to the second mode makes its
# damping too low, and a mode is reported that the chain does not have.

blind = sprung.cov_ssi(run, settings=sprung.IdentificationSettings(harmonics=(), refine=False))
show("lines kept", blind.modes)
plt.show()

# %%
# Cepstrum editing
# ----------------
# The cepstrum is the inverse Fourier transform of the logarithm of the amplitude spectrum. Modes are concentrated at
# short quefrencies, lines spread over all: a short-pass lifter smooths the log spectrum, so that narrow lines
# disappear. Lightly damped modes lose their peaks, too, which reads as additional damping. An exponential lifter adds
# a known damping, which is subtracted from the poles afterwards.

for name, lifter in (("short-pass 0.25 s", sprung.ShortPass(0.25)), ("exponential 0.2 s", sprung.Exponential(0.2))):
    settings = sprung.IdentificationSettings(harmonics=(), lifter=lifter, refine=False)
    edited = sprung.cov_ssi(run, settings=settings)
    show(name, edited.modes)

# %%
# Spectra before and after the exponential lifter: the lines are gone, the peaks of the modes are wider.

figure, axes = plt.subplots(figsize=(8, 3.5), layout="constrained")
for spectra, name in ((edited.spectra, "as recorded"), (edited.edited_spectra, "edited")):
    axes.semilogy(spectra.frequencies, spectra.densities[2], label=name, linewidth=0.9)
axes.set(xlim=(0, 40), xlabel="frequency [Hz]", ylabel="density of acc_3 [m²/s⁴/Hz]")
axes.legend(frameon=False)
plt.show()
