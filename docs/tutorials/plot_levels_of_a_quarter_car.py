"""
Frequency and damping over the level: CoSS-SSI
==============================================

Suspensions are not linear: at small amplitudes dry friction sticks, which stiffens the spring, and dampers are
digressive. An average over a whole record then mixes the modes of several states. CoSS-SSI sorts correlations by the
level of the motion and identifies every subset on its own.
"""

import matplotlib.pyplot as plt
import numpy as np

import sprung
from sprung.excitation import RandomInputs
from sprung.simulation import ForceLaw, simulate_nonlinear

# %%
# A quarter car with friction
# ---------------------------
# The road moves one wheel; accelerometers are on body and wheel. A friction element (Dahl) acts in parallel with
# spring and damper, as in bushings and leaf springs: it sticks, and stiffens the spring, at small amplitudes, and
# slips at large ones.

quarter = sprung.structure(sprung.read_description("quarter"))
exact = quarter.modes()
print(
    "linear:",
    [f"{f:.2f} Hz, {100 * xi:.1f} %" for f, xi in zip(exact.natural_frequency, exact.damping_ratio, strict=True)],
)

friction = {"suspension": ForceLaw(rubber_stiffness=3000.0, rubber_force=1.0)}

# %%
# Five records, on roads of five heights. Values are per kilogram of body, so that 1 N of friction is a tenth of the
# weight.

heights = np.geomspace(0.05e-3, 0.8e-3, 5)  # m
runs = [
    simulate_nonlinear(
        quarter,
        RandomInputs(1, standard_deviation=height, band=(0.5, 60.0)),
        duration=120.0,
        sampling_rate=200.0,
        force_laws=friction,
        snr=50,
        seed=seed,
    )
    for seed, height in enumerate(heights)
]

# %%
# One average, or several
# -----------------------
# Covariance-driven SSI averages all correlations. CoSS-SSI takes the records together and sorts: here into five
# subsets.

settings = sprung.IdentificationSettings(band=(5.0, 25.0), n_subsets=5)
together = sprung.cov_ssi(runs, settings=settings)
sorted_by_level = sprung.coss_ssi(runs, settings=settings)
print(together)
print(sorted_by_level)

# %%
# The level of a subset is the RMS of its motion relative to that of the first record. At low levels the friction
# element sticks, and the frequency is high. At high levels it slips, and the mode tends to that of the linear car
# (dashed). The average over all records (grey) belongs to none of these states.

figure, (upper, lower) = plt.subplots(2, 1, figsize=(7, 5), sharex=True, layout="constrained")
for subset in sorted_by_level.subsets:
    if not len(subset.modes):
        continue
    mode = int(np.argmin(np.abs(subset.modes.natural_frequency - exact.natural_frequency[0])))
    level = np.sqrt(np.prod(subset.level))
    values, deviations = subset.modes.natural_frequency, subset.modes.natural_frequency_std
    upper.errorbar(level, values[mode], 2 * deviations[mode], fmt="o", color="C0", capsize=3)
    values, deviations = 100 * subset.modes.damping_ratio, 100 * subset.modes.damping_ratio_std
    lower.errorbar(level, values[mode], 2 * deviations[mode], fmt="o", color="C0", capsize=3)
for axes, averages in ((upper, together.modes.natural_frequency), (lower, 100 * together.modes.damping_ratio)):
    axes.axhline(averages[0], color="0.8", linewidth=4, zorder=0)
upper.axhline(exact.natural_frequency[0], color="0.5", linestyle="--")
lower.axhline(100 * exact.damping_ratio[0], color="0.5", linestyle="--")
upper.set(ylabel="natural frequency [Hz]")
lower.set(ylabel="damping ratio [%]", xlabel="level, relative to the first record", xscale="log", xlim=(0.5, 20))
plt.show()

# %%
# A test shows whether a mode depends on the level at all: p is the probability of changes as large in a linear system.

trends = sorted_by_level.level_trends
for k, frequency in enumerate(sorted_by_level.modes.natural_frequency):
    print(
        f"{frequency:.2f} Hz: p = {trends.p_value[k]:.1e}; twice the level changes the frequency by "
        f"{100 * trends.natural_frequency[k]:+.1f} % and the damping ratio by {100 * trends.damping_ratio[k]:+.1f} "
        "percentage points"
    )
plt.show()
