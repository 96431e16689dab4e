"""Proper scores of an entry: whoever states what he believes has the best score that he can expect.

Probabilities have the Brier score (sum over all outcomes of (probability - 1 or 0)^2) and the logarithmic score (-ln of
the probability of what is true), 95 % intervals the interval score: width + 2 / 0.05 times the distance by which the
true value is outside [1, section 6.2]. All are losses, 0 is perfect. What an entry leaves out is scored as the base
rates are, which the README states: silence has a price that all know, and a wrong statement costs more than it.

[1] T. Gneiting, A. E. Raftery, Strictly proper scoring rules, prediction, and estimation, Journal of the American
Statistical Association 102 (2007) 359-378; R. L. Winkler, A decision-theoretic approach to interval estimation, the
same journal 67 (1972) 187-191.
"""

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np
from benchmarks.challenge.entry import Entry, Life, Mode
from benchmarks.challenge.make import HEALTHY, LOSSES, SCATTER

LEVEL = 0.95
#: Largest distance of a reported frequency from that of the mode it is matched with, relative.
NEAR = 0.05
#: Damping ratios that are thinkable of a mode of which an entry says nothing.
DAMPING = (0.0, 0.3)
HEALTHY_LIFE = "healthy"


def interval_score(interval: tuple[float, float], value: float, *, level: float = LEVEL) -> float:
    """Return the interval score, in the unit of the value."""
    low, high = interval
    outside = max(low - value, value - high, 0.0)
    return high - low + 2 / (1 - level) * outside


def brier(probabilities: Mapping[str, float], outcome: str) -> float:
    """Return the Brier score of the probabilities of all outcomes."""
    return sum((p - (name == outcome)) ** 2 for name, p in probabilities.items())


def log_score(probabilities: Mapping[str, float], outcome: str) -> float:
    """Return the logarithmic score [nats]."""
    return float(-np.log(probabilities[outcome]))


def base_rates(parts: Sequence[str]) -> dict[str, float]:
    """Return the probabilities before any recording: healthy, and each part alike."""
    return {HEALTHY_LIFE: HEALTHY} | dict.fromkeys(parts, (1 - HEALTHY) / len(parts))


def probabilities(life: Life, parts: Sequence[str]) -> dict[str, float]:
    """Return the probabilities of all outcomes of a life; what the entry leaves is spread by base rates."""
    stated = {HEALTHY_LIFE: life.healthy} | life.parts
    rest = 1 - sum(stated.values())
    return {name: stated.get(name, 0.0) + rest * rate for name, rate in base_rates(parts).items()}


def usual_change() -> tuple[float, float]:
    """Return the interval of the change of a changed part before any recording: its logarithm is uniform."""
    low, high = np.log(LOSSES)
    tail = (1 - LEVEL) / 2 * (high - low)
    return -float(np.exp(high - tail)), -float(np.exp(low + tail))


def usual_value(file: float) -> tuple[float, float]:
    """Return the interval of a part in the task of corner values before any recording."""
    half = 1.96 * SCATTER
    return file * float(np.exp(-half)), file * float(np.exp(half))


def score_life(life: Life, truth: Mapping[str, Any]) -> dict[str, Any]:
    """Return the scores of a life; those of size and onset are of changed ones only."""
    outcome = truth["part"] or HEALTHY_LIFE
    said = probabilities(life, truth["parts"])
    first = max(said, key=said.__getitem__)
    result = {
        "kind": truth["kind"],
        "brier": brier(said, outcome),
        "log": log_score(said, outcome),
        "truth": outcome,
        "first": first,
        "probability": said[first],
    }
    if truth["part"]:
        asked = {
            "change": (life.change or usual_change(), truth["change"], 100.0),
            "since": (life.since or tuple(truth["onsets"]), truth["since"], 1.0),
        }
        for name, (interval, value, unit) in asked.items():
            result[name] = unit * interval_score(interval, value)
            result[f"{name}_held"] = interval[0] <= value <= interval[1] if getattr(life, name) else None
    return result


