"""Recognition of samples that were analysed before: a recording that is replayed again must not count twice."""

import hashlib
from collections.abc import Mapping
from typing import Any

import numpy as np

from sprung.link import Block, FrameBlock

#: Largest number of runs that are remembered, the last ones.
_MAX_RUNS = 2000
#: Fewest changes from sample to sample in a block that distinguishes measured noise from anything else.
_MIN_CHANGES = 32
#: Longest time between blocks of one run, in samples, and tolerance of a place in a run [s].
_TOLERANCE, _EPSILON = 2.5, 1e-3


class Repeats:
    """Remembers the runs of samples of a vehicle, and how far each was analysed.

    Notes
    -----
    A run is a stretch of samples without gap. It is recognised by its first block: channels, rate, samples, and the
    time where the sender knows it. Measured noise never repeats, so that a box whose clock restarts after each power
    cut loses nothing; a run that begins without noise (dead sensors) is never recognised.

    A run that was interrupted continues where it stopped.
    """

    def __init__(self) -> None:
        self._reached: dict[int, float] = {}
        self._run: int | None = None
        self._place = 0.0
        self._end: int | None = None
        self._repeated = 0.0

    @property
    def repeated(self) -> float:
        """Duration of the repetition that arrived last [s]; 0 after samples that are new."""
        return self._repeated

    @property
    def end(self) -> int | None:
        """Time after the last sample, UTC ns; None before the first."""
        return self._end

    def update(self, block: Block) -> bool:
        """Add a block, and return whether it was analysed before."""
        if not self._continues(block):
            self._run, self._place = _identity(block), 0.0
        duration = block.n_samples / block.sampling_rate + sum(gap.duration for gap in block.gaps)
        self._place += duration
        self._end = None if block.start is None else block.start + round(1e9 * duration)
        reached = 0.0 if self._run is None else self._reached.pop(self._run, 0.0)
        if self._run is not None:
            self._reached[self._run] = max(reached, self._place)
        if len(self._reached) > _MAX_RUNS:
            del self._reached[next(iter(self._reached))]
        is_repeated = self._place <= reached + _EPSILON
        self._repeated = self._repeated + duration if is_repeated else 0.0
        return is_repeated

    def forget(self) -> None:
        """Forget all runs: their samples count again."""
        self._reached = {}

    def state(self) -> dict[str, Any]:
        """Return everything that is needed to continue, as plain values."""
        return {
            "reached": self._reached,
            "run": self._run,
            "place": self._place,
            "end": self._end,
            "repeated": self._repeated,
        }

    @classmethod
    def from_state(cls, state: Mapping[str, Any]) -> "Repeats":
        """Return the memory that continues from a state."""
        repeats = cls()
        repeats._reached = {int(run): float(reached) for run, reached in state["reached"].items()}
        repeats._run, repeats._end = state["run"], state["end"]
        repeats._place, repeats._repeated = float(state["place"]), float(state["repeated"])
        return repeats

    def _continues(self, block: Block) -> bool:
        """Return whether a block follows the last one without gap."""
        if self._end is None or block.start is None:
            return False
        return abs(block.start - self._end) * block.sampling_rate <= _TOLERANCE * 1e9


def _identity(block: Block) -> int | None:
    """Return a number that identifies the first block of a run; None if it has too little noise."""
    samples = block.samples
    if np.count_nonzero(np.nan_to_num(np.diff(samples, axis=1))) < _MIN_CHANGES:
        return None
    is_known = block.frame.is_time_known if isinstance(block, FrameBlock) else block.start is not None
    names = tuple(channel.name for channel in block.channels)
    facts = repr((names, round(block.sampling_rate, 6), block.start if is_known else None))
    digest = hashlib.blake2b(facts.encode(), digest_size=8)
    digest.update(np.ascontiguousarray(samples, dtype="<f8").tobytes())
    return int.from_bytes(digest.digest(), "big")
