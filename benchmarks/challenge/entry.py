"""The format of an entry: one JSON document, checked with errors of one sentence."""

import json
import math
from collections.abc import Collection
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

#: Largest sum of the probabilities of a life or a pair: certainty would cost without limit where it is wrong.
CERTAIN = 0.999


def _rising(ends: tuple[float, float]) -> tuple[float, float]:
    low, high = ends
    if not (math.isfinite(low) and math.isfinite(high) and low <= high):
        raise ValueError(f"[{low:g}, {high:g}] is no interval: give its lower and then its upper end")
    return ends


#: Interval that holds the true value with a probability of 95 %: lower and upper end.
Interval = Annotated[tuple[float, float], AfterValidator(_rising)]
Probability = Annotated[float, Field(ge=0, le=CERTAIN)]


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Mode(_Part):
    """A mode of a certified record: natural frequency [Hz] and damping ratio."""

    natural_frequency: Interval
    damping_ratio: Interval


class Life(_Part):
    """Probabilities that a life is healthy and that each part has changed; what is left is spread by base rates.

    `change` is the relative change after the last recording (-0.2: a loss of a fifth), `since` the number of the first
    changed recording; both hold if the vehicle has changed, whichever its part.
    """

    healthy: Probability = 0.0
    parts: dict[str, Probability] = Field(default_factory=dict)
    change: Interval | None = None
    since: Interval | None = None


class Pair(_Part):
    """Probability that the first recording has less rebound damping than the second one."""

    first: str
    second: str
    probability: Annotated[float, Field(ge=1 - CERTAIN, le=CERTAIN)]


class Entry(_Part):
    """What one entrant says about a set; everything may be left out, and is then scored as base rates are."""

    schema_: Literal["sprung.challenge-entry/1"] = Field(alias="schema")
    entrant: Annotated[str, Field(min_length=1, max_length=60)]
    modes: dict[str, list[Mode]] = Field(default_factory=dict)
    corners: dict[str, dict[str, Interval]] = Field(default_factory=dict)
    lives: dict[str, Life] = Field(default_factory=dict)
    order: dict[str, list[Pair]] = Field(default_factory=dict)


class EntryError(ValueError):
    """An entry that cannot be scored, and why, in one sentence."""


def schema() -> dict[str, Any]:
    """Return the JSON schema of an entry."""
    return Entry.model_json_schema()


def parse_entry(document: object, cases: dict[str, Any]) -> Entry:
    """Return an entry whose cases and parts are those of a set (its manifest or its truth); raises `EntryError`."""
    try:
        entry = Entry.model_validate(document)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"])) or "the document"
        raise EntryError(f"{where}: {first['msg'].removeprefix('Value error, ').rstrip('.')}.") from error
    for task in ("modes", "corners", "lives", "order"):
        _known(task, getattr(entry, task), cases[task])
    for name, parts in entry.corners.items():
        _known(f"corners.{name}", parts, cases["corners"][name]["parts"])
    for name, life in entry.lives.items():
        _known(f"lives.{name}.parts", life.parts, cases["lives"][name]["parts"])
        total = life.healthy + sum(life.parts.values())
        if total > CERTAIN + 1e-9:
            raise EntryError(
                f"lives.{name}: the probabilities add up to {total:.4g}, but at most {CERTAIN} is allowed."
            )
    for name, pairs in entry.order.items():
        for number, pair in enumerate(pairs):
            _known(f"order.{name}.{number}", (pair.first, pair.second), cases["order"][name]["parts"])
    return entry


def _known(where: str, names: Collection[str], known: Collection[str]) -> None:
    for name in names:
        if name not in known:
            raise EntryError(f"{where}: {name!r} is none of {', '.join(known)}.")


def read_entry(path: Path, cases: dict[str, Any]) -> Entry:
    """Return the entry in a file; raises `EntryError`."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise EntryError(f"{path} cannot be read: {error.strerror}.") from error
    except ValueError as error:
        raise EntryError(f"{path.name} is no JSON document: {error}.") from error
    return parse_entry(document, cases)
