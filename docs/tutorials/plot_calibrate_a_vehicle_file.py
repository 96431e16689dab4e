"""
Calibrate a vehicle file
========================

Hardly anybody knows the inertias of a vehicle, and few know its spring rates. A data sheet and some healthy drives
suffice: the file is first written from mass, wheelbase, track and tyre size, and then completed from the drives.
"""

import matplotlib.pyplot as plt
import numpy as np

import sprung

# %%
# From a data sheet
# -----------------
# The simulated car plays the real one. Its owner knows the mass with driver, the dimensions and the tyres.

real = sprung.read_vehicle("zafira")
sheet = sprung.DataSheet(
    mass=real.body.mass + 4 * 40.5, wheelbase=2.8, track=1.404, tyre="205/55R16", front_share=0.56, name="family car"
)
described = sprung.described(sheet)
print(f"pitch inertia {described.body.pitch_inertia:.0f} kg m², truly {real.body.pitch_inertia:.0f}")
print(f"front spring {described.axle[0].spring_stiffness:.0f} N/m, truly {real.axle[0].spring_stiffness:.0f}")

# %%
# Healthy drives
# --------------
# Two drives of ten minutes, with different loads.

drives = [
    sprung.simulate_drive(
        real, sprung.RoadDrive(duration=600.0, snr=50.0, payload=sprung.Payload(load)), seed=seed
    ).recording
    for seed, load in enumerate((0.0, 120.0))
]

# %%
# Completed
# ---------
# All windows are fitted together: they share the numbers of the file, and each has its own load and road. What was
# known of a number before is its prior, with a standard deviation.

calibration = sprung.calibrate(drives, described)
print(calibration)
completed = calibration.vehicle

# %%
# What was learnt, against the file before.

plt.figure(calibration.plot())
plt.show()

# %%
# Natural frequencies before and after, against the true ones. Two drives do not determine everything: the lines
# printed above say what stays near the guesses of the data sheet.

rows = {
    "data sheet": sprung.structure(described).modes(),
    "calibrated": sprung.structure(completed).modes(),
    "truth": sprung.structure(real).modes(),
}
figure, axes = plt.subplots(figsize=(7, 3), layout="constrained")
for k, (name, modes) in enumerate(rows.items()):
    frequencies = modes.natural_frequency[:3]
    axes.bar(np.arange(3) + 0.25 * (k - 1), frequencies, width=0.22, label=name)
    print(
        f"{name:>10}: " + ", ".join(f"{label} {f:.2f} Hz" for label, f in zip(modes.labels, frequencies, strict=False))
    )
axes.set_xticks(range(3), ["first", "second", "third"])
axes.set(ylabel="natural frequency [Hz]", ylim=(0, 3))
axes.legend(frameon=False, ncols=3)
plt.show()

# %%
# ``sprung.write_vehicle(completed, "family-car.toml")`` saves the file; ``sprung describe`` and ``sprung calibrate``
# do the same on the command line.

plt.show()
