"""Frames that a box had to drop before the monitor had them, with their times."""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from sprung.errors import FormatError
from sprung.link.messages import Header, checked_map

#: Largest number of losses in a message.
MAX_LOSSES = 64
_LARGEST = 2**63 - 1


class Loss(NamedTuple):
    """Frames of one boot that were dropped.

    Parameters
    ----------
    boot
        Number of the box's start.
    first, last
        Sequence numbers of the first and the last of them.
    n_frames
        Number of them.
    begin, end
        Times of the first sample and after the last one, UTC ns; 0 if unknown.
    """

    boot: int
    first: int
    last: int
    n_frames: int
    begin: int = 0
    end: int = 0

    def joined(self, other: "Loss") -> "Loss":
        """Return this loss together with another one of the same boot."""
        begin, end = span_of([self, other])
        first, last = min(self.first, other.first), max(self.last, other.last)
        return Loss(self.boot, first, last, self.n_frames + other.n_frames, begin, end)


def span_of(losses: Iterable[Loss]) -> tuple[int, int]:
    """Return the times of the first sample and after the last one of losses, UTC ns; 0 if unknown.

    Examples
    --------
    >>> span_of([Loss(1, 7, 8, 2, begin=3 * 10**9, end=5 * 10**9), Loss(1, 9, 9, 1, begin=5 * 10**9, end=6 * 10**9)])
    (3000000000, 6000000000)
    """
    known = [(loss.begin, loss.end) for loss in losses if loss.begin]
    return min((begin for begin, _ in known), default=0), max((end for _, end in known), default=0)


def loss_of(boot: int, first: int, last: int, payloads: Iterable[bytes]) -> Loss:
    """Return the loss of the frames of a boot from `first` to `last`, with the times that their payloads state."""
    headers = []
    for payload in payloads:
        try:
            headers.append(Header.of(checked_map(payload)))
        except FormatError:
            continue
    begin = min((header.start for header in headers), default=0)
    return Loss(boot, first, last, last - first + 1, begin, max((header.end for header in headers), default=0))


def losses_in(document: Mapping[Any, Any]) -> list[Loss]:
    """Return the losses that a state message of a box states; empty if an older program wrote it.

    Raises
    ------
    FormatError
        If they are too many, or not of the form of `Loss`.

    Examples
    --------
    >>> losses_in({"lost": [[1, 7, 8, 2, 3_000_000_000, 5_000_000_000]]})
    [Loss(boot=1, first=7, last=8, n_frames=2, begin=3000000000, end=5000000000)]
    """
    entries = document.get("lost", [])
    if not isinstance(entries, list) or len(entries) > MAX_LOSSES:
        raise FormatError(f"lost frames that are not a list of at most {MAX_LOSSES}")
    return [_loss(entry) for entry in entries]


def _loss(entry: Any) -> Loss:
    """Return a loss from its numbers."""
    is_valid = (
        isinstance(entry, list)
        and len(entry) == len(Loss._fields)
        and all(type(number) is int and 0 <= number < _LARGEST for number in entry)
        and entry[1] <= entry[2]
    )
    if not is_valid:
        raise FormatError(f"{str(entry)[:40]!r} found where {', '.join(Loss._fields)} of lost frames are expected")
    return Loss(*entry)
