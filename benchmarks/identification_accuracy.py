"""Accuracy and automatic selection on the 3-DOF chain: `python benchmarks/identification_accuracy.py`."""

import argparse
import json
import logging
import os
import time
import warnings
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from measuring import ONE_THREAD, print_circumstances, print_table

os.environ.update(ONE_THREAD, TQDM_DISABLE="1")

import numpy as np
from chain_bound import chain_bound
from numpy.typing import NDArray
from peers import PYOMA_PRESETS, koma_modes, koma_ssi, koma_stable, pyoma_modes, pyoma_ssi

from sprung.identification import cov_ssi
from sprung.recording import Recording
from sprung.simulation import simulate, usual_excitation
from sprung.vehicles import chain

Array = NDArray[np.float64]
SAMPLING_RATE, DURATION = 500.0, 60.0
#: Block rows (the thesis' largest) and largest order for the peers, which have no defaults for them.
PEER_ROWS, PEER_ORDER = 45, 60
#: The preset of pyOMA2 that selects best here, run on all records.
BEST_PRESET = "Neu"
#: A mode found counts as one of the chain's if it is as near as this.
NEAR = 0.05
TRUTH = chain().modes()


@dataclass(frozen=True)
class Condition:
    """Noise, and the number of records identified together."""

    name: str
    snr: float
    noise_band: tuple[float, float] | None = None
    n_records: int = 1


CONDITIONS = (
    Condition("SNR 10, white", 10.0),
    Condition("SNR 0.5, white", 0.5),
    Condition("20 records, SNR 0.5, noise 0.5..50 Hz", 0.5, (0.5, 50.0), 20),
)


@dataclass(frozen=True)
class Found:
    """What one estimator found in one record: rows of frequency, damping and their standard deviations."""

    modes: Array

    @property
    def is_exact(self) -> bool:
        """Exactly the chain's modes."""
        return self.modes.shape[1] == len(TRUTH.natural_frequency) and self.nearest is not None

    @property
    def nearest(self) -> Array | None:
        """The found mode nearest to each of the chain's; None if one is missing."""
        if not self.modes.shape[1]:
            return None
        distance = np.abs(self.modes[0] / TRUTH.natural_frequency[:, None] - 1)
        best = np.argmin(distance, axis=1)
        if np.any(distance[np.arange(len(best)), best] > NEAR) or len(set(best)) < len(best):
            return None
        return self.modes[:, best]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--records", type=int, default=200, help="records of each condition")
    parser.add_argument("--sets", type=int, default=40, help="sets of 20 records")
    parser.add_argument("--peer-records", type=int, default=20, help="records for the slow presets of pyOMA2")
    parser.add_argument("--processes", type=int, default=os.cpu_count())
    parser.add_argument("--without-peers", action="store_true")
    parser.add_argument("--json", type=Path, help="file for the counts")
    arguments = parser.parse_args()
    print_circumstances()
    counts = {}
    with ProcessPoolExecutor(arguments.processes) as pool:
        for number, condition in enumerate(CONDITIONS):
            n_cases = arguments.records if condition.n_records == 1 else arguments.sets
            found = {"sprung, defaults": list(pool.map(partial(_sprung, number), range(n_cases), chunksize=4))}
            if not arguments.without_peers:
                found |= _found_by_peers(pool, number, n_cases, min(arguments.peer_records, n_cases))
            _print_selection(condition, found)
            if condition.noise_band is None:
                _print_accuracy(condition, found)
            counts[condition.name] = {name: _counted(cases) for name, cases in found.items()}
    if arguments.json:
        options = f"--records {arguments.records} --sets {arguments.sets} --peer-records {arguments.peer_records}"
        without = " --without-peers" if arguments.without_peers else ""
        command = f"python benchmarks/identification_accuracy.py {options}{without}"
        arguments.json.write_text(json.dumps({"command": command, "conditions": counts}, indent=1) + "\n")


def _found_by_peers(pool: ProcessPoolExecutor, number: int, n_cases: int, n_slow: int) -> dict[str, list[Found | None]]:
    found: dict[str, list[Found | None]] = {
        "koma, find_stable_poles and clusters": list(pool.map(partial(_koma, number), range(n_cases), chunksize=4))
    }
    if CONDITIONS[number].n_records > 1:
        n_cases = n_slow
    for preset in PYOMA_PRESETS:
        n = n_cases if preset == BEST_PRESET else n_slow
        found[f"pyOMA2, {preset}"] = list(pool.map(partial(_pyoma, number, preset), range(n)))
    return found


def _records(number: int, case: int) -> list[Recording]:
    """Simulate the records of one case; the same for every estimator."""
    condition, system = CONDITIONS[number], chain()
    return [
        simulate(
            system,
            usual_excitation(system),
            duration=DURATION,
            sampling_rate=SAMPLING_RATE,
            snr=condition.snr,
            noise_band=condition.noise_band,
            seed=np.random.default_rng((number, case, record)),
        )
        for record in range(condition.n_records)
    ]


