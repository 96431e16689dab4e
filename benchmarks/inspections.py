"""Faults named in fleets without baselines after five inspections: the vehicles that `to_inspect` names, or any.

Each fleet has 20 vehicles of one type and three windows of each; in some of them one part has lost 20 %. A fault is
named where an inspection found it, or where the vehicle is reported to deviate, with that part first. A wrong name is a
healthy vehicle that is reported, or another part.
"""

import argparse
from collections import Counter

import numpy as np

from sprung import Observation, read_vehicle, structure
from sprung.diagnosis import rank_fleet, to_inspect
from sprung.diagnosis.type_baselines import PRODUCTION_SCATTER, between_vehicles
from sprung.diagnosis.type_comparison import TypeComparison

PARTS = tuple(structure(read_vehicle("zafira")).components())
KINDS = sorted({part.kind for part in PARTS})
WITHIN = 0.012**2 * (np.eye(len(PARTS)) + 0.3)
#: Standard deviation of ln(left / right) of each kind.
SCATTERS = {
    "as the type's model": PRODUCTION_SCATTER,
    "dampers twice as much": PRODUCTION_SCATTER | {"damper": 2 * PRODUCTION_SCATTER["damper"]},
    "every fourth vehicle twice as much": PRODUCTION_SCATTER,
}
LOSS = float(np.log(0.8))


def drawn(generator, scatter, n_vehicles, n_faulty):
    """Return the windows of each vehicle and the faulty part of some."""
    between = between_vehicles(
        PARTS, left_right=SCATTERS[scatter], front_rear=dict.fromkeys(KINDS, 0.04), common=dict.fromkeys(KINDS, 0.06)
    )
    means = np.linalg.cholesky(between) @ generator.standard_normal((len(PARTS), n_vehicles))
    if scatter.startswith("every"):
        means[:, ::4] *= 2
    faulty = dict(zip(generator.permutation(n_vehicles)[:n_faulty], generator.permutation(len(PARTS)), strict=False))
    windows, faults = {}, {}
    for number, mean in enumerate(means.T):
        away = np.zeros(len(PARTS))
        if number in faulty:
            away[faulty[number]] = LOSS
            faults[f"bus-{number:03d}"] = str(PARTS[faulty[number]])
        values = mean + away + generator.multivariate_normal(np.zeros(len(PARTS)), WITHIN, size=3)
        windows[f"bus-{number:03d}"] = [
            Observation(600.0 * k, PARTS, value, WITHIN, {"temperature": 20.0}, {}, ())
            for k, value in enumerate(values)
        ]
    return windows, faults


def after(windows, faults, known):
    """Return the ranking after the verdicts on some vehicles."""
    rest = {vehicle: own for vehicle, own in windows.items() if vehicle not in known}
    healthy = {vehicle: windows[vehicle] for vehicle in known if vehicle not in faults}
    return rank_fleet(rest, healthy=healthy)


def by_information(windows, faults, n_inspections):
    """Return the ranking after inspections of the vehicles that `to_inspect` names, and their names."""
    known, ranked = [], rank_fleet(windows)
    while len(known) < n_inspections and (best := to_inspect(ranked)) is not None:
        known.append(best.vehicle)
        ranked = after(windows, faults, known)
    return ranked, known


def counts(ranked, known, faults):
    """Return the numbers of faults, of those named, and of wrong names."""
    named = {one.vehicle: one.detection.candidates[0].hypothesis.name for one in ranked if one.is_discovery}
    right = sum(vehicle in known or named.get(vehicle) == part for vehicle, part in faults.items())
    wrong = sum(faults.get(vehicle) != part for vehicle, part in named.items())
    return Counter(faults=len(faults), named=right, wrong=wrong, found=sum(vehicle in known for vehicle in faults))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--fleets", type=int, default=20)
    parser.add_argument("--vehicles", type=int, default=20)
    parser.add_argument("--faulty", type=int, default=4)
    parser.add_argument("--inspections", type=int, default=5)
    parser.add_argument("--scatter", choices=list(SCATTERS), nargs="*", default=list(SCATTERS))
    options = parser.parse_args()
    TypeComparison.detectable = lambda *_: {}  # half of the time, and not needed here
    print(f"{options.fleets} fleets of {options.vehicles}, {options.faulty} faulty, {options.inspections} inspections")
    print("scatter | inspected | faults named | of them by inspection | wrong names per fleet", flush=True)
    for scatter in options.scatter:
        totals = {name: Counter() for name in ("none", "at random", "by information")}
        for seed in range(options.fleets):
            generator = np.random.default_rng(seed)
            windows, faults = drawn(generator, scatter, options.vehicles, options.faulty)
            anyone = list(map(str, generator.permutation(list(windows))[: options.inspections]))
            totals["none"] += counts(rank_fleet(windows), [], faults)
            totals["at random"] += counts(after(windows, faults, anyone), anyone, faults)
            totals["by information"] += counts(*by_information(windows, faults, options.inspections), faults)
        for name, total in totals.items():
            shares = [f"{100 * total[kind] / total['faults']:.1f} %" for kind in ("named", "found")]
            print(" | ".join([scatter, name, *shares, f"{total['wrong'] / options.fleets:.2f}"]), flush=True)


if __name__ == "__main__":
    main()
