"""From a recording to modes in Python: a simulated car on white bases, four accelerometers on its body.

Run it with `python examples/modes_of_a_car.py`; figures go to the folder `figures`.
"""

import sprung
from sprung.plotting import save_figures
from sprung.simulation import usual_excitation
from sprung.vehicles import structure

vehicle = sprung.read_vehicle("zafira")
car = structure(vehicle)
run = sprung.simulate(car, usual_excitation(car), duration=600.0, sampling_rate=200.0, snr=10, seed=1)

found = sprung.cov_ssi(run, vehicle=vehicle)
print(found)

exact = car.modes()
for label, frequency, ratio in zip(exact.labels[:3], exact.natural_frequency, exact.damping_ratio, strict=False):
    print(f"true {label}: {frequency:.2f} Hz, {100 * ratio:.1f} %")

for path in save_figures(found, "figures"):
    print(path)
