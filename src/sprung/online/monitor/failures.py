"""What the monitor does about failures: of the analysis, of attempts, of the store and of its own loops."""

import logging
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeVar

from sprung.link import Every
from sprung.online.store import RefusedError, StoreError

T = TypeVar("T")

LOG = logging.getLogger("sprung.monitor")

#: Longest time between attempts [s].
_LONGEST_WAIT = 300.0
#: Time for which intake stops after the store could not write [s].
_PAUSE = 2.0
#: Failures in one place after which its frame is quarantined.
_MAX_FAILURES = 2


@dataclass(slots=True)
class Failures:
    """Failures of the analysis of a vehicle: in a row, and since its last stored state.

    Parameters
    ----------
    in_row
        Number of failures in a row.
    retry_at
        Time of the next attempt on a monotonic clock [s].
    place
        Boot and sequence number of the frame of the last failure.
    count
        Number of failures there in a row.
    left_out
        Boot and sequence number of the last frame that was quarantined; None: none was.

    Notes
    -----
    The next attempt is made at once after the first failure, and then after 1, 2, 4 .. 300 s.

    A frame on which the analysis fails twice is quarantined. If a later frame fails before a state is stored, it is the
    window that cannot be analysed, and its frames are quarantined. A failure on an earlier one, which is analysed
    again, is a first failure.
    """

    in_row: int = 0
    retry_at: float = -math.inf
    place: tuple[int, int] = (-1, -1)
    count: int = 0
    left_out: tuple[int, int] | None = None

    def fail(self, now: float) -> int:
        """Postpone the next attempt, and return the number of failures in a row."""
        self.in_row += 1
        self.retry_at = now + (min(2.0 ** min(self.in_row - 2, 30), _LONGEST_WAIT) if self.in_row > 1 else 0.0)
        return self.in_row

    def succeed(self) -> None:
        """Allow the next attempt at once."""
        self.in_row = 0
        self.retry_at = -math.inf

    def fail_on(self, boot: int, seq: int, *, done: int) -> int | None:
        """Record a failure on a frame.

        Parameters
        ----------
        boot, seq
            Boot and sequence number of the frame.
        done
            Sequence number of the last frame of the boot that the stored state covers.

        Returns
        -------
        int or None
            First sequence number of those to quarantine, which end at the frame; None: it is tried again.
        """
        self.count = self.count + 1 if (boot, seq) == self.place else 1
        self.place = boot, seq
        if self._is_of_window:
            return done + 1
        return seq if self.count >= _MAX_FAILURES else None

    def leave_out(self) -> None:
        """Record that the store has quarantined what `fail_on` returned."""
        if self._is_of_window:
            self.forget_frames()
        else:
            self.left_out = max(self.place, self.left_out or self.place)

    def forget_frames(self) -> None:
        """Forget on which frames it failed, as a state was stored."""
        self.place = (-1, -1)
        self.count = 0
        self.left_out = None

    @property
    def _is_of_window(self) -> bool:
        """Whether the last failure is behind a frame that was quarantined."""
        return self.left_out is not None and self.place > self.left_out


class CircuitBreaker:
    """Stops intake for two seconds after each error of the store, and while the disk is too full.

    Parameters
    ----------
    clock
        Present time [s] of a monotonic clock.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._pause = Every(_PAUSE, clock)
        self._error = ""
        self._shortage = ""

    @property
    def allows_work(self) -> bool:
        """Whether work may be taken in; results that cannot be stored would have to be computed again."""
        return self._pause.is_due and not self._shortage

    @property
    def problem(self) -> str:
        """Reason why the store cannot be used; empty if it can."""
        return self._shortage or self._error

    def refuse(self, error: StoreError) -> None:
        """Record an error of the store, and stop intake for a while."""
        if str(error) != self._error:
            LOG.error(str(error))
        self._error = str(error)
        self._pause.start()

    def succeed(self) -> None:
        """Record that the store has written."""
        self._error = ""

    def set_shortage(self, sentence: str) -> None:
        """Stop intake while disk space is short, as `sentence` states; empty if it is not."""
        self._shortage = sentence

    def call(self, act: Callable[[], T]) -> T | None:
        """Return the result of a function that needs the store; None, and stop intake, if the store cannot write."""
        try:
            return act()
        except RefusedError as error:  # the store itself is sound
            LOG.error(str(error))
            return None
        except StoreError as error:
            self.refuse(error)
            return None


@dataclass(frozen=True, slots=True)
class Loop:
    """A loop that must keep running.

    Parameters
    ----------
    limit
        Longest time between two passes [s].
    problem
        Sentence on what has stopped after that time, and what to do.
    """

    limit: float
    problem: str


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
        self._loops = loops
        self._clock = clock
        self._last = dict.fromkeys(loops, clock())

    @property
    def ages(self) -> dict[str, float]:
        """Time since the last pass of each loop [s]."""
        now = self._clock()
        return {name: now - last for name, last in self._last.items()}

    @property
    def problems(self) -> list[str]:
        """Sentence about each loop that has stopped."""
        return [
            f"{self._loops[name].problem} (last pass {age:.0f} s ago)"
            for name, age in self.ages.items()
            if age > self._loops[name].limit
        ]

    def on_heartbeat(self, name: str) -> None:
        """Record a pass of a loop."""
        self._last[name] = self._clock()
