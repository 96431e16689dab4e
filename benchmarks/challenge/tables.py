"""Tables of scores, one for each task; a loss of 0 is perfect, that of silence is the price of knowing nothing."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from benchmarks.validation import share, table

Score = Mapping[str, Any]
KINDS = {"road": "road, nonlinear", "multibody": "road, multibody", "rail": "rail"}


def mean(values: Iterable[float], digits: int = 2) -> str:
    """Return a mean with its standard error."""
    numbers = np.array(list(values))
    if not numbers.size:
        return "-"
    error = f" ± {numbers.std(ddof=1) / np.sqrt(numbers.size):.{digits}f}" if numbers.size > 1 else ""
    return f"{numbers.mean():.{digits}f}{error}"


def tables(scores: Sequence[Score]) -> str:
    """Return the tables of all tasks that someone has entered."""
    parts = []
    for task, (title, rows) in {"modes": MODES, "corners": CORNERS, "lives": LIVES, "order": ORDER}.items():
        entered = [each for each in scores if each.get(task)]
        if entered:
            found = [row for each in entered for row in rows(each["entrant"], each[task])]
            found.sort(key=lambda row: list(KINDS.values()).index(row.get("lives", KINDS["road"])))
            head = list(found[0])
            parts.append(f"{title}\n\n" + table(head, [list(row.values()) for row in found]))
    return "\n".join(parts)


def _held(values: Iterable[bool | None]) -> str:
    """Return how many of the intervals that were stated hold the truth."""
    stated = [value for value in values if value is not None]
    return f"{sum(stated)} of {len(stated)}" if stated else "-"


def _mode_rows(entrant: str, cases: Score) -> list[dict[str, str]]:
    certified, found = (sum(case[key] for case in cases.values()) for key in ("certified", "found"))
    row = {"entrant": entrant, "modes found": f"{found} of {certified}"}
    row["spurious modes"] = str(sum(case["spurious"] for case in cases.values()))
    for key, words, unit in (
        ("frequency", "natural frequency", "%"),
        ("damping", "damping ratio", "percentage points"),
    ):
        row[f"{words}: loss [{unit}]"] = f"{sum(case[key] for case in cases.values()) / certified:.2f}"
        held = sum(case[f"{key}_held"] for case in cases.values())
        row[f"{words}: within the interval"] = share(held, found) if found else "-"
    return [row]


def _corner_rows(entrant: str, cases: Score) -> list[dict[str, str]]:
    row = {"entrant": entrant}
    for kind in ("spring", "damper", "tyre"):
        values = [value for case in cases.values() for value in case[kind]]
        row[f"{kind}s: loss [%]"] = mean((cost for cost, _, _ in values), 1)
        stated = [is_held for _, is_held, is_stated in values if is_stated]
        row[f"{kind}s: within the interval"] = share(sum(stated), len(stated)) if stated else "-"
    return [row]


def _life_rows(entrant: str, cases: Score) -> list[dict[str, str]]:
    rows = []
    for kind, words in KINDS.items():
        lives = [case for case in cases.values() if case["kind"] == kind]
        if not lives:
            continue
        changed = [case for case in lives if case["truth"] != "healthy"]
        healthy = [case for case in lives if case["truth"] == "healthy"]
        rows.append(
            {
                "lives": words,
                "entrant": entrant,
                "Brier score": mean(case["brier"] for case in lives),
                "log score [nats]": mean(case["log"] for case in lives),
                "part named": f"{sum(case['first'] == case['truth'] for case in changed)} of {len(changed)}",
                "healthy called changed": f"{sum(case['first'] != 'healthy' for case in healthy)} of {len(healthy)}",
                "wrong with over 90 %": str(
                    sum(case["first"] != case["truth"] and case["probability"] > 0.9 for case in lives)
                ),
                "size: loss [percentage points]": mean((case["change"] for case in changed), 1),
                "size: within the interval": _held(case["change_held"] for case in changed),
                "onset: loss [recordings]": mean((case["since"] for case in changed), 1),
                "onset: within the interval": _held(case["since_held"] for case in changed),
            }
        )
    return rows


def _order_rows(entrant: str, cases: Score) -> list[dict[str, str]]:
    return [{"entrant": entrant} | {f"{name}, Brier score of pairs": f"{cost:.3f}" for name, cost in cases.items()}]


MODES = ("#### Modes of certified records", _mode_rows)
CORNERS = ("#### Corner values", _corner_rows)
LIVES = ("#### Lives", _life_rows)
ORDER = ("#### Real recordings of known order", _order_rows)
