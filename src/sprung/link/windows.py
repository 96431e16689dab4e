"""Frames of a vehicle, in any order, as windows of samples in the order of time: each sample counts once."""

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple, Protocol

from sprung.errors import FormatError, SprungError
from sprung.link.blocks import Block, frame_block, joined
from sprung.link.frame import Frame, check_frame, decode
from sprung.link.losses import losses_in
from sprung.link.messages import REPORTS, Header, Key, checked_map
from sprung.link.repeats import Repeats
from sprung.recording import Recording

#: Largest number of the frames that wait for earlier ones, after which the earlier ones are lost.
MAX_WAITING = 1024
#: Largest size of these frames [bytes].
MAX_WAITING_BYTES = 1 << 24
#: Largest number of boots that are remembered, the last ones.
MAX_BOOTS = 1000
#: Largest number of stated losses that are remembered.
_MAX_LOSSES = 256
#: Largest size of the samples of a window [bytes].
_MAX_BYTES = 1 << 28
#: Version of the progress that is kept.
_VERSION = 1
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
    waiting
        Messages that wait for earlier ones, from `waiting`.
    state
        State from `state`; None: nothing has arrived yet.

    Notes
    -----
    A frame waits for those before it in its boot, and for the previous boot where it states that (`Header.previous`).
    Frames that the box states as lost (`sprung.link.Loss`) are not waited for. Nor are those for which more than
    `MAX_WAITING` frames wait: they count as lost, and are passed over if they arrive after all. Of frames with one
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
            self._lost = sorted({*self._lost, *losses})[-_MAX_LOSSES:]
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
        while len(self._waiting) > MAX_WAITING or self._size > MAX_WAITING_BYTES:
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
        for boot in sorted(self._done)[:-MAX_BOOTS]:
            del self._done[boot]
            self._oldest = boot + 1
        for place in [place for place in self._waiting if place[0] < self._oldest]:
            self._size -= len(self._waiting.pop(place).payload)
        self._lost = [loss for loss in self._lost if not self._is_done((loss[0], loss[2]))]

    def _is_done(self, place: Place) -> bool:
        """Return whether a frame was analysed, or counts as lost."""
        return place[0] < self._oldest or place[1] <= self._done.get(place[0], -1)


class Messages(Protocol):
    """A list of messages that is kept."""

    def get(self) -> list[bytes]:
        """Return all of them."""

    def put(self, messages: list[bytes]) -> None:
        """Replace all of them."""

    def append(self, messages: list[bytes]) -> None:
        """Add some at the end."""


class Kept(Protocol):
    """What is kept for a vehicle from batch to batch."""

    @property
    def window(self) -> Messages:
        """Frames of the incomplete window."""

    @property
    def waiting(self) -> Messages:
        """Messages that wait for earlier ones."""

    def get_progress(self) -> str:
        """Return how far the frames were analysed; empty before the first."""

    def put_progress(self, progress: str) -> None:
        """Replace how far the frames were analysed."""


