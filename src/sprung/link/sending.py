"""When to send, and which frames of a spool next: in order, a bounded number ahead of the acknowledgements."""

from collections import deque
from collections.abc import Callable, Iterator
from itertools import islice

from sprung.link.spool import Spool


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
        self._seconds = seconds
        self._clock = clock
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


class Sending:
    """Progress of sending a spool.

    Parameters
    ----------
    spool
        Spool with the frames.
    ahead
        Largest number of frames sent and not acknowledged.
    patience
        Time without any progress after which everything is sent again [s].

    Notes
    -----
    A broker that crashes may lose messages that it has confirmed. Only frames that the monitor acknowledged are removed
    from the spool; the others are sent again, in order, after a reconnection or `patience` without acknowledgement, and
    so are those that could not be read before.
    """

    def __init__(self, spool: Spool, *, ahead: int = 256, patience: float = 10.0) -> None:
        self._spool = spool
        self._ahead = ahead
        self._patience = patience
        self._under_way: deque[tuple[int, int]] = deque()
        self._position = (0, -1)
        self._last_progress = 0.0

    @property
    def n_under_way(self) -> int:
        """Frames sent and not acknowledged."""
        return len(self._under_way)

    def start_again(self, now: float) -> None:
        """Send everything again that is not acknowledged."""
        self._under_way.clear()
        self._position = (0, -1)
        self._last_progress = now

    def due(self, now: float) -> Iterator[tuple[int, int, bytes]]:
        """Yield boot, sequence number and payload of the frames to send now (`now`: any clock [s])."""
        # Also with nothing under way: a file that could not be read for a while may hold frames before the position.
        if now - self._last_progress > self._patience:
            self.start_again(now)
        boot, after = self._position
        room = self._ahead - len(self._under_way)
        for found_boot, seq, payload in islice(self._spool.frames(boot=boot, after=after), max(room, 0)):
            if not self._under_way:
                self._last_progress = now
            self._position = (found_boot, seq)
            self._under_way.append((found_boot, seq))
            yield found_boot, seq, payload

    def acknowledged(self, boot: int, seq: int, now: float) -> None:
        """Record that the monitor has all frames of a boot up to a sequence number."""
        self._spool.acknowledge(boot, seq)
        before = len(self._under_way)
        self._under_way = deque(frame for frame in self._under_way if frame[0] != boot or frame[1] > seq)
        if len(self._under_way) < before:
            self._last_progress = now
