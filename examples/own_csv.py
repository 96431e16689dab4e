"""Identify modes in a CSV file of one's own: accelerations in g with a time column, and a vehicle file for the labels.

Run it with `python examples/own_csv.py [FILE]`; without a file, the example writes one to `run.csv` first.
"""

import csv
import sys

import sprung

car = sprung.read_vehicle("zafira")


def write_example(path: str) -> None:
    """Write two simulated minutes as a table; a heading may carry the unit of its column."""
    model = sprung.structure(car)
    excitation = sprung.usual_excitation(model)
    run = sprung.simulate(model, excitation, duration=120.0, sampling_rate=100.0, snr=20, seed=1)
    with open(path, "w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(["time", *(f"{name} [g]" for name in run.names)])
        for k, samples in enumerate(run.samples.T):
            rows.writerow([f"{k / run.sampling_rate:.2f}", *(f"{value / 9.80665:.6g}" for value in samples)])


path = sys.argv[1] if len(sys.argv) > 1 else "run.csv"
if len(sys.argv) == 1:
    write_example(path)

run = sprung.read(path)
facts = sprung.inspect(run)
print(f"{facts.n_samples} samples at {facts.sampling_rate:g} Hz, {facts.n_gaps} gaps")
for channel in facts.channels:
    print(f"{channel.name}: RMS {channel.rms:.3g} {channel.unit}{', dead' if channel.is_dead else ''}")

identification = sprung.cov_ssi(run, vehicle=car)
print(identification)
sprung.write_identification(identification, "modes.json", vehicle=car)
