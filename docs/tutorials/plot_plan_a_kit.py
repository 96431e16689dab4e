"""
Plan a kit: which sensors suffice
=================================

Before anybody drills a hole: how well would a set of sensors determine springs, dampers and tyres? The standard
deviations of a fit come from its Fisher information, which depends on sensors, drive and duration. Simulated drives
answer the question for every kit.
"""

import matplotlib.pyplot as plt
import numpy as np

import sprung
from sprung.vehicles import Sensor

# %%
# Four kits for one car
# ---------------------
# Accelerometers above all four wheels; above three of them; one six-axis unit in the middle, of which the vertical
# acceleration and two rates are used; and the four corners with accelerometers on the front wheel carriers.

car = sprung.read_vehicle("zafira")
up = (0.0, 0.0, 1.0)


def accelerometer(channel, **place):
    """Return a vertical accelerometer."""
    return Sensor(channel=channel, quantity="acceleration", unit="m/s^2", **place)


corners = car.sensor
unit = (
    accelerometer("acc_z", position=(0.0, 0.0, 0.0), direction=up),
    Sensor(channel="roll_rate", quantity="angular_velocity", unit="rad/s", direction=(1.0, 0.0, 0.0)),
    Sensor(channel="pitch_rate", quantity="angular_velocity", unit="rad/s", direction=(0.0, 1.0, 0.0)),
)
wheels = tuple(accelerometer(f"wheel_{side}", on=f"wheel_front_{side}") for side in ("left", "right"))
kits = {
    "four corners": corners,
    "three corners": corners[:3],
    "one six-axis unit": unit,
    "corners and front wheels": corners + wheels,
}

# %%
# Fits of the same drive
# ----------------------
# Every kit is on the same drive of forty minutes: the seed fixes road and speed. The RMS of the sensor noise is a
# fiftieth of that of the motion.


def equipped_with(sensors):
    """Return the car with these sensors only."""
    return car.model_copy(update={"sensor": sensors})


def first_minutes(recording, minutes):
    """Return the beginning of a recording."""
    n = int(60 * minutes * recording.sampling_rate)
    return sprung.Recording(recording.samples[:, :n], recording.sampling_rate, recording.channels)


settings = sprung.RoadDrive(duration=2400.0, sampling_rate=100.0, snr=50.0)
drives = {
    name: sprung.simulate_drive(equipped_with(sensors), settings, seed=2).recording for name, sensors in kits.items()
}
fits = {
    name: sprung.fit_corners(first_minutes(drives[name], 10), equipped_with(sensors)) for name, sensors in kits.items()
}
for name, fit in fits.items():
    print(f"{name:>25}: {np.median(100 * fit.log_ratios_std):.1f} % standard deviation of a component, in the median")

# %%
# All kits give about the same, because the sensors are not the limit: motion shows stiffness over mass, and the
# unsprung masses are known only within 7 %. That error is common to all corners.

# %%
# Left against right
# ------------------
# A monitor looks for a change at one corner. What is common to all corners cancels in the contrast of left and right,
# and there the kits differ. The contrasts follow from the covariance of the fit.

PAIRS = [(axle, part) for axle in ("front", "rear") for part in ("spring", "damper", "tyre")]


def contrasts(fit):
    """Return the standard deviations of ln(left / right) of each pair [%]."""
    names = [str(component) for component in fit.components]
    covariance = fit.covariance[: len(names), : len(names)]
    rows = np.zeros((len(PAIRS), len(names)))
    for row, (axle, part) in zip(rows, PAIRS, strict=True):
        row[names.index(f"{axle}_left.{part}")], row[names.index(f"{axle}_right.{part}")] = 1.0, -1.0
    return 100 * np.sqrt(np.einsum("pi,ij,pj->p", rows, covariance, rows))


figure, axes = plt.subplots(figsize=(8.5, 3.5), layout="constrained")
places = np.arange(len(PAIRS))
for k, (name, fit) in enumerate(fits.items()):
    axes.bar(places + 0.2 * (k - 1.5), contrasts(fit), width=0.18, label=name)
axes.set_xticks(places, [f"{axle} {part}s" for axle, part in PAIRS])
axes.set(ylabel="left against right, standard deviation [%]")
axes.legend(frameon=False, ncols=4, loc="lower center", bbox_to_anchor=(0.5, 1.0))
plt.show()

# %%
# Longer drives
# -------------
# The standard deviation of the contrasts falls with the driving time, at best with its square root. Where the measured
# spectra deviate from the fitted ones by more than chance allows, which long drives show first, the fit gives the data
# less weight, and a curve flattens.

minutes = np.array([5, 10, 20, 40])
figure, axes = plt.subplots(figsize=(6, 3.5), layout="constrained")
for name in ("four corners", "one six-axis unit", "corners and front wheels"):
    vehicle = equipped_with(kits[name])
    scatter = [
        np.median(contrasts(sprung.fit_corners(first_minutes(drives[name], m), vehicle))) for m in minutes.tolist()
    ]
    axes.plot(minutes, scatter, marker="o", label=name)
axes.set_xticks(minutes, [str(m) for m in minutes])
axes.set(xlabel="driving [min]", ylabel="median contrast, std [%]", ylim=(0, None))
axes.legend(frameon=False)
plt.show()
