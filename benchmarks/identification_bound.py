"""Refined modes over the Cramer-Rao bound: `python benchmarks/identification_bound.py --records 20`."""

import argparse
import os

from measuring import ONE_THREAD, print_circumstances, print_table

os.environ.update(ONE_THREAD)

import numpy as np
from chain_bound import Bound, chain_bound, modal_bound
from identification_records import Structure, share, with_noise
from numpy.typing import NDArray

from sprung.identification import cov_ssi
from sprung.recording import Channel, Recording
from sprung.simulation import simulate, usual_excitation
from sprung.vehicles import chain

Array = NDArray[np.float64]
PAIR = Structure(
    np.array([3.0, 3.06, 5.1]), np.array([0.01, 0.012, 0.015]), np.linalg.qr(np.vander([1.0, 2.0, 3.5, 5.0], 3))[0]
)
PAIR_RATE, PAIR_DURATION = 40.0, 250.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--records", type=int, default=20, help="records of each case")
    arguments = parser.parse_args()
    print_circumstances(peers=())
    rows = []
    exact = chain().modes()
    for snr in (10.0, 0.5):
        runs = [_chain_run(snr, seed) for seed in range(arguments.records)]
        truth = Bound(exact.natural_frequency, exact.damping_ratio)
        rows += _rows(f"chain, SNR {snr:g}", runs, truth, chain_bound(snr=snr))
    runs = [_pair_run(seed) for seed in range(arguments.records)]
    truth = Bound(PAIR.natural_frequency, PAIR.damping_ratio)
    lines = np.arange(1, int(PAIR_DURATION * PAIR_RATE / 2)) / PAIR_DURATION
    powers = PAIR.damping_ratio / PAIR.natural_frequency
    least = modal_bound(truth, PAIR.shapes, lines, snr=10.0, sampling_rate=PAIR_RATE, powers=powers)
    rows += _rows("pair 2 % apart", runs, truth, least)
    header = ["case", "mode", "found", "std f / bound", "std xi / bound", "bias f / std", "bias xi / std"]
    print_table("Refined modes over the bound", [*header, "95 % covers f", "95 % covers xi"], rows)


def _chain_run(snr: float, seed: int) -> Recording:
    system = chain()
    return simulate(system, usual_excitation(system), duration=60.0, sampling_rate=500.0, snr=snr, seed=seed)


def _pair_run(seed: int) -> Recording:
    rng = np.random.default_rng(seed)
    samples = with_noise(PAIR.response(int(PAIR_DURATION * PAIR_RATE), PAIR_RATE, rng), 10.0, rng)
    return Recording(samples, PAIR_RATE, tuple(Channel(f"s{k}") for k in range(len(samples))))


def _rows(name: str, runs: list[Recording], truth: Bound, least: Bound) -> list[list[str]]:
    """Return a row for each mode, of the records in which as many modes as there are were found."""
    found = [modes for run in runs if len(modes := cov_ssi(run).modes) == len(truth.natural_frequency)]
    rows = []
    for k, (f, xi) in enumerate(zip(truth.natural_frequency, truth.damping_ratio, strict=True)):
        values = np.array([[modes.natural_frequency[k], modes.damping_ratio[k]] for modes in found])
        stds = np.array([[modes.natural_frequency_std[k], modes.damping_ratio_std[k]] for modes in found])
        errors = values - [f, xi]
        scatter = values.std(axis=0, ddof=1)
        ratios = scatter / [least.natural_frequency[k], least.damping_ratio[k]]
        bias = errors.mean(axis=0) / scatter
        covered = (np.abs(errors) < 1.96 * stds).sum(axis=0)
        row = [name, str(k + 1), f"{len(found)} of {len(runs)}"]
        row += [f"{value:.2f}" for value in (*ratios, *bias)]
        rows.append([*row, share(int(covered[0]), len(found)), share(int(covered[1]), len(found))])
    return rows


if __name__ == "__main__":
    main()
