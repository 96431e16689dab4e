"""Order in which the frames of a vehicle are analysed, whatever the order of arrival, and which vehicle is next."""

from bisect import bisect_left, insort
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import islice
from typing import Protocol

from sprung.errors import FormatError
from sprung.link import Header, checked_map
from sprung.online.store import Cursor, StoredFrame

#: Largest number of boots that are read together: a box may have lost the frames of many.
_MOST_READS = 32
#: Largest size of the frames that are handed over without being read back, and of those of one vehicle [bytes].
_HELD, _HELD_OF_ONE = 1 << 26, 1 << 21


class Pending(Protocol):
    """Reads frames of one vehicle from the inbox."""

    def __call__(self, boot: int, *, after: int, limit: int) -> list[StoredFrame]:
        """Return the frames of a boot that follow a sequence number, at most `limit`."""


@dataclass(slots=True)
class Stream:
    """Progress of the frames of one vehicle.

    Parameters
    ----------
    contiguous
        Sequence number up to which every frame arrived or is lost, by boot.
    dispatched
        Sequence number up to which frames were given to a worker, by boot.
    done
        Sequence number up to which the store has the frames as analysed, by boot.

    Notes
    -----
    Boots follow each other by number, and a boot that states the end of the previous one waits for its frames, as a
    restarted box continues where it stopped. So every permutation of frames is analysed in the same order.
    """

    contiguous: dict[int, int] = field(default_factory=dict)
    dispatched: dict[int, int] = field(default_factory=dict)
    done: dict[int, int] = field(default_factory=dict)
    _previous: dict[int, tuple[int, int] | None] = field(default_factory=dict)

    @property
    def has_waiting(self) -> bool:
        """Whether frames wait for a worker."""
        return any(self.dispatched.get(boot, -1) < last for boot, last in self.contiguous.items())

    @property
    def backlog(self) -> int:
        """Number of frames that wait for a worker."""
        # Copies: figures are read in another thread.
        dispatched = dict(self.dispatched)
        return sum(last - dispatched.get(boot, -1) for boot, last in dict(self.contiguous).items())

    @property
    def position(self) -> tuple[int, int]:
        """Newest boot of which frames were given to a worker, and the last of them; boot 0 and -1 before the first."""
        boot = max((boot for boot, last in self.dispatched.items() if last >= 0), default=0)
        return boot, self.dispatched.get(boot, -1)

    def arrived(self, boot: int, contiguous: int) -> None:
        """Record that every frame of a boot up to a sequence number arrived or is lost."""
        self.contiguous[boot] = max(contiguous, self.contiguous.get(boot, -1))

    def complete(self, boot: int, seq: int) -> None:
        """Record that the store has the frames of a boot up to a sequence number as analysed."""
        self.dispatched[boot] = self.done[boot] = seq

    def rewind(self, cursors: Mapping[int, Cursor]) -> None:
        """Continue from the stored cursors."""
        self.done = {boot: cursors[boot].done for boot in self.contiguous}
        self.dispatched = dict(self.done)

    def next_frames(self, pending: Pending, limit: int) -> list[StoredFrame]:
        """Return the frames to analyse next, all of one boot.

        Parameters
        ----------
        pending
            Reads frames of the vehicle.
        limit
            Largest number of frames.

        Returns
        -------
        list
            Frames of one boot; empty if all wait for earlier frames, or if many boots turned out to be lost: later
            ones come at the next call.
        """
        waiting = (boot for boot, last in sorted(self.contiguous.items()) if self.dispatched.get(boot, -1) < last)
        for boot in islice(filter(self._is_ready, waiting), _MOST_READS):
            frames = pending(boot, after=self.dispatched.get(boot, -1), limit=limit)
            if not frames:
                self.dispatched[boot] = self.contiguous[boot]  # all of them are lost
                continue
            self._note_previous(frames[0])
            if self._is_ready(boot):
                return frames
        return []

    @property
    def awaited(self) -> dict[int, int]:
        """Boots of which others wait for more frames, and the number of frames that they had."""
        others = [previous for previous in self._previous.values() if previous is not None]
        return {boot: end for boot, end in others if self.contiguous.get(boot, -1) < end - 1}

    def covered(self, boot: int) -> list[tuple[int, int]]:
        """Return other boots whose frames the present state covers and the store does not, and the last of these."""
        others = [place for place in self.dispatched.items() if place[0] != boot]
        return [(other, last) for other, last in others if last > self.done.get(other, -1)]

    def _note_previous(self, first: StoredFrame) -> None:
        """Keep which boot comes before that of its first frame."""
        if first.boot not in self._previous:
            try:
                self._previous[first.boot] = Header.of(checked_map(first.payload)).previous
            except FormatError:
                self._previous[first.boot] = None

    def _is_ready(self, boot: int) -> bool:
        """Return whether all frames of the previous boot were given to a worker, if a frame stated that boot."""
        previous = self._previous.get(boot)
        return previous is None or previous[0] >= boot or self.dispatched.get(previous[0], -1) >= previous[1] - 1


