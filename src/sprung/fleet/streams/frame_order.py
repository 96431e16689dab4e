"""Order of the frames of a vehicle, whatever the order in which they arrive."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from sprung.errors import FormatError
from sprung.link import Header, Key, check_frame, checked_map, losses_in
from sprung.link.messages import REPORTS

#: Largest number and size [bytes] of the frames that wait for earlier ones, after which the earlier ones are lost.
MOST_WAITING, MOST_BYTES = 1024, 1 << 24
#: Largest number of boots, the last ones, and of stated losses that are remembered.
_MOST_BOOTS, _MOST_LOSSES = 1000, 256
#: Place of a frame: boot and sequence number.
Place = tuple[int, int]


class _Held(NamedTuple):
    """A message in the sequence of its box, and what must be analysed before its boot."""

    payload: bytes
    previous: Place | None
    has_samples: bool


class FrameOrder:
    """Puts frames of a vehicle into the order of their boots and sequence numbers.

    Parameters
    ----------
    vehicle
        Name of the vehicle.
    waiting
        Messages that wait for earlier ones, from `waiting`.
    state
        State from `state`; None: nothing has arrived yet.

    Notes
    -----
    A frame waits for those before it in its boot, and for the previous boot where it states that (`Header.previous`).
    Frames that the box states as lost (`sprung.link.Loss`) are not waited for. Nor are those for which more than
    `MOST_WAITING` frames wait: they count as lost, and are passed over if they arrive after all. Of frames with one
    number the first counts, so that duplicates change nothing.
    """

    def __init__(self, vehicle: str, waiting: Iterable[bytes] = (), state: Mapping[str, Any] | None = None) -> None:
        known = state or {"done": [], "oldest": 0, "lost": []}
        self._vehicle = vehicle
        self._done: dict[int, int] = dict(map(tuple, known["done"]))
        self._oldest = int(known["oldest"])
        self._lost: list[tuple[int, int, int]] = [(boot, first, last) for boot, first, last in known["lost"]]
        self._waiting: dict[Place, _Held] = {}
        self._size = 0
        for payload in waiting:
            self.add(payload)

    @property
    def waiting(self) -> list[bytes]:
        """Messages that wait for earlier ones, in their order."""
        return [self._waiting[place].payload for place in sorted(self._waiting)]

    @property
    def state(self) -> dict[str, Any]:
        """Everything but the waiting messages that is needed to continue, as plain values."""
        return {"done": sorted(self._done.items()), "oldest": self._oldest, "lost": sorted(self._lost)}

    def add(self, payload: bytes) -> None:
        """Add a message of the vehicle: a frame, a report, or the state of its box; others are ignored.

        Raises
        ------
        FormatError
            If it is none that its vehicle can have sent.
        """
        document = checked_map(payload)
        if "boots" in document:
            losses = [(loss.boot, loss.first, loss.last) for loss in losses_in(document)]
            self._lost = sorted({*self._lost, *losses})[-_MOST_LOSSES:]
        elif document.get(Key.KIND) in REPORTS:
            if document.get(Key.VEHICLE) != self._vehicle:
                raise FormatError(f"a report of {str(document.get(Key.VEHICLE))[:64]!r} among those of {self._vehicle}")
            self._hold(Header.of(document), payload, has_samples=False)
        elif Key.DATA in document:
            self._hold(check_frame(payload, self._vehicle), payload, has_samples=True)

    def ready(self) -> Iterator[bytes]:
        """Yield the frames whose earlier ones all came, in their order, and forget them.

        Notes
        -----
        To be called when all messages at hand were added: which frames are lost must not depend on their order.
        """
        yield from self._next()
        while len(self._waiting) > MOST_WAITING or self._size > MOST_BYTES:
            self._give_up()
            yield from self._next()
        self._forget()

    def _hold(self, header: Header, payload: bytes, *, has_samples: bool) -> None:
        """Hold a message that is new."""
        place = header.boot, header.seq
        if self._is_done(place) or place in self._waiting:
            return
        self._waiting[place] = _Held(payload, header.previous, has_samples)
        self._size += len(payload)

    def _next(self) -> Iterator[bytes]:
        """Yield frames that wait for nothing; one pass is enough, as boots wait for lower ones only."""
        for boot, seq in sorted(self._waiting):
            self._pass_lost(boot, seq)
            held = self._waiting[boot, seq]
            if self._done.get(boot, -1) != seq - 1 or not self._follows(boot, held.previous):
                continue
            del self._waiting[boot, seq]
            self._size -= len(held.payload)
            self._done[boot] = seq
            if held.has_samples:
                yield held.payload

    def _pass_lost(self, boot: int, seq: int) -> None:
        """Pass over the frames before one that are all lost."""
        for _, first, last in (loss for loss in self._lost if loss[0] == boot):
            done = self._done.get(boot, -1)
            if first <= done + 1 <= last:
                self._done[boot] = max(done, min(last, seq - 1))

    def _follows(self, boot: int, previous: Place | None) -> bool:
        """Return whether the frames of the previous boot came, as far as that is known."""
        if previous is None or previous[0] >= boot:
            return True
        before, count = previous
        if not self._is_done((before, count - 1)) and not any(place[0] == before for place in self._waiting):
            self._pass_lost(before, count)
        return self._is_done((before, count - 1))

    def _give_up(self) -> None:
        """Declare what the first of the waiting frames waits for lost."""
        boot, seq = min(self._waiting)
        previous = self._waiting[boot, seq].previous
        self._done[boot] = seq - 1
        if previous is not None and previous[0] < boot:
            self._done[previous[0]] = max(previous[1] - 1, self._done.get(previous[0], -1))

    def _forget(self) -> None:
        """Forget old boots, whose frames then count as analysed, and losses that were passed."""
        for boot in sorted(self._done)[:-_MOST_BOOTS]:
            del self._done[boot]
            self._oldest = boot + 1
        for place in [place for place in self._waiting if place[0] < self._oldest]:
            self._size -= len(self._waiting.pop(place).payload)
        self._lost = [loss for loss in self._lost if not self._is_done((loss[0], loss[2]))]

    def _is_done(self, place: Place) -> bool:
        """Return whether a frame was analysed, or counts as lost."""
        return place[0] < self._oldest or place[1] <= self._done.get(place[0], -1)
