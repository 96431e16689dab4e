"""The one source of chance of a world, and the record of what happened in it."""

import hashlib
from collections import Counter
from collections.abc import Callable
from random import Random

#: Probability of each fault at each occasion for it, before a seed makes it rarer, more frequent or impossible.
RATES = {
    "message lost": 0.05,
    "message doubled": 0.05,
    "message overtaken": 0.2,
    "connection lost": 0.006,
    "connection silently cut": 0.006,
    "broker crashes": 0.004,
    "box killed at a call": 0.004,
    "box loses power at a call": 0.004,
    "box killed": 0.005,
    "box loses power": 0.005,
    "box stopped": 0.004,
    "disk of a box full": 0.004,
    "disk of a box read-only": 0.002,
    "call to the disk fails": 0.01,
    "write is short": 0.02,
    "sync fails": 0.015,
    "monitor killed at a statement": 0.0015,
    "monitor killed at a commit": 0.008,
    "monitor killed after a commit": 0.008,
    "monitor killed": 0.005,
    "monitor killed as it publishes": 0.002,
    "store full": 0.002,
    "store busy": 0.002,
    "store read-only": 0.001,
    "store fails to read or write": 0.002,
    "commit done but reported as failed": 0.005,
    "disk of the store short": 0.002,
    "worker dies": 0.02,
    "worker of others dies": 0.01,
    "worker is slow": 0.1,
    "vehicle moves to another worker": 0.02,
    "frame cannot be analysed": 0.002,
    "sender refuses": 0.1,
    "sender takes a message and fails": 0.05,
    "monitor killed as it sends": 0.02,
}
#: Besides these, where a second monitor stands by and clocks are set.
TAKEOVERS = {"reservation lost": 0.01, "reservation lost at once": 0.03, "clock set": 0.01}
#: How far a clock is set [s].
_STEP = 7200.0


class Crash(BaseException):
    """The end of a simulated process, which no code may catch."""


class Chance:
    """Decides by a seed what goes wrong, and keeps a digest of all that happened.

    Parameters
    ----------
    seed
        Seed of all that is random.
    rates
        Probability of each fault, as `RATES`.
    on_line
        Function that receives each line of the trace.
    """

    def __init__(self, seed: int, *, rates: dict[str, float], on_line: Callable[[str], None] | None = None) -> None:
        self.random = Random(seed)
        # Some kinds of faults are absent, or frequent: all of them at once would hide what two of them do together.
        self.rates = {kind: min(0.5, rate * self.random.choice((0, 0.3, 1, 1, 3))) for kind, rate in rates.items()}
        self.counts: Counter[str] = Counter()
        self.is_on = True
        self.now = 0.0
        self._errors: dict[str, float] = {}
        self._poisoned: dict[bytes, bool] = {}
        self._on_line = on_line
        self._digest = hashlib.blake2b(digest_size=8)

    @property
    def digest(self) -> str:
        """Digest of all lines so far."""
        return self._digest.hexdigest()

    def happens(self, fault: str, where: str = "") -> bool:
        """Return whether a fault happens on this occasion."""
        if not self.is_on or self.random.random() >= self.rates[fault]:
            return False
        self.counts[fault] += 1
        self.note(f"FAULT {fault}", where)
        return True

    def clock(self, where: str) -> float:
        """Return the time of a process by its own clock [s]."""
        return self.now + self._errors.get(where, 0.0)

    def set_clock(self, where: str) -> None:
        """Let the clock of a process step, perhaps."""
        if self.happens("clock set", where):
            self._errors[where] = self.random.uniform(-_STEP, _STEP)

    def is_poisoned(self, payload: bytes, where: str) -> bool:
        """Return whether a frame cannot be analysed, whenever it is tried."""
        if payload not in self._poisoned:
            self._poisoned[payload] = self.happens("frame cannot be analysed", where)
        return self._poisoned[payload]

    def note(self, what: str, where: str = "") -> None:
        """Record what happened."""
        line = f"{self.now:9.2f}  {where:8} {what}"
        self._digest.update(line.encode())
        if self._on_line is not None:
            self._on_line(line)