class WindowAssembly:
    """Joins frames of one vehicle, in any order, into windows of a fixed number of samples.

    Parameters
    ----------
    kept
        What was kept of its frames.
    duration
        Length of a window without its gaps [s].

    Notes
    -----
    Windows are those of `VehicleMonitor`: frames in the order of `FrameOrder`, without those that were analysed before
    (`Repeats`); other channels or another rate begin a new window. Memory and state hold the frames of one window, as
    they came, and those of `FrameOrder`.
    """

    def __init__(self, vehicle: str, kept: Kept, *, duration: float) -> None:
        self._kept = kept
        self._duration = duration
        text = kept.get_progress()
        progress: dict[str, Any] = json.loads(text) if text else {}
        self._n_waiting = int(progress.get("n_waiting", 0))
        waiting = kept.waiting.get() if self._n_waiting else []
        self._order = FrameOrder(vehicle, waiting, progress.get("order"))
        self._repeats = Repeats.from_state(progress["repeats"]) if progress else Repeats()
        self._channels: tuple[str, ...] = tuple(progress.get("channels", ()))
        self._interval = int(progress.get("interval", 0))
        self._n_samples = int(progress.get("n_samples", 0))  # of the incomplete window
        self._offset = int(progress.get("offset", 0))  # samples of its first frame that the window before has
        self._new: list[bytes] = []
        self._is_anew = False
        self.refused: Counter[str] = Counter()

    def update(self, messages: Iterable[bytes]) -> Iterator[Recording]:
        """Add messages, yield the windows that they complete, and then keep the rest.

        Parameters
        ----------
        messages
            All messages of a batch, in any order. Those that are invalid are counted in `refused`.
        """
        for message in sorted(messages):  # of two frames with one number the same one counts in any order
            try:
                self._order.add(message)
            except SprungError as error:
                self.refused[str(error)] += 1
        for payload in self._order.ready():
            try:
                yield from self._windows(payload)
            except SprungError as error:
                self.refused[str(error)] += 1
        self._keep()

    def _windows(self, payload: bytes) -> Iterator[Recording]:
        """Add a frame, and yield the windows that it completes."""
        frame = decode(payload)
        needed = max(1, round(self._duration * (1e9 / frame.interval)))
        if 8 * needed * len(frame.channels) > _MAX_BYTES:
            self.refused[f"a window of {len(frame.channels)} channels at {1e9 / frame.interval:g} Hz is too large"] += 1
            return
        if self._repeats.update(frame_block(frame, {})):
            return
        if not self._is_continued_by(frame):
            self._begin([], offset=0, n_samples=0)
        self._channels, self._interval = frame.channels, frame.interval
        self._new.append(payload)
        self._n_samples += frame.n_samples
        while self._n_samples >= needed:
            yield self._complete(needed, frame)

    def _complete(self, needed: int, last: Frame) -> Recording:
        """Return the complete window, and begin the next one with the rest of its last frame."""
        payloads = [*([] if self._is_anew else self._kept.window.get()), *self._new]
        blocks: list[Block] = [frame_block(decode(payload), {}) for payload in payloads]
        rest = self._n_samples - needed
        end = last.n_samples - rest
        is_alone = len(blocks) == 1
        blocks[-1] = _part(blocks[-1], self._offset if is_alone else 0, end)
        if not is_alone:
            blocks[0] = _part(blocks[0], self._offset, blocks[0].n_samples)
        self._begin(payloads[-1:] if rest else [], offset=end if rest else 0, n_samples=rest)
        return joined(blocks)

    def _is_continued_by(self, frame: Frame) -> bool:
        """Return whether a frame can continue the window."""
        is_alike = frame.channels == self._channels and abs(self._interval / frame.interval - 1) < 1e-6
        return not self._n_samples or is_alike

    def _begin(self, payloads: list[bytes], *, offset: int, n_samples: int) -> None:
        """Begin a window with frames of which some samples are in it."""
        self._new, self._is_anew, self._offset, self._n_samples = payloads, True, offset, n_samples

    def _keep(self) -> None:
        """Keep everything that is needed to continue."""
        if self._is_anew:
            self._kept.window.put(self._new)
        elif self._new:
            self._kept.window.append(self._new)
        waiting = self._order.waiting
        if waiting or self._n_waiting:
            self._kept.waiting.put(waiting)
        self._kept.put_progress(
            json.dumps(
                {
                    "version": _VERSION,
                    "order": self._order.state,
                    "n_waiting": len(waiting),
                    "repeats": self._repeats.state(),
                    "channels": self._channels,
                    "interval": self._interval,
                    "n_samples": self._n_samples,
                    "offset": self._offset,
                }
            )
        )
        self._n_waiting, self._new, self._is_anew = len(waiting), [], False


def _part(block: Block, first: int, last: int) -> Block:
    """Return the samples of a block from one to before another."""
    if first == 0 and last == block.n_samples:
        return block
    return Recording(block.samples, block.sampling_rate, block.channels, block.start).part(first, last)
