"""Heartbeats of the loops of a monitor: which of them still turn, read from any thread."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Loop:
    """A loop that must turn.

    Parameters
    ----------
    limit
        Longest time between two turns [s].
    trouble
        What stands still after it, and what to do.
    """

    limit: float
    trouble: str


class Heartbeats:
    """Times since loops last turned; from any thread.

    Parameters
    ----------
    loops
        Loops that must turn, by name.
    clock
        Present time [s] of any clock that only goes forward.
    """

    def __init__(self, loops: Mapping[str, Loop], clock: Callable[[], float]) -> None:
        self._loops, self._clock = loops, clock
        self._last = dict.fromkeys(loops, clock())

    @property
    def ages(self) -> dict[str, float]:
        """Time since the last turn of each loop [s]."""
        now = self._clock()
        return {name: now - last for name, last in self._last.items()}

    @property
    def troubles(self) -> list[str]:
        """Sentence about each loop that stands still."""
        return [
            f"{self._loops[name].trouble} (for {age:.0f} s)"
            for name, age in self.ages.items()
            if age > self._loops[name].limit
        ]

    def beat(self, name: str) -> None:
        """Record that a loop turned."""
        self._last[name] = self._clock()
