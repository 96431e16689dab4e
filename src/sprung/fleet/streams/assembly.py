"""Windows of a vehicle from its frames, as the monitor would analyse them."""

import json
from collections import Counter
from collections.abc import Iterable, Iterator
from typing import Any, Protocol

from sprung.errors import SprungError
from sprung.fleet.lake import LakeWindow, window_of_recording
from sprung.fleet.streams.frame_order import FrameOrder
from sprung.link import Block, Frame, decode, frame_block, joined
from sprung.link.repeats import Repeats
from sprung.recording import Recording

#: Largest size of the samples of a window [bytes].
_MOST_BYTES = 1 << 28
#: Version of the progress that is kept.
_VERSION = 1


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


class Assembly:
    """Joins frames of one vehicle, in any order, into windows of a fixed number of samples.

    Parameters
    ----------
    vehicle
        Name of the vehicle.
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
        self._vehicle, self._kept, self._duration = vehicle, kept, duration
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

    def update(self, messages: Iterable[bytes]) -> Iterator[LakeWindow]:
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

    def _windows(self, payload: bytes) -> Iterator[LakeWindow]:
        """Add a frame, and yield the windows that it completes."""
        frame = decode(payload)
        needed = max(1, round(self._duration * (1e9 / frame.interval)))
        if 8 * needed * len(frame.channels) > _MOST_BYTES:
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

    def _complete(self, needed: int, last: Frame) -> LakeWindow:
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
        return window_of_recording(self._vehicle, joined(blocks), source="frames")

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
