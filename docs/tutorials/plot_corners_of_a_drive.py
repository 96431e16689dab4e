"""
Corners of a drive
==================

Springs, dampers and tyres of every corner of a car, from the vertical accelerations of its body while it drives on an
ordinary road. The road is not measured, but the speed is: from it follows how much later the rear wheels meet the same
road.
"""

import matplotlib.pyplot as plt
import numpy as np

import sprung

# %%
# A drive
# -------
# Ten minutes on a road of class C, at 20 to 72 km/h, with one soft spring and one worn damper. The vehicle file
# describes the car as it left the factory: geometry, masses and nominal values.

car = sprung.read_vehicle("zafira")
faults = (sprung.parse_fault("front_left.spring=-0.2"), sprung.parse_fault("rear_right.damper=-0.3"))
drive = sprung.simulate_drive(car, sprung.RoadDrive(duration=600.0, faults=faults, snr=50.0), seed=1)
run = drive.recording

time = np.arange(run.n_samples) / run.sampling_rate
figure, (upper, lower) = plt.subplots(2, 1, figsize=(8, 4), sharex=True, layout="constrained")
upper.plot(time, run.samples[run.names.index("acc_fl")], linewidth=0.3)
lower.plot(time, 3.6 * run.samples[run.names.index("speed")], color="C1")
upper.set(ylabel="acc_fl [m/s²]")
lower.set(xlabel="time [s]", ylabel="speed [km/h]", xlim=(0, 600))
plt.show()

# %%
# Modes are hard to see
# ---------------------
# A car's body modes are damped by 20 % and more, and the rear wheels repeat the road of the front wheels, so that the
# spectra have dips that are no property of the car. Covariance-driven SSI without the vehicle finds few of them.

blind = sprung.cov_ssi(run)
print(blind)
print("true:", [f"{m['label']} {m['natural_frequency']:.2f} Hz" for m in drive.truth["modes"]])

# %%
# The fit
# -------
# Instead, a model of the vehicle is fitted to the spectra by maximum likelihood: its response, the road with the delay
# of the rear wheels, and the noise of the sensors.

fit = sprung.fit_corners(run, car)
print(fit)

# %%
# Changes against the vehicle file, with 95 % intervals. The two faults stand out; the rest is within its interval.

plt.figure(sprung.plotting.corners_figure(fit))
plt.show()

# %%
# Against the truth: errors in percent, and in standard deviations.

for component, value, deviation in zip(fit.components, fit.values, fit.log_ratios_std, strict=True):
    true = drive.truth["components"][component.corner][component.kind]["value"]
    error = np.log(value / true)
    print(f"{component!s:20} {value:9.0f}  error {100 * error:+5.1f} %  ({error / deviation:+.1f} std)")

# %%
# Does the model explain the spectra? Measured and fitted spectra of bounce, pitch and roll, averaged over the classes
# of speed; next to them the misfit, with the range that chance explains.

plt.figure(sprung.plotting.fitted_spectra_figure(fit))
plt.show()
