"""In which order the frames of a vehicle are worked up, whatever the order they come in."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from sprung.errors import FormatError
from sprung.link import decode

#: A frame in the store: boot, sequence number, payload.
Waiting = tuple[int, int, bytes]


@dataclass(slots=True)
class Stream:
    """Where the work on the frames of one vehicle stands.

    Parameters
    ----------
    contiguous
        For each boot the sequence number up to which all has come or is lost.
    dispatched
        For each boot the one up to which frames were given to a worker.
    done
        For each boot the one up to which the store has them as worked up.

    Notes
    -----
    Boots follow each other by number, and one that knows where the boot before ended waits for its frames: a box that
    was restarted goes on where it was. So every permutation of frames is worked up in the same order.
    """

    contiguous: dict[int, int] = field(default_factory=dict)
    dispatched: dict[int, int] = field(default_factory=dict)
    done: dict[int, int] = field(default_factory=dict)
    _previous: dict[int, tuple[int, int] | None] = field(default_factory=dict)

    def arrived(self, boot: int, contiguous: int) -> None:
        """Take note of what has come."""
        self.contiguous[boot] = max(contiguous, self.contiguous.get(boot, -1))

    def next_frames(
        self, pending: Callable[[int, int, int], Sequence[tuple[int, int, bytes]]], limit: int
    ) -> list[Waiting]:
        """Return the frames to work up next, of one boot.

        Parameters
        ----------
        pending
            Returns (sequence number, time, payload) of a boot after a sequence number, at most so many.
        limit
            Most frames.
        """
        for boot in sorted(self.contiguous):
            after = self.dispatched.get(boot, -1)
            if after >= self.contiguous[boot]:
                continue
            found = pending(boot, after, limit)
            if not found:
                self.dispatched[boot] = self.contiguous[boot]  # lost, all of them
                continue
            if not self._is_ready(boot, found[0][2]):
                continue
            return [(boot, seq, payload) for seq, _, payload in found]
        return []

    def finished(self, boot: int) -> list[tuple[int, int]]:
        """Return boots before one that were given to a worker whole, and their ends, where the store is behind."""
        return [
            (one, last)
            for one, last in self.contiguous.items()
            if one < boot and self.dispatched.get(one, -1) >= last > self.done.get(one, -1)
        ]

    def _is_ready(self, boot: int, first: bytes) -> bool:
        """Tell whether all frames of the boot before a boot were given to a worker."""
        if boot not in self._previous:
            try:
                self._previous[boot] = decode(first).previous
            except FormatError:
                self._previous[boot] = None
        before = self._previous[boot]
        return before is None or before[0] >= boot or self.dispatched.get(before[0], -1) >= before[1] - 1
