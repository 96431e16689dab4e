"""Frames of a vehicle, in any order, as windows of samples in the order of time: each sample counts once.

`FrameOrder` says which frames are next, and `WindowCutter` which of their samples end a window. The online monitor,
whose store holds the frames, and streams on Spark, whose state holds them, use both.
"""

import hashlib
import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np

from sprung.errors import FormatError, SprungError
from sprung.link.frame import (
    LONGEST_STEP,
    Block,
    FrameBlock,
    check_frame,
    decode,
    frame_block,
    joined,
    part_of,
    plain_channels,
    restored_channels,
)
from sprung.link.messages import REPORTS, Header, Key, checked_map, losses_in
from sprung.recording import Channel, Recording

#: Largest number of the frames that wait for earlier ones, after which the earlier ones are lost.
MAX_WAITING = 1024
#: Largest size of these frames [bytes].
MAX_WAITING_BYTES = 1 << 24
#: Largest number of boots that are remembered, the last ones.
MAX_BOOTS = 1000
#: Largest number of boots that are read together: a box may have lost the frames of many.
_MAX_READS = 32
#: Largest number of stated losses that are remembered.
_MAX_LOSSES = 256
#: Largest size of the samples of a window [bytes].
_MAX_BYTES = 1 << 28
#: Largest relative difference of sampling rates within a window.
_SAME_RATE = 1e-6
#: Largest number of runs that are remembered, the last ones.
_MAX_RUNS = 2000
#: Fewest changes from sample to sample in a block that distinguishes measured noise from anything else.
_MIN_CHANGES = 32
#: Tolerance of a place in a run [s].
_EPSILON = 1e-3
#: Version of the progress that is kept.
_VERSION = 1
#: Place of a frame: boot and sequence number.
Place = tuple[int, int]


class Numbered(Protocol):
    """A frame or report with its place in the sequence of its box."""

    @property
    def boot(self) -> int:
        """Number of the box's start."""

    @property
    def seq(self) -> int:
        """Sequence number since then."""

    @property
    def payload(self) -> bytes:
        """The message."""


F = TypeVar("F", bound=Numbered)
F_co = TypeVar("F_co", bound=Numbered, covariant=True)


class Pending(Protocol[F_co]):
    """Reads frames of one vehicle."""

    def __call__(self, boot: int, *, after: int, limit: int) -> Sequence[F_co]:
        """Return the frames of a boot that arrived and follow a sequence number, at most `limit`."""


@dataclass(slots=True)
class FrameOrder:
    """Order in which the frames of one vehicle are analysed, whatever the order of their arrival.

    Parameters
    ----------
    contiguous
        Sequence number up to which every frame arrived or is lost, by boot.
    dispatched
        Sequence number up to which frames were given to the analysis, by boot.
    oldest
        Lowest boot that is remembered: those before it count as analysed.

    Notes
    -----
    Boots follow each other by number, and a boot that states the end of the previous one waits for its frames, as a
    restarted box continues where it stopped. So every permutation of frames is analysed in the same order.
    """

    contiguous: dict[int, int] = field(default_factory=dict)
    dispatched: dict[int, int] = field(default_factory=dict)
    oldest: int = 0
    _previous: dict[int, Place | None] = field(default_factory=dict)

    @property
    def has_waiting(self) -> bool:
        """Whether frames wait for the analysis."""
        return any(self.dispatched.get(boot, -1) < last for boot, last in self.contiguous.items())

    @property
    def backlog(self) -> int:
        """Number of frames that wait for the analysis."""
        # Copies: figures are read in another thread.
        dispatched = dict(self.dispatched)
        return sum(last - dispatched.get(boot, -1) for boot, last in dict(self.contiguous).items())

    @property
    def awaited(self) -> dict[int, int]:
        """Boots of which others wait for more frames, and the number of frames that they had."""
        others = [previous for previous in self._previous.values() if previous is not None]
        return {boot: end for boot, end in others if self.contiguous.get(boot, -1) < end - 1}

    def arrived(self, boot: int, contiguous: int) -> None:
        """Record that every frame of a boot up to a sequence number arrived or is lost."""
        self.contiguous[boot] = max(contiguous, self.contiguous.get(boot, -1))

    def next_frames(self, pending: Pending[F], limit: int) -> Sequence[F]:
        """Return the frames to analyse next, all of one boot.

        Parameters
        ----------
        pending
            Reads frames of the vehicle.
        limit
            Largest number of frames.

        Returns
        -------
        sequence
            Frames of one boot; empty if all wait for earlier frames, or if many boots turned out to be lost: later
            ones come at the next call.
        """
        waiting = (boot for boot, last in sorted(self.contiguous.items()) if self.dispatched.get(boot, -1) < last)
        for boot in islice(filter(self._is_ready, waiting), _MAX_READS):
            frames = pending(boot, after=self.dispatched.get(boot, -1), limit=limit)
            if not frames:
                self.dispatched[boot] = self.contiguous[boot]  # all of them are lost
                continue
            self._note_previous(frames[0])
            if self._is_ready(boot):
                return frames
        return []

    def _note_previous(self, first: Numbered) -> None:
        """Keep which boot comes before that of its first frame."""
        if first.boot not in self._previous:
            try:
                self._previous[first.boot] = Header.of(checked_map(first.payload)).previous
            except FormatError:
                self._previous[first.boot] = None

    def _is_ready(self, boot: int) -> bool:
        """Return whether all frames of the previous boot were given to the analysis, if a frame stated that boot."""
        previous = self._previous.get(boot)
        if previous is None or previous[0] >= boot or previous[0] < self.oldest:
            return True
        return self.dispatched.get(previous[0], -1) >= previous[1] - 1


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
            self._run = _identity(block)
            self._place = 0.0
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
        return abs(block.start - self._end) * block.sampling_rate <= LONGEST_STEP * 1e9


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


