"""Timer of periodic work."""

from collections.abc import Callable


class Every:
    """A timer that is due immediately, and again a fixed time after each start.

    Parameters
    ----------
    seconds
        Time from a start until it is due again [s].
    clock
        Present time [s] of any clock.

    Examples
    --------
    >>> times = iter([0.0, 9.0, 10.0])
    >>> timer = Every(10.0, lambda: next(times))
    >>> timer.is_due
    True
    >>> timer.start()
    >>> timer.is_due, timer.is_due
    (False, True)
    """

    def __init__(self, seconds: float, clock: Callable[[], float]) -> None:
        self._seconds, self._clock = seconds, clock
        self._started: float | None = None

    @property
    def started(self) -> float | None:
        """Time of the last start [s]; None if it was never started, or reset."""
        return self._started

    @property
    def is_due(self) -> bool:
        """Whether the time since the last start has passed."""
        return self._started is None or self._clock() - self._started >= self._seconds

    def start(self) -> None:
        """Count from now."""
        self._started = self._clock()

    def reset(self) -> None:
        """Make the timer due now."""
        self._started = None
