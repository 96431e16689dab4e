"""Identify the modes of a car: a simulated car on independent random bases, four accelerometers on its body.

Run it with `python examples/modes_of_a_car.py`; figures are written to the folder `figures`.
"""

import sprung

vehicle = sprung.read_vehicle("zafira")
car = sprung.structure(vehicle)
run = sprung.simulate(car, sprung.usual_excitation(car), duration=600.0, sampling_rate=200.0, snr=10, seed=1)

identification = sprung.cov_ssi(run, vehicle=vehicle)
print(identification)

exact = car.modes()
for label, frequency, ratio in zip(exact.labels[:3], exact.natural_frequency, exact.damping_ratio, strict=False):
    print(f"true {label}: {frequency:.2f} Hz, {100 * ratio:.1f} %")

for path in sprung.plotting.save_figures(identification, "figures"):
    print(path)