class Handover:
    """Frames just stored, from where they are given to workers without being read back; bounded in size.

    Parameters
    ----------
    most_bytes
        Largest size of all payloads [bytes]; frames beyond it are read from the store.

    Notes
    -----
    Of several frames with one number the first counts, as in the store.
    """

    def __init__(self, most_bytes: int = _HELD) -> None:
        self._most = most_bytes
        self._frames: dict[str, dict[int, dict[int, StoredFrame]]] = {}
        self._sizes: dict[str, int] = {}
        self._size = 0

    @property
    def n_bytes(self) -> int:
        """Size of all payloads held."""
        return self._size

    def hold(self, frames: Iterable[StoredFrame]) -> None:
        """Hold frames that the store has."""
        for frame in frames:
            size, own = len(frame.payload), self._sizes.get(frame.vehicle, 0)
            of_boot = self._frames.setdefault(frame.vehicle, {}).setdefault(frame.boot, {})
            if frame.seq in of_boot or self._size + size > self._most or own + size > _HELD_OF_ONE:
                continue
            of_boot[frame.seq] = frame
            self._sizes[frame.vehicle] = own + size
            self._size += size

    def following(self, vehicle: str, boot: int, *, after: int, until: int, limit: int) -> list[StoredFrame]:
        """Return the unbroken run of frames that follows a sequence number, as far as it is held."""
        of_boot = self._frames.get(vehicle, {}).get(boot, {})
        run: list[StoredFrame] = []
        while len(run) < limit and after < until and after + 1 in of_boot:
            after += 1
            run.append(of_boot[after])
        return run

    def release(self, vehicle: str, boot: int, seq: int) -> None:
        """Forget the frames of a boot up to a sequence number, and of all boots before."""
        boots = self._frames.get(vehicle, {})
        for older in [number for number in boots if number <= boot]:
            for number in [number for number in boots[older] if older < boot or number <= seq]:
                size = len(boots[older].pop(number).payload)
                self._sizes[vehicle] -= size
                self._size -= size
            if not boots[older]:
                del boots[older]
        if not boots:
            self.forget(vehicle)

    def forget(self, vehicle: str) -> None:
        """Forget the frames of a vehicle, which the store has."""
        self._frames.pop(vehicle, None)
        self._size -= self._sizes.pop(vehicle, 0)


class Queue:
    """Vehicles that wait, the one that has waited longest first; of equal times, the first to arrive."""

    def __init__(self) -> None:
        self._places: dict[str, tuple[int, int]] = {}
        self._order: list[tuple[int, int, str]] = []
        self._count = 0

    def __iter__(self) -> Iterator[str]:
        return iter([vehicle for _, _, vehicle in self._order])

    def __contains__(self, vehicle: object) -> bool:
        return vehicle in self._places

    def add(self, vehicle: str, since: int) -> None:
        """Add a vehicle that waits since a time, unless it waits already."""
        if vehicle not in self._places:
            self._count += 1
            self._places[vehicle] = since, self._count
            insort(self._order, (since, self._count, vehicle))

    def remove(self, vehicle: str) -> None:
        """Remove a vehicle, if it waits."""
        place = self._places.pop(vehicle, None)
        if place is not None:
            del self._order[bisect_left(self._order, (*place, vehicle))]
