"""The entrants of this repository: functions from the cases of a set to those of an entry.

Nobody is tuned: Sprung, pyOMA2 and koma are called as `benchmarks/certified` calls them, Sprung on lives as the
commands `sprung baseline` and `sprung diagnose` do. An entrant of another package needs nothing of this file.
"""

import contextlib
import io
import logging
import os
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.challenge.entry import CERTAIN
from benchmarks.challenge.score import DAMPING, HEALTHY_LIFE, NEAR, base_rates
from numpy.typing import NDArray

Array = NDArray[np.float64]
INTERVAL_95 = 1.96
#: Probability that the threshold on RMS gives to what it says, and standard deviations of ln RMS beyond which it says
#: that a life is not healthy.
SURE, THRESHOLD = 0.8, 3.0
PEER_ORDER, PEER_PERIODS, PEER_BLOCK_ROWS = 60, 2.0, (30, 60)


Cases = Mapping[str, Mapping[str, Any]]


def around(value: float, std: float) -> list[float]:
    """Return the 95 % interval of a normal estimate."""
    return [value - INTERVAL_95 * std, value + INTERVAL_95 * std]


def as_modes(frequency: Array, frequency_std: Array, damping: Array, damping_std: Array) -> list[dict[str, Any]]:
    """Return modes as an entry states them, with the intervals of silence where there is no standard deviation."""
    columns = zip(*(map(float, each) for each in (frequency, frequency_std, damping, damping_std)), strict=True)
    return [
        {
            "natural_frequency": around(f, f_std) if np.isfinite(f_std) else [f * (1 - NEAR), f * (1 + NEAR)],
            "damping_ratio": around(xi, xi_std) if np.isfinite(xi_std) else list(DAMPING),
        }
        for f, f_std, xi, xi_std in columns
    ]


def sprung(folder: Path, asked: Cases) -> dict[str, Any]:
    """Return what Sprung says by its default calls."""
    solve = {"modes": _sprung_modes, "corners": _sprung_corners, "lives": _sprung_life}
    found: dict[str, Any] = {
        task: {name: solve[task](folder, case) for name, case in _reported(task, cases)}
        for task, cases in asked.items()
        if task in solve
    }
    data = Path(os.environ.get("SPRUNG_DATA", "")) / "mtb_sst_rebound_clicks"
    if "order" in asked and "SPRUNG_DATA" in os.environ and data.exists():
        found["order"] = {name: _sprung_order(data, case) for name, case in asked["order"].items()}
    elif "order" in asked:
        print("order: left out, as SPRUNG_DATA names no folder with mtb_sst_rebound_clicks")
    return found


