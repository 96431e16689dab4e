"""
A fleet on a laptop's Spark
===========================

A depot has recordings of many vehicles, and wants to know which of them have changed. Windows of all drives are kept in
a lake; a run on Apache Spark analyses those without results on all cores, and fills tables that any SQL engine reads.
The same program runs on a cluster, with another ``master``. It needs the extra ``fleet`` and Java 17.
"""

import json
import tempfile
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import sprung
from sprung.fleet.jobs import FleetSettings, Results, run, spark_session
from sprung.fleet.jobs.assessment import AssessmentSettings
from sprung.fleet.lake import Lake, window_of_recording
from sprung.results.documents import observation_from_document

folder = Path(tempfile.mkdtemp())

# %%
# A lake of windows
# -----------------
# Four cars of one type with eight windows of two minutes each; the rear-right damper of car-4 loses half of its damping
# after the fifth window. In practice, ``sprung fleet import`` reads the files of drives, or monitors write the lake.

car = sprung.read_vehicle("zafira")
worn = (sprung.parse_fault("rear_right.damper=-0.5"),)


def windows():
    """Yield the windows of all vehicles."""
    for vehicle in range(1, 5):
        for number in range(8):
            faults = worn if vehicle == 4 and number >= 5 else ()
            drive = sprung.RoadDrive(duration=120.0, sampling_rate=100.0, snr=50.0, faults=faults)
            recording = sprung.simulate_drive(car, drive, seed=[vehicle, number]).recording
            start = 1_767_225_600 * 10**9 + number * 3600 * 10**9  # from 2026-01-01 on, one an hour
            yield window_of_recording(f"car-{vehicle}", replace(recording, start=start), source="simulation")


lake = Lake(folder / "lake")
lake.write(windows())
print(lake.facts)

# %%
# Vehicle files
# -------------
# A file for each vehicle, named after it. All four say the same, so these vehicles are of one type.

(folder / "vehicles").mkdir()
for vehicle in range(1, 5):
    sprung.write_vehicle(car, folder / "vehicles" / f"car-{vehicle}.toml")

# %%
# A run
# -----
# Every window is analysed once. A baseline is learnt from the first five windows of each vehicle, and the others are
# compared with it. Running again, with nothing new, does nothing.

results = Results(folder / "results")
settings = FleetSettings(steps=("baseline", "diagnose"), assessment=AssessmentSettings(learning_windows=5))
session = spark_session("local[2]")
for _ in range(2):
    done = run(session, lake, folder / "vehicles", results, settings=settings)
    print(f"{sum(done.n_windows.values())} windows analysed, {done.n_vehicles} vehicles assessed")
session.stop()

# %%
# Which vehicles have changed
# ---------------------------
# Diagnoses and findings are tables. The evidence of a vehicle is the natural logarithm of its e-value. Discoveries
# follow from e-BH, so that at most 5 % of them are expected to be healthy vehicles.

diagnoses = results["diagnoses"].rows().to_pandas().sort_values("vehicle")
findings = results["findings"].rows().to_pandas()
print(diagnoses[["vehicle", "verdict", "e_value", "is_discovery"]].to_string(index=False))

figure, axes = plt.subplots(figsize=(7, 3), layout="constrained")
colours = np.where(diagnoses["is_discovery"], "C3", "C7")
axes.bar(diagnoses["vehicle"], diagnoses["e_value"], color=colours)
axes.axhline(0.0, color="black", linewidth=0.8)
axes.set(ylabel="ln evidence of a change", title="red: discovery")
plt.show()

# %%
# What changed, by how much and how sure it is.

for row in findings.itertuples():
    interval = f"{100 * row.lower:.0f} to {100 * row.upper:.0f} %"
    print(f"{row.vehicle}: {row.corner} {row.component} {100 * row.change:+.0f} % ({interval})")

# %%
# The damper of car-4, window by window, beside that of car-1. The document of a window is the JSON of a window of
# ``sprung diagnose``; intervals are of 95 %.

figure, axes = plt.subplots(figsize=(7, 3), layout="constrained")
rows = results["windows"].rows().to_pandas().sort_values("start")
for vehicle, colour, shift in (("car-1", "C7", -0.1), ("car-4", "C3", 0.1)):
    documents = rows.loc[rows["vehicle"] == vehicle, "document"]
    seen = [observation_from_document(json.loads(document)) for document in documents]
    damper = [str(part) for part in seen[0].components].index("rear_right.damper")
    values = np.array([window.log_ratios[damper] for window in seen])
    half = 1.96 * np.sqrt([window.covariance[damper, damper] for window in seen])
    low, middle, high = 100 * np.expm1([values - half, values, values + half])
    number = np.arange(1, len(seen) + 1) + shift
    axes.errorbar(number, middle, [middle - low, high - middle], fmt="o", color=colour, capsize=3, label=vehicle)
axes.axvline(5.5, color="black", linewidth=0.8, linestyle="--")
axes.set(xlabel="window", ylabel="rear-right damper,\nchange from nominal [%]")
axes.legend(frameon=False, loc="lower left")
plt.show()
