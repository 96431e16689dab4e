"""Heartbeats of the loops of a monitor: which of them still run, read from any thread."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Loop:
    """A loop that must keep running.

    Parameters
    ----------
    limit
        Longest time between two passes [s].
    trouble
        Sentence on what has stopped after that time, and what to do.
    """

    limit: float
    trouble: str


class Heartbeats:
    """Times since the last pass of each loop; from any thread.

    Parameters
    ----------
    loops
        Loops that must keep running, by name.
    clock
        Present time [s] of a monotonic clock.
    """

    def __init__(self, loops: Mapping[str, Loop], clock: Callable[[], float]) -> None:
        self._loops, self._clock = loops, clock
        self._last = dict.fromkeys(loops, clock())

    @property
    def ages(self) -> dict[str, float]:
        """Time since the last pass of each loop [s]."""
        now = self._clock()
        return {name: now - last for name, last in self._last.items()}

    @property
    def troubles(self) -> list[str]:
        """Sentence about each loop that has stopped."""
        return [
            f"{self._loops[name].trouble} (last pass {age:.0f} s ago)"
            for name, age in self.ages.items()
            if age > self._loops[name].limit
        ]

    def beat(self, name: str) -> None:
        """Record a pass of a loop."""
        self._last[name] = self._clock()