def _joined(number: int, case: int) -> Array:
    """Return the samples of all records one after another: the peers take one record only."""
    return np.concatenate([record.samples for record in _records(number, case)], axis=1)


def _sprung(number: int, case: int) -> Found:
    modes = cov_ssi(_records(number, case)).modes
    return Found(
        np.array([modes.natural_frequency, modes.damping_ratio, modes.natural_frequency_std, modes.damping_ratio_std])
    )


def _koma(number: int, case: int) -> Found | None:
    poles = koma_ssi(_joined(number, case), SAMPLING_RATE, block_rows=PEER_ROWS, orders=np.arange(2, PEER_ORDER + 1, 2))
    return _attempt(lambda: koma_modes(*koma_stable(*poles, n_levels=2)))


def _pyoma(number: int, preset: str, case: int) -> Found | None:
    logging.disable(logging.CRITICAL)
    algorithm, _ = pyoma_ssi(_joined(number, case), SAMPLING_RATE, block_rows=PEER_ROWS, max_order=PEER_ORDER)
    return _attempt(lambda: pyoma_modes(algorithm, preset))


def _attempt(select: Callable[[], tuple[Array, Array]]) -> Found | None:
    """Return what a peer selects, None where it fails with an error of its own."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            frequency, damping = select()
        except (TypeError, ValueError, IndexError, AttributeError):
            return None
    return Found(np.array([np.atleast_1d(frequency), np.atleast_1d(damping)]))


def _counted(cases: list[Any]) -> dict[str, Any]:
    """Return how many records gave exactly the chain's modes, and how many 95 % intervals hold the truth."""
    truth = np.array([TRUTH.natural_frequency, TRUTH.damping_ratio])
    near = [case.nearest for case in cases if case is not None and case.nearest is not None]
    intervals = np.array([each for each in near if len(each) == 4])
    counted: dict[str, Any] = {
        "records": len(cases),
        "exactly_the_modes": sum(case is not None and case.is_exact for case in cases),
    }
    if len(intervals):
        held = np.abs(intervals[:, :2] - truth) < 1.96 * intervals[:, 2:]
        counted |= {"intervals": int(held[:, 0].size), "intervals_held": [int(n) for n in held.sum(axis=(0, 2))]}
    return counted


def _print_selection(condition: Condition, found: dict[str, list[Any]]) -> None:
    rows = []
    for name, cases in found.items():
        counts = [case.modes.shape[1] for case in cases if case is not None]
        exact = sum(case is not None and case.is_exact for case in cases)
        spread = f"{min(counts)} to {max(counts)}" if counts else "-"
        rows.append([name, f"{exact} of {len(cases)}", spread, str(len(cases) - len(counts))])
    print_table(
        f"{condition.name}: automatic selection", ["what", "exactly the three", "modes", "ended in an error"], rows
    )


def _print_accuracy(condition: Condition, found: dict[str, list[Any]]) -> None:
    bound = chain_bound(snr=condition.snr, duration=DURATION, sampling_rate=SAMPLING_RATE)
    truth = np.array([TRUTH.natural_frequency, TRUTH.damping_ratio])
    least = np.array([bound.natural_frequency, bound.damping_ratio])
    rows = []
    for name, cases in found.items():
        near = [case.nearest for case in cases if case is not None and case.nearest is not None]
        if len(near) < 100:
            continue
        values = np.array(near)
        estimates = values[:, :2]
        ratios = estimates.std(axis=0, ddof=1) / least
        bias = (estimates.mean(axis=0) - truth) / least
        row = [name, str(len(near)), _triple(ratios[0]), _triple(ratios[1]), _triple(bias[0]), _triple(bias[1])]
        if values.shape[1] == 4:
            covered = (np.abs(estimates - truth) < 1.96 * values[:, 2:]).mean(axis=0)
            row += [_triple(100 * covered[0], 1), _triple(100 * covered[1], 1)]
        else:
            row += ["-", "-"]
        rows.append(row)
    header = ["what", "records", "std f / bound", "std xi / bound", "bias f / bound", "bias xi / bound"]
    header += ["95 % covers f, %", "95 % covers xi, %"]
    print_table(f"{condition.name}: standard deviation over the Cramer-Rao bound, modes 1, 2, 3", header, rows)
    print(f"\nBound: f {_triple(least[0], 4)} Hz, xi {_triple(100 * least[1], 3)} %.")


def _triple(values: Array, digits: int = 2) -> str:
    return ", ".join(f"{value:.{digits}f}" for value in values)


if __name__ == "__main__":
    start = time.perf_counter()
    main()
    print(f"\nTook {time.perf_counter() - start:.0f} s.")