class Piece(NamedTuple):
    """Samples of a block that belong to one window.

    Parameters
    ----------
    first, last
        First sample, and the one after the last.
    n_before
        Number of samples of the window before them; 0: a new window begins.
    is_last
        Whether the window is complete with them.
    """

    first: int
    last: int
    n_before: int
    is_last: bool


class WindowCutter:
    """Cuts blocks in order of time into windows of a fixed number of samples, of which each sample counts once.

    Parameters
    ----------
    duration
        Length of a window without its gaps [s].
    state
        State from `state`; None: nothing has arrived yet.

    Notes
    -----
    The division into blocks does not matter. Other channels or another rate begin a new window. Samples that were
    analysed before (`Repeats`) are left out.
    """

    def __init__(self, duration: float, state: Mapping[str, Any] | None = None) -> None:
        self._duration = duration
        self._channels: tuple[Channel, ...] = ()
        self._sampling_rate = 1.0
        self._n_samples = 0
        self._repeats = Repeats()
        if state is not None:
            self._channels = restored_channels(state["channels"])
            self._sampling_rate = float(state["sampling_rate"])
            self._n_samples = int(state["n_samples"])
            self._repeats = Repeats.from_state(state["repeats"])

    @property
    def share(self) -> float:
        """Part of the present window that has arrived, 0 to 1."""
        return self._n_samples / self.n_needed(self._sampling_rate)

    @property
    def repeats(self) -> Repeats:
        """Memory of the samples that were analysed before."""
        return self._repeats

    @property
    def state(self) -> dict[str, Any]:
        """Everything that is needed to continue, as plain values."""
        return {
            "channels": plain_channels(self._channels),
            "sampling_rate": self._sampling_rate,
            "n_samples": self._n_samples,
            "repeats": self._repeats.state(),
        }

    def n_needed(self, sampling_rate: float) -> int:
        """Return the number of samples of a window."""
        return max(1, round(self._duration * sampling_rate))

    def cut(self, block: Block) -> Iterator[Piece]:
        """Yield the pieces of a block, each of one window; none for samples that were analysed before."""
        if self._repeats.update(block):
            return
        is_same_rate = abs(block.sampling_rate / self._sampling_rate - 1) < _SAME_RATE
        if not (is_same_rate and block.channels == self._channels):
            self._n_samples = 0
        self._channels = block.channels
        self._sampling_rate = block.sampling_rate
        needed, first = self.n_needed(block.sampling_rate), 0
        while first < block.n_samples:
            before = self._n_samples
            last = min(first + needed - before, block.n_samples)
            self._n_samples = (before + last - first) % needed
            yield Piece(first, last, before, not self._n_samples)
            first = last


class _Held(NamedTuple):
    """A message in the sequence of its box."""

    boot: int
    seq: int
    payload: bytes
    previous: Place | None
    has_samples: bool


