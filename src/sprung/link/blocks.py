"""Blocks of samples in order of time: recordings, or frames of the link."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np

from sprung._arrays import Real
from sprung.link.frame import Frame
from sprung.recording import Channel, Gap, Recording

#: Longest time between blocks that is not a gap, in samples; clocks of loggers jitter.
LONGEST_STEP = 2.5


@dataclass(frozen=True, eq=False, slots=True)
class FrameBlock:
    """A frame as a block: it keeps the integers, which take a quarter of the memory of samples.

    Parameters
    ----------
    frame
        Frame of a vehicle.
    channels
        Channels with the quantities that the box announced.
    """

    frame: Frame
    channels: tuple[Channel, ...]

    @property
    def start(self) -> int:
        """Time of the first sample, UTC ns; a step of the box's clock is a gap."""
        return self.frame.start

    @property
    def samples(self) -> Real:
        """Samples in SI units, NaN where missing, shape (channels, samples)."""
        return self.frame.samples

    @property
    def sampling_rate(self) -> float:
        """Sampling rate [Hz]."""
        return 1e9 / self.frame.interval

    @property
    def n_samples(self) -> int:
        """Number of samples of each channel."""
        return self.frame.n_samples

    @property
    def gaps(self) -> tuple[Gap, ...]:
        """No gaps: a frame is continuous."""
        return ()


#: Samples of several channels in order of time.
Block: TypeAlias = Recording | FrameBlock


def frame_block(frame: Frame, quantities: Mapping[str, str]) -> FrameBlock:
    """Return a frame as a block; `quantities` of the channels as the box announced them.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.link import Frame
    >>> frame = Frame("bus-17", 1, 0, 10**18, 2_500_000, ("acc_fl",), np.array([0.01]), np.array([[0, 50, -100]]))
    >>> block = frame_block(frame, {"acc_fl": "acceleration"})
    >>> block.channels[0].unit, block.sampling_rate, block.samples.tolist()
    ('m/s^2', 400.0, [[0.0, 0.5, -1.0]])
    """
    return FrameBlock(
        frame, _channels(frame.channels, tuple(quantities.get(name, "unknown") for name in frame.channels))
    )


@lru_cache(maxsize=1024)
def _channels(names: tuple[str, ...], quantities: tuple[str, ...]) -> tuple[Channel, ...]:
    """Return channels, shared by all frames that have them: a window holds hundreds."""
    return tuple(Channel(name, quantity) for name, quantity in zip(names, quantities, strict=True))


def plain_channels(channels: Iterable[Channel]) -> list[list[Any]]:
    """Return channels as plain values."""
    return [[channel.name, channel.quantity, channel.position, channel.direction] for channel in channels]


def restored_channels(plain: Iterable[Sequence[Any]]) -> tuple[Channel, ...]:
    """Return the channels of plain values."""
    return tuple(
        Channel(name, quantity, tuple(position) if position else None, tuple(direction) if direction else None)
        for name, quantity, position, direction in plain
    )


def part_of(block: Block, first: int, last: int) -> Block:
    """Return the samples of a block from one to before another."""
    if first == 0 and last == block.n_samples:
        return block
    return Recording(block.samples, block.sampling_rate, block.channels, block.start, block.gaps).part(first, last)


def joined(blocks: Sequence[Block]) -> Recording:
    """Return blocks of the same channels and rate as one recording, with gaps where time is missing.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.recording import Channel, Recording
    >>> channels = (Channel("acc_fl", "acceleration"),)
    >>> blocks = [Recording(np.ones((1, 100)), 100.0, channels, start=second * 10**9) for second in (0, 1, 5)]
    >>> recording = joined(blocks)
    >>> recording.n_samples, recording.gaps
    (300, (Gap(index=200, duration=3.0),))
    """
    first = blocks[0]
    gaps, place, end = [], 0, first.start
    for block in blocks:
        if place and block.start is not None and end is not None:
            missing = (block.start - end) / 1e9 * first.sampling_rate
            if abs(missing) > LONGEST_STEP:
                gaps.append(Gap(place, max(missing, 1.0) / first.sampling_rate))
        gaps += [replace(gap, index=gap.index + place) for gap in block.gaps]
        place += block.n_samples
        lost = sum(gap.duration for gap in block.gaps)
        end = None if block.start is None else block.start + round((block.n_samples / block.sampling_rate + lost) * 1e9)
    return Recording(
        samples=np.concatenate([block.samples for block in blocks], axis=1),
        sampling_rate=first.sampling_rate,
        channels=first.channels,
        start=first.start,
        gaps=tuple(gaps),
    )
