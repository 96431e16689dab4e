"""Quotas of the messages that wait in the store for analysis, vehicle by vehicle."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from sprung.errors import FormatError
from sprung.link import Header
from sprung.link.frame import HIGHEST_RATE
from sprung.online.store.inbox import Inbox

#: Largest size of what waits of a vehicle [bytes], if it is not more than `_HOURS` of its rate.
_MOST = 64 << 20
#: Time of the samples that may wait [s].
_HOURS = 7200.0
#: Largest size of what waits of a vehicle without a description, and smallest limit when disk space is short [bytes].
_LEAST = 1 << 20
#: Largest rate of samples [bytes/s].
_HIGHEST = 4.0 * HIGHEST_RATE
#: Shortest time between counts of what waits of a vehicle [ns].
_RECOUNT = 10 * 10**9


class QuotaError(FormatError):
    """A message of a vehicle of which too much waits."""


@dataclass(slots=True)
class _Waiting:
    """What waits of a vehicle: its size, its last message by boot and sequence number, and when that was counted."""

    n_bytes: int
    last: tuple[int, int]
    counted: int
    is_described: bool


class Quotas:
    """Limits of what waits in the store for analysis, so that no vehicle fills the disk.

    Parameters
    ----------
    inbox
        Messages that wait.
    window
        Length of a window [s], which is analysed when all of it has arrived.

    Notes
    -----
    A message beyond its quota is refused and not acknowledged: its box keeps it, and sends it again. One that belongs
    before others that wait, as they wait for it, is taken up to twice the quota.
    """

    def __init__(self, inbox: Inbox, window: float) -> None:
        self._inbox = inbox
        self._time = max(_HOURS, 2 * window)
        self._waiting: dict[str, _Waiting] = {}
        self._most = math.inf
        self._full: dict[str, str] = {}

    def take_full(self) -> Mapping[str, str]:
        """Return a sentence about each vehicle of which messages were refused since the last call."""
        full, self._full = self._full, {}
        return full

    def narrow(self, *, is_short: bool) -> None:
        """While disk space is short, refuse messages of the vehicles of which more than the average waits."""
        sizes = self._inbox.n_bytes() if is_short else {}
        self._most = max(_LEAST, sum(sizes.values()) / len(sizes)) if sizes else math.inf

    def forget(self, vehicle: str) -> None:
        """Count anew what waits of a vehicle, as it has another description."""
        self._waiting.pop(vehicle, None)

    def take(self, vehicle: str, header: Header, size: int, *, now: int) -> None:
        """Count a message of some bytes.

        Raises
        ------
        QuotaError
            If too much of the vehicle waits.
        """
        one = self._waiting.get(vehicle) or self._counted(vehicle, now)
        if one.n_bytes + size > self._quota(one, header, size) and abs(now - one.counted) >= _RECOUNT:
            one = self._counted(vehicle, now)  # much may be analysed by now
        most = self._quota(one, header, size)
        if one.n_bytes + size > most:
            does = "analyses it" if one.is_described else "has its description: start its box with its vehicle file"
            self._full[vehicle] = (
                f"{one.n_bytes / 1e6:.1f} MB of {vehicle} wait in the store, at most {most / 1e6:.1f} MB may: its "
                f"messages are refused until the monitor {does}"
            )
            raise QuotaError(self._full[vehicle])
        one.n_bytes += size
        one.last = max(one.last, (header.boot, header.seq))

    def _counted(self, vehicle: str, now: int) -> _Waiting:
        """Count what waits of a vehicle."""
        size = self._inbox.n_bytes(vehicle).get(vehicle, 0)
        last = self._inbox.last(vehicle) or (-1, -1)
        self._waiting[vehicle] = _Waiting(size, last, now, self._inbox.vehicle(vehicle) is not None)
        return self._waiting[vehicle]

    def _quota(self, one: _Waiting, header: Header, size: int) -> float:
        """Return the largest size of what may wait of a vehicle with a message [bytes]."""
        span = header.n_samples * header.interval / 1e9
        rate = min(size / span, _HIGHEST) if span > 0 else 0.0
        most = min(max(_MOST, self._time * rate) if one.is_described else _LEAST, self._most)
        return 2 * most if (header.boot, header.seq) < one.last else most
