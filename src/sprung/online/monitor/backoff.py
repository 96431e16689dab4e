"""Increasing waits between attempts after failures."""

from collections.abc import Callable

#: Longest time between attempts [s].
_LONGEST = 300.0


class Backoff:
    """Delays further attempts: not after the first failure, then by 1, 2, 4 .. 300 s.

    Parameters
    ----------
    timer
        Present time [s] of a monotonic clock.
    """

    def __init__(self, timer: Callable[[], float]) -> None:
        self._timer = timer
        self._n_failures: dict[str, int] = {}
        self._until: dict[str, float] = {}

    @property
    def n_waiting(self) -> int:
        """Number of names that failed more than once in a row."""
        return sum(number > 1 for number in list(self._n_failures.values()))

    def is_due(self, name: str) -> bool:
        """Return whether the next attempt may be made."""
        return name not in self._until or self._timer() >= self._until[name]

    def fail(self, name: str) -> int:
        """Record a failure, and return the number of failures in a row."""
        number = self._n_failures[name] = self._n_failures.get(name, 0) + 1
        wait = min(2.0 ** min(number - 2, 30), _LONGEST) if number > 1 else 0.0
        self._until[name] = self._timer() + wait
        return number

    def succeed(self, name: str) -> None:
        """Record a success."""
        self._n_failures.pop(name, None)
        self._until.pop(name, None)
