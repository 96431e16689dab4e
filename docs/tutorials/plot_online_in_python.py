"""
Online, in Python
=================

A monitor of one vehicle is an object that takes blocks of samples as they come and returns events: modes at regular
intervals, an observation at the end of every window, and a diagnosis once there is a baseline. ``sprung monitor`` runs
many of them; here is one, without a broker or a store.
"""

import matplotlib.pyplot as plt
import numpy as np

import sprung
from sprung.online.monitor import Identified, MonitorSettings, Observed, VehicleMonitor

# %%
# A stream
# --------
# Windows of five minutes keep this page short; ten minutes are usual. The baseline is learnt from eight windows. Then
# a rear spring loses a quarter of its stiffness.

car = sprung.read_vehicle("zafira")
healthy = sprung.simulate_drive(car, sprung.RoadDrive(duration=2400.0, sampling_rate=100.0, snr=50.0), seed=1)
fault = sprung.parse_fault("rear_left.spring=-0.25")
broken = sprung.simulate_drive(
    car, sprung.RoadDrive(duration=1200.0, sampling_rate=100.0, faults=(fault,), snr=50.0), seed=2
)


def blocks(recording, *, seconds=10.0):
    """Yield a recording in blocks, as they come from a vehicle."""
    per = int(seconds * recording.sampling_rate)
    for first in range(0, recording.n_samples, per):
        yield sprung.Recording(recording.samples[:, first : first + per], recording.sampling_rate, recording.channels)


# %%
# The monitor
# -----------
# It holds the samples of one window, however long the stream is; ``monitor.state()`` is what a restart needs.

settings = MonitorSettings(window=300.0, identify_every=150.0, learning_windows=8, calibrate=False)
monitor = VehicleMonitor(car, settings=settings)
tracked, evidence, seconds = [], [], 0.0
for recording in (healthy.recording, broken.recording):
    for block in blocks(recording):
        seconds += block.n_samples / block.sampling_rate
        for event in monitor.update(block):
            if isinstance(event, Identified):
                tracked += [(seconds / 60, mode["natural_frequency"], mode["label"]) for mode in event.modes]
            if (
                isinstance(event, Observed)
                and monitor.diagnosis is not None
                and monitor.diagnosis.detection is not None
            ):
                evidence.append((seconds / 60, monitor.diagnosis.detection.evidence[-1]))
                threshold = monitor.diagnosis.detection.threshold
                sentences = [finding.sentence for finding in monitor.diagnosis.findings]
                print(f"{seconds / 60:.0f} min: {monitor.diagnosis.verdict}", *sentences)

# %%
# Modes that were identified on the way, and the evidence of a change after every window since the baseline. The alert
# comes with the first window after the change, which begins at minute 40.

figure, (upper, lower) = plt.subplots(2, 1, figsize=(8, 5), sharex=True, layout="constrained")
labels = ("bounce", "pitch", "roll")
for label in labels:
    points = np.array([(t, f) for t, f, name in tracked if name == label]).reshape(-1, 2)
    upper.plot(*points.T, "o", markersize=4, label=label)
upper.set(ylabel="natural frequency [Hz]", ylim=(1, 3))
upper.legend(frameon=False, ncols=3)
lower.plot(*np.array(evidence).T, marker="o", color="C3")
lower.axhline(threshold, color="0.5", linestyle="--")
lower.axvspan(0, 40, color="0.95", zorder=0)
lower.set(xlabel="time [min]", ylabel="ln evidence of a change", xlim=(0, 60))
lower.text(1, threshold, "alert", va="bottom", color="0.4")
plt.show()

# %%
# A restart
# ---------
# The state is a document of plain values. A new monitor continues from it as the old one would have done.

resumed = VehicleMonitor.from_state(car, monitor.state())
print(resumed.diagnosis.verdict if resumed.diagnosis else "continues with the next window")
plt.show()