def _reported(task: str, cases: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    for name, case in cases.items():
        print(f"{task}: {name}", flush=True)
        yield name, case


def _recordings(folder: Path, case: Mapping[str, Any]) -> list[Any]:
    """Return the recordings of a case; where there is a vehicle file, it says what the channels are."""
    from sprung import Channel, Recording

    quantity, result = case.get("quantity", "acceleration"), []
    for name in case["files"]:
        with np.load(folder / name) as file:
            channels = tuple(Channel(str(each), "speed" if each == "speed" else quantity) for each in file["channels"])
            result.append(Recording(file["samples"].astype(float), float(file["sampling_rate"]), channels))
    return result


def _sprung_modes(folder: Path, case: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the modes of a record; a swing with friction has those between two turns."""
    from sprung import bounce, cov_ssi, read_vehicle

    recordings = _recordings(folder, case)
    if case["quantity"] == "displacement":
        fits = [fit for test in bounce(recordings).tests for fit in test.frictions if fit is not None]
        if fits:
            rows = [
                (fit.natural_frequency, fit.natural_frequency_std, fit.damping_ratio, fit.damping_ratio_std)
                for fit in fits
            ]
            return as_modes(*np.array(rows).T)
    vehicle = read_vehicle(folder / case["vehicle"]) if "vehicle" in case else None
    modes = cov_ssi(recordings, vehicle=vehicle).modes
    return as_modes(modes.natural_frequency, modes.natural_frequency_std, modes.damping_ratio, modes.damping_ratio_std)


def _sprung_corners(folder: Path, case: Mapping[str, Any]) -> dict[str, list[float]]:
    from sprung import read_vehicle
    from sprung.likelihood import fit_corners

    fit = fit_corners(_recordings(folder, case), read_vehicle(folder / case["vehicle"]))
    half = INTERVAL_95 * fit.log_ratios_std
    return {
        str(part): [float(value * np.exp(-width)), float(value * np.exp(width))]
        for part, value, width in zip(fit.components, fit.values, half, strict=True)
        if str(part) in case["parts"]
    }


def _sprung_life(folder: Path, case: Mapping[str, Any]) -> dict[str, Any]:
    """Return probabilities by the evidence of all hypotheses, and size and onset of the likeliest single part.

    The prior is that of the challenge for healthy or not, and that of Sprung for what a change may be; two parts or
    both of an axle count half for each, and a change that no part explains is left over.
    """
    from sprung import DataError, SprungError, diagnose, learn, read_vehicle
    from sprung.calibration import calibrated_if_imperfect, chosen_windows, usable_spectra
    from sprung.diagnosis import observe_window
    from sprung.diagnosis.hypotheses import log_prior

    vehicle, recordings = read_vehicle(folder / case["vehicle"]), _recordings(folder, case)
    taught = recordings[: case["learning"]]

    def observed(some: Sequence[Any], first: int = 0) -> list[Any]:
        starts = np.cumsum([0.0, *(each.duration for each in recordings)])[first:]
        return [observe_window(each, vehicle, time=float(start)) for each, start in zip(some, starts, strict=False)]

    try:
        seen = observed(taught)
        errors = [each.conditions.get("model_error", np.inf) for each in seen]
        spectra = usable_spectra([taught[k] for k in sorted(chosen_windows(len(taught)))], vehicle)
        try:
            calibration = calibrated_if_imperfect(spectra, vehicle, model_errors=errors)
        except DataError:
            calibration = None
        if calibration is not None:
            vehicle = calibration.vehicle
            seen = observed(taught)
        detection = diagnose(observed(recordings[len(taught) :], len(taught)), learn(seen)).detection
    except SprungError as error:
        print(f"  no answer: {error}")
        return {}
    if detection is None:
        return {}
    candidates = detection.candidates
    evidence = np.array([each.log_evidence for each in candidates])
    healthy = base_rates(case["parts"])[HEALTHY_LIFE]
    prior = np.exp(log_prior([each.hypothesis for each in candidates])) * (1 - healthy)
    weights = np.append(
        prior * np.exp(evidence - max(evidence.max(), 0.0)), healthy * np.exp(-max(evidence.max(), 0.0))
    )
    weights *= CERTAIN / weights.sum()
    parts = dict.fromkeys(case["parts"], 0.0)
    for weight, candidate in zip(weights, candidates, strict=False):
        changed = [str(part) for part in candidate.hypothesis.parts(tuple(seen[0].components))]
        for part in (each for each in changed if each in parts):
            parts[part] += float(weight) / len(changed)
    best = next(each for each in candidates if each.hypothesis.scope == "single")
    numbers = np.array(detection.times)
    first = case["learning"] + 1
    since = [first + int(np.searchsorted(numbers, time)) for time in best.onset_interval]
    return {"healthy": float(weights[-1]), "parts": parts, "change": best.interval, "since": since}


def _sprung_order(data: Path, case: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the probability of each pair from viscous damping ratios and their standard deviations."""
    from scipy.stats import norm

    from sprung import bounce, read

    fits = [bounce(read(data / name)).tests[-1].frictions[0] for name in case["files"]]
    known = [(name, fit) for name, fit in zip(case["parts"], fits, strict=True) if fit is not None]
    return [
        {
            "first": one,
            "second": other,
            "probability": float(
                np.clip(
                    norm.cdf((b.damping_ratio - a.damping_ratio) / np.hypot(a.damping_ratio_std, b.damping_ratio_std)),
                    1 - CERTAIN,
                    CERTAIN,
                )
            ),
        }
        for (one, a), (other, b) in combinations(known, 2)
    ]


def rms(folder: Path, asked: Cases) -> dict[str, Any]:
    """Return what a threshold on the RMS of each sensor says of lives, as alarms of simple monitors do.

    The mean of ln RMS over the watched recordings is compared with the learning ones; the corner of the sensor that
    differs most is named, its parts alike. It states neither size nor onset.
    """
    said: dict[str, Any] = {}
    for name, case in _reported("lives", asked.get("lives", {})):
        levels = []
        for file in case["files"]:
            with np.load(folder / file) as run:
                motion = run["samples"][[str(each).startswith("acc") for each in run["channels"]]]
                levels.append(np.log(motion.std(axis=1)))
        before, after = np.split(np.array(levels), [case["learning"]])
        spread = before.std(axis=0, ddof=1) * np.sqrt(1 / len(before) + 1 / len(after))
        distance = np.abs(after.mean(axis=0) - before.mean(axis=0)) / spread
        if distance.max() < THRESHOLD:
            said[name] = {"healthy": SURE}
            continue
        corner = ("front_left", "front_right", "rear_left", "rear_right")[int(np.argmax(distance[:4]))]
        own = [part for part in case["parts"] if part.startswith(corner)]
        said[name] = {"parts": {part: SURE / len(own) for part in own}}
    return {"lives": said} if said else {}


def pyoma2(folder: Path, asked: Cases) -> dict[str, Any]:
    """Return the modes of pyOMA2's clustering `Neu`; intervals are the spread of the poles of each cluster."""
    from benchmarks.peers import pyoma_ssi

    def identify(samples: Array, rate: float, block_rows: int) -> list[dict[str, Any]]:
        from pyoma2.algorithms.data.run_params import Clustering

        algorithm, _ = pyoma_ssi(samples, rate, block_rows=block_rows, max_order=PEER_ORDER)
        algorithm.add_clustering(Clustering(name="Neu", quick="Neu"))
        with contextlib.redirect_stdout(io.StringIO()):
            algorithm.run_clustering("Neu")
        found = algorithm.result.clustering_results["Neu"]
        clusters = [np.asarray(found.labels) == label for label in range(len(found.Fn))]
        spread = np.array([[np.std(found.Fn_fl[own]), np.std(found.Xi_fl[own])] for own in clusters])
        return as_modes(np.asarray(found.Fn), spread[:, 0], np.asarray(found.Xi), spread[:, 1])

    return _peer(folder, asked, identify)


def koma(folder: Path, asked: Cases) -> dict[str, Any]:
    """Return the modes of koma's clusters; intervals are the spread of the poles of each cluster."""
    from benchmarks.peers import koma_ssi, koma_stable

    def identify(samples: Array, rate: float, block_rows: int) -> list[dict[str, Any]]:
        from koma.clustering import PoleClusterer, group_clusters

        poles = koma_ssi(samples, rate, block_rows=block_rows, orders=np.arange(2, PEER_ORDER + 1, 2))
        stable, shapes, orders = koma_stable(*poles, n_levels=2)
        damping, omega, *_ = group_clusters(*PoleClusterer(stable, shapes, orders).postprocess())
        centres, spreads = (
            [np.array([of(each) for each in some]) for some in (omega, damping)] for of in (np.median, np.std)
        )
        return as_modes(centres[0] / (2 * np.pi), spreads[0] / (2 * np.pi), centres[1], spreads[1])

    return _peer(folder, asked, identify)


def _peer(folder: Path, asked: Cases, identify: Callable[[Array, float, int], list[dict[str, Any]]]) -> dict[str, Any]:
    """Return the modes of all records; block rows reach over two periods of the lowest mode, as the manifest has it."""
    logging.disable(logging.CRITICAL)
    found: dict[str, Any] = {}
    for name, case in _reported("modes", asked.get("modes", {})):
        runs = []
        for file in case["files"]:
            with np.load(folder / file) as run:
                runs.append(run["samples"][[each != "speed" for each in run["channels"]]].astype(float))
        block_rows = int(np.clip(round(PEER_PERIODS * case["sampling_rate"] / case["lowest"]), *PEER_BLOCK_ROWS))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                found[name] = identify(np.concatenate(runs, axis=1), case["sampling_rate"], block_rows)
            except (TypeError, ValueError, IndexError, AttributeError, np.linalg.LinAlgError) as error:
                print(f"  ended with an error: {type(error).__name__}: {error}")
    return {"modes": found} if found else {}


ENTRANTS: dict[str, Callable[[Path, Cases], dict[str, Any]]] = {
    "sprung": sprung,
    "pyoma2": pyoma2,
    "koma": koma,
    "rms": rms,
}