def score_modes(modes: Sequence[Mode], truth: Mapping[str, Any]) -> dict[str, Any]:
    """Return the scores of a record: of natural frequencies [% of the true one], of damping ratios [percentage points].

    A certified mode that no reported one is near to costs as much as intervals of +-5 % and of 0 to 30 %, and so does a
    reported mode near to none; those of `optional_modes` may be reported or not.
    """
    near = sorted(
        (abs(np.mean(mode.natural_frequency) / certified["natural_frequency"] - 1), j, k)
        for j, certified in enumerate(truth["modes"])
        for k, mode in enumerate(modes)
    )
    pairs: dict[int, int] = {}
    for distance, j, k in near:
        if distance <= NEAR and j not in pairs and k not in pairs.values():
            pairs[j] = k
    optional = [certified["natural_frequency"] for certified in truth["optional_modes"]]
    spurious = [
        k
        for k, mode in enumerate(modes)
        if k not in pairs.values() and all(abs(np.mean(mode.natural_frequency) / f - 1) > NEAR for f in optional)
    ]
    silence = {"frequency": 200 * NEAR, "damping": 100 * (DAMPING[1] - DAMPING[0])}
    result: dict[str, Any] = {"certified": len(truth["modes"]), "found": len(pairs), "spurious": len(spurious)}
    for name, key in (("frequency", "natural_frequency"), ("damping", "damping_ratio")):
        matched = [(getattr(modes[k], key), truth["modes"][j][key]) for j, k in pairs.items()]
        costs = [100 * interval_score(at, value) / (value if name == "frequency" else 1.0) for at, value in matched]
        n_silent = len(truth["modes"]) - len(pairs) + len(spurious)
        result[name] = sum(costs) + n_silent * silence[name]
        result[f"{name}_held"] = sum(low <= value <= high for (low, high), value in matched)
    return result


def score_corners(values: Mapping[str, tuple[float, float]], truth: Mapping[str, Any]) -> dict[str, list[Any]]:
    """Return the scores of each kind of part [% of the true value], and whether the intervals hold."""
    result: dict[str, list[Any]] = {}
    for part, known in truth["parts"].items():
        low, high = values.get(part) or usual_value(known["file"])
        cost = 100 * interval_score((low, high), known["value"]) / known["value"]
        result.setdefault(part.rpartition(".")[2], []).append((cost, low <= known["value"] <= high, part in values))
    return result


def score_order(stated: Mapping[tuple[str, str], float], order: Sequence[str]) -> float:
    """Return the mean Brier score of all pairs of recordings with a known order; 0.5 is that of silence."""
    costs = []
    for less, more in combinations(order, 2):
        p = stated.get((less, more), 1 - stated.get((more, less), 0.5))
        costs.append(2 * (1 - p) ** 2)
    return float(np.mean(costs))


def score_entry(entry: Entry, truth: Mapping[str, Any]) -> dict[str, Any]:
    """Return the scores of every case of a set; an entry without any case of a task is not scored in it."""
    result: dict[str, Any] = {"schema": "sprung.challenge-score/1", "entrant": entry.entrant}
    if entry.modes:
        result["modes"] = {
            name: score_modes(entry.modes.get(name, []), known) for name, known in truth["modes"].items()
        }
    if entry.corners:
        result["corners"] = {
            name: score_corners(entry.corners.get(name, {}), known) for name, known in truth["corners"].items()
        }
    if entry.lives:
        result["lives"] = {
            name: score_life(entry.lives.get(name, Life()), known) for name, known in truth["lives"].items()
        }
    if entry.order:
        result["order"] = {
            name: score_order(
                {(pair.first, pair.second): pair.probability for pair in pairs}, truth["order"][name]["parts"]
            )
            for name, pairs in entry.order.items()
        }
    return result
