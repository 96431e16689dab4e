"""
Modes of a building
===================

Natural frequencies, damping ratios and mode shapes of a five-storey frame from its ambient vibration: only the
accelerations of the floors are measured, and not wind and traffic. The frame is simulated, so that the exact modes are
known.
"""

import matplotlib.pyplot as plt
import numpy as np

import sprung
from sprung.vehicles import chain

# %%
# The frame
# ---------
# Five floors of equal mass, each on columns whose stiffness falls towards the roof. A chain of masses describes it;
# every floor has an accelerometer. :meth:`~sprung.Structure.modes` gives the exact modes.

frame = chain(5, mass=120e3, stiffness=[190e6, 180e6, 165e6, 150e6, 130e6], damping=[420e3, 400e3, 370e3, 330e3, 290e3])
exact = frame.modes()
for frequency, damping in zip(exact.natural_frequency, exact.damping_ratio, strict=True):
    print(f"{frequency:6.3f} Hz  {100 * damping:5.2f} %")

# %%
# The record
# ----------
# Twenty minutes at 50 Hz. A white force acts on every floor, and the sensors add white noise with a fifth of the RMS
# of the motion.

run = sprung.simulate(frame, sprung.usual_excitation(frame), duration=1200.0, sampling_rate=50.0, snr=5, seed=4)

time = np.arange(run.n_samples) / run.sampling_rate
figure, axes = plt.subplots(figsize=(8, 3), layout="constrained")
axes.plot(time[:1500], run.samples[4, :1500] * 1e6, linewidth=0.8)
axes.set(xlabel="time [s]", ylabel="acceleration of the roof [µm/s²]", xlim=(0, 30))
plt.show()

# %%
# The modes
# ---------
# One call: band, segments, model orders and the selection of modes come from the data.

identification = sprung.cov_ssi(run)
print(identification)

# %%
# The stabilisation diagram shows where the poles of models of rising order agree. Modes are alignments of stable
# poles whose contribution to the correlations between the channels exceeds chance.

plt.figure(sprung.plotting.stabilisation_figure(identification))
plt.show()

# %%
# Against the truth
# -----------------
# Each estimate has a standard deviation, from the scatter of the blocks of the record and from the likelihood of its
# spectra. The errors below are in these standard deviations: most lie between -2 and 2.

modes = identification.modes
for k, (frequency, damping) in enumerate(zip(exact.natural_frequency, exact.damping_ratio, strict=True)):
    mode = int(np.argmin(np.abs(modes.natural_frequency - frequency)))
    error_f = (modes.natural_frequency[mode] - frequency) / modes.natural_frequency_std[mode]
    error_xi = (modes.damping_ratio[mode] - damping) / modes.damping_ratio_std[mode]
    print(
        f"mode {k + 1}: {modes.natural_frequency[mode]:.3f} Hz ({error_f:+.1f} std), "
        f"{100 * modes.damping_ratio[mode]:.2f} % ({error_xi:+.1f} std), "
        f"MAC {sprung.mac(modes.mode_shapes[mode : mode + 1], exact.mode_shapes[k : k + 1])[0, 0]:.4f}"
    )

# %%
# Identified shapes (dots) on exact ones (lines). Identified shapes are complex; those of a structure with evenly
# distributed damping have nearly one phase, so that their real parts suffice.

figure, panels = plt.subplots(1, 5, figsize=(9, 3.5), sharey=True, layout="constrained")
floors = np.arange(6)
for k, axes in enumerate(panels):
    mode = int(np.argmin(np.abs(modes.natural_frequency - exact.natural_frequency[k])))
    true = exact.mode_shapes[k].real
    shape = modes.mode_shapes[mode]
    shape = (shape * true[np.argmax(np.abs(true))] / shape[np.argmax(np.abs(true))]).real
    axes.plot(np.append(0, true), floors, color="0.6")
    axes.plot(np.append(0, shape), floors, "o", markersize=5)
    axes.axvline(0, color="0.85", linewidth=0.8, zorder=0)
    axes.set(title=f"{modes.natural_frequency[mode]:.2f} Hz", xlim=(-1.3, 1.3), xticks=[])
panels[0].set(ylabel="floor")
plt.show()
