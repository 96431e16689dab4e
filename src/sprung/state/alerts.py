"""The state of an alert: the facts behind it, read once."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from sprung.diagnosis import SEVERITIES, Hypothesis
from sprung.vehicles import Component

#: Times above this are counted from 1970 [s]: those of a recording without a date are not.
_DATED = 1e8


@dataclass(frozen=True, eq=False, slots=True)
class AlertState:
    """An alert with the facts of its finding. Times are UTC ns.

    Parameters
    ----------
    number, vehicle, cause
        Number of the alert, and what it is about: "front_left.spring", "sensor:acc_fl", "silent".
    is_of_suspension
        Whether the cause is a change of the suspension.
    severity, step
        Severity, 1 to 1000, and its step: note, low, medium, high or critical.
    state
        State in the terms of ISA-18.2.
    is_active, is_acknowledged
        Whether the cause holds now, and whether an operator has acknowledged it.
    raised, cleared, count
        Times when it last became active and inactive, and how often it became active.
    assignee, shelved_until
        Person responsible, and end of the shelving; None without.
    text
        Sentence for people, with the smallest detectable change where it is known.
    evidence
        Plain values behind the alert: the document of its finding and of the change test.
    """

    number: int
    vehicle: str
    cause: str
    is_of_suspension: bool
    severity: int
    step: str
    state: str
    is_active: bool
    is_acknowledged: bool
    raised: int
    cleared: int | None
    count: int
    assignee: str | None
    shelved_until: int | None
    text: str
    evidence: Mapping[str, Any] = field(default_factory=dict)

    @property
    def sentence(self) -> str:
        """The finding in plain words; without a finding, the text."""
        return str(self.evidence.get("sentence") or self.text)

    @property
    def change(self) -> float | None:
        """Relative change; None without a size."""
        return self.evidence.get("change")

    @property
    def interval(self) -> tuple[float, float] | None:
        """95 % interval of the change, in order; None without one."""
        ends = self.evidence.get("interval")
        low, high = sorted(map(float, ends)) if ends else (None, None)
        return None if low is None or high is None else (low, high)

    @property
    def onset(self) -> int | None:
        """Start of the change; None if it is unknown."""
        return time_of(self.evidence.get("since"))

    @property
    def onset_interval(self) -> tuple[int, int] | None:
        """Earliest and latest onset; None if they are unknown."""
        first, last = map(time_of, self.evidence.get("since_interval") or (None, None))
        return None if first is None or last is None else (first, last)

    @property
    def runner_up(self) -> str:
        """Second hypothesis in words; empty if it is far less likely."""
        return self.evidence.get("runner_up") or ""

    @property
    def advice(self) -> str:
        """What to do; empty without a finding."""
        return self.evidence.get("advice") or ""

    @property
    def urgency(self) -> str:
        """What to do, without a finding as findings of that severity state it."""
        by_step = {word: advice for _, word, _, advice in SEVERITIES}
        return self.advice or by_step.get(self.step, SEVERITIES[-1][3])

    @property
    def detectable(self) -> dict[str, float]:
        """Smallest detectable loss of each part in the change test behind it; empty if unknown."""
        return dict(self.evidence.get("detectable") or {})

    @property
    def place(self) -> tuple[str | None, str]:
        """Corner and part; None for a part that belongs to no corner."""
        if self.is_of_suspension:
            corner, _, part = self.cause.rpartition(".")
            return corner or None, part
        kind, _, channel = self.cause.partition(":")
        return None, f"sensor {channel}" if kind == "sensor" else "measuring box"

    def names(self, components: Sequence[Component]) -> tuple[Component, ...]:
        """Return those components that the cause names."""
        corner, dot, kind = self.cause.partition(".")
        return tuple(Hypothesis("", corner, kind).parts(tuple(components))) if dot else ()

    def as_entry(self) -> dict[str, Any]:
        """Return the alert as in `sprung.alerts/1`."""
        names = ("vehicle", "cause", "severity", "state", "raised", "count", "assignee", "shelved_until", "text")
        return {"number": self.number, **{name: getattr(self, name) for name in names}}


def time_of(seconds: Any) -> int | None:
    """Return a time of the windows' clock [s] as UTC ns; None if it does not count from 1970.

    Examples
    --------
    >>> time_of(600.0), time_of(1.79e9)
    (None, 1790000000000000000)
    """
    is_dated = isinstance(seconds, int | float) and seconds >= _DATED
    return round(seconds * 1e9) if is_dated else None