class FrameInbox:
    """Frames of a vehicle that arrive in any order, held until those before them are there.

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
    A frame waits for those before it in its boot, and its boot as in `FrameOrder`. Frames that the box states as lost
    (`sprung.link.Loss`) are not waited for. Nor are those for which more than `MAX_WAITING` frames wait: they count as
    lost, and are passed over if they arrive after all. Of frames with one number the first counts, so that duplicates
    change nothing.
    """

    def __init__(self, vehicle: str, waiting: Iterable[bytes] = (), state: Mapping[str, Any] | None = None) -> None:
        known = state or {"done": [], "oldest": 0, "lost": []}
        self._vehicle = vehicle
        self._order = FrameOrder(dispatched=dict(map(tuple, known["done"])), oldest=int(known["oldest"]))
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
        order = self._order
        return {"done": sorted(order.dispatched.items()), "oldest": order.oldest, "lost": sorted(self._lost)}

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
        if not self._is_done(place) and place not in self._waiting:
            self._waiting[place] = _Held(*place, payload, header.previous, has_samples)
            self._size += len(payload)

    def _next(self) -> Iterator[bytes]:
        """Yield frames that wait for nothing."""
        order = self._order
        for boot in {boot for boot, *_ in (*self._waiting, *self._lost)}:
            order.arrived(boot, self._end_of_run(boot))
        before = None
        while before != order.dispatched:  # another call is due after boots of which all is lost
            before = dict(order.dispatched)
            for held in order.next_frames(self._pending, MAX_WAITING):
                self._remove((held.boot, held.seq))
                order.dispatched[held.boot] = held.seq
                if held.has_samples:
                    yield held.payload

    def _end_of_run(self, boot: int) -> int:
        """Return the sequence number up to which every frame of a boot arrived or is lost."""
        spans = [(first, last) for of, first, last in self._lost if of == boot]
        end = self._order.dispatched.get(boot, -1)
        while True:
            if (boot, end + 1) in self._waiting:
                end += 1
                continue
            beyond = max((last for first, last in spans if first <= end + 1 <= last), default=end)
            if beyond == end:
                return end
            end = beyond

    def _pending(self, boot: int, *, after: int, limit: int) -> list[_Held]:
        """Return the frames of a boot that follow a sequence number, up to the first that is missing and not lost."""
        numbers = sorted(seq for of, seq in self._waiting if of == boot and after < seq <= self._order.contiguous[boot])
        return [self._waiting[boot, seq] for seq in numbers[:limit]]

    def _give_up(self) -> None:
        """Declare what the first of the waiting frames waits for lost."""
        boot, seq = min(self._waiting)
        previous = self._waiting[boot, seq].previous
        ends = {boot: seq - 1}
        if previous is not None and previous[0] < boot:
            ends[previous[0]] = previous[1] - 1
        for lost, end in ends.items():
            self._order.dispatched[lost] = max(end, self._order.dispatched.get(lost, -1))
            self._order.arrived(lost, end)

    def _forget(self) -> None:
        """Forget old boots, whose frames then count as analysed, and losses that were passed."""
        order = self._order
        for boot in sorted(order.dispatched)[:-MAX_BOOTS]:
            del order.dispatched[boot]
            order.contiguous.pop(boot, None)
            order.oldest = boot + 1
        for place in [place for place in self._waiting if place[0] < order.oldest]:
            self._remove(place)
        self._lost = [loss for loss in self._lost if not self._is_done((loss[0], loss[2]))]

    def _remove(self, place: Place) -> None:
        self._size -= len(self._waiting.pop(place).payload)

    def _is_done(self, place: Place) -> bool:
        """Return whether a frame was analysed, or counts as lost."""
        return place[0] < self._order.oldest or place[1] <= self._order.dispatched.get(place[0], -1)


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
    Windows are those of `VehicleMonitor`, as order and cutting are. Memory and state hold the frames of one window, as
    they came, and those of `FrameInbox`.
    """

    def __init__(self, vehicle: str, kept: Kept, *, duration: float) -> None:
        self._kept = kept
        text = kept.get_progress()
        progress: dict[str, Any] = json.loads(text) if text else {}
        self._n_waiting = int(progress.get("n_waiting", 0))
        self._inbox = FrameInbox(vehicle, kept.waiting.get() if self._n_waiting else [], progress.get("order"))
        self._cutter = WindowCutter(duration, progress.get("windows"))
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
                self._inbox.add(message)
            except SprungError as error:
                self.refused[str(error)] += 1
        for payload in self._inbox.ready():
            try:
                yield from self._windows(payload)
            except SprungError as error:
                self.refused[str(error)] += 1
        self._keep()

    def _windows(self, payload: bytes) -> Iterator[Recording]:
        """Add a frame, and yield the windows that it completes."""
        block = frame_block(decode(payload), {})
        if 8 * self._cutter.n_needed(block.sampling_rate) * len(block.channels) > _MAX_BYTES:
            self.refused[f"a window of {len(block.channels)} channels at {block.sampling_rate:g} Hz is too large"] += 1
            return
        for piece in self._cutter.cut(block):
            if not piece.n_before:
                self._begin(offset=piece.first)
            self._new.append(payload)
            if piece.is_last:
                yield self._complete(piece.last)

    def _begin(self, *, offset: int = 0) -> None:
        self._new = []
        self._is_anew = True
        self._offset = offset

    def _complete(self, end: int) -> Recording:
        """Return the window that ends within its last frame."""
        payloads = [*([] if self._is_anew else self._kept.window.get()), *self._new]
        blocks: list[Block] = [frame_block(decode(payload), {}) for payload in payloads]
        blocks[-1] = part_of(blocks[-1], 0, end)
        blocks[0] = part_of(blocks[0], self._offset, blocks[0].n_samples)
        self._begin()
        return joined(blocks)

    def _keep(self) -> None:
        """Keep everything that is needed to continue."""
        if self._is_anew:
            self._kept.window.put(self._new)
        elif self._new:
            self._kept.window.append(self._new)
        waiting = self._inbox.waiting
        if waiting or self._n_waiting:
            self._kept.waiting.put(waiting)
        self._kept.put_progress(
            json.dumps(
                {
                    "version": _VERSION,
                    "order": self._inbox.state,
                    "n_waiting": len(waiting),
                    "windows": self._cutter.state,
                    "offset": self._offset,
                }
            )
        )
        self._n_waiting = len(waiting)
        self._new = []
        self._is_anew = False
