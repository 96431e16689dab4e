"""
Learn what is normal, find what changed
=======================================

A baseline is learnt from windows of ten minutes of a healthy vehicle. New windows are compared with it: which spring,
damper or tyre changed, by how much, since when, and with what certainty?
"""

import matplotlib.pyplot as plt
import numpy as np

import sprung

# %%
# Healthy drives
# --------------
# An hour on the road gives six windows. An observation is the result of a window: logarithms of stiffness and damping
# with their covariance, speed, load, and whether the sensors work.

car = sprung.read_vehicle("zafira")
healthy = sprung.simulate_drive(car, sprung.RoadDrive(duration=3600.0, snr=50.0), seed=1)
baseline = sprung.learn(sprung.observe(healthy.recording, car))
print(baseline)

# %%
# How large a change could be found? The smallest loss of each part that raises an alert with 95 % power, after several
# windows with the change.

figure, axes = plt.subplots(figsize=(7, 3.5), layout="constrained")
counts = np.array([1, 2, 3, 6, 12])
limits = [sprung.detectable(baseline, n_windows=int(n)) for n in counts]
for kind, colour in (("spring", "C0"), ("damper", "C1"), ("tyre", "C2")):
    values = [[100 * loss for part, loss in limit.items() if part.kind == kind] for limit in limits]
    axes.plot(10 * counts, np.mean(values, axis=1), marker="o", color=colour, label=kind)
axes.set(xlabel="driving with the change [min]", ylabel="detectable loss [%]", ylim=(0, None))
axes.legend(frameon=False)
plt.show()

# %%
# A fault
# -------
# Twenty minutes with a front-left damper that has lost a quarter of its damping, and the verdict.

fault = sprung.parse_fault("front_left.damper=-0.25")
changed = sprung.simulate_drive(car, sprung.RoadDrive(duration=1200.0, faults=(fault,), snr=50.0), seed=2)
diagnosis = sprung.diagnose(sprung.observe(changed.recording, car), baseline)
print(diagnosis)
for finding in diagnosis.findings:
    print(finding.sentence)

# %%
# Corners against the baseline.

plt.figure(sprung.plotting.corner_changes_figure(diagnosis, baseline))
plt.show()

# %%
# The evidence of a change grows from window to window. It raises an alert where it reaches the threshold, which
# follows from the accepted rate of false alarms, one in a thousand days.

plt.figure(sprung.plotting.evidence_figure(diagnosis))
plt.show()

# %%
# Without a fault
# ---------------
# The same with another healthy drive: no change is detected, and the diagnosis states the smallest change that would
# have been found.

again = sprung.simulate_drive(car, sprung.RoadDrive(duration=1200.0, snr=50.0), seed=3)
print(sprung.diagnose(sprung.observe(again.recording, car), baseline))
plt.show()
