"""Messages that wait: in memory for intake, and in the store for analysis; bounded, vehicle by vehicle."""

import math
import threading
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

from sprung.errors import FormatError
from sprung.link import Header, parse_topic
from sprung.link.frame import HIGHEST_RATE
from sprung.online.store.inbox import Inbox

#: Bytes of all messages that may wait.
MAX_WAITING = 128 << 20
#: Bytes that a message takes besides its payload.
OVERHEAD = 512
#: Share of the free bytes that the messages of one vehicle may take.
_SHARE = 0.25
#: Reason of a refusal: no message of this version.
INVALID = "invalid"
#: Reason of a refusal: a program of another version.
VERSION_UNKNOWN = "version"
#: Reason of a refusal: more starts of a box than are kept.
BOOTS = "boots"
#: Reason of a refusal: more bytes than wait at once.
OVERLOAD = "overload"
#: Reason of a refusal: more bytes than may wait in the store.
QUOTA = "quota"
#: Reason of a refusal: values that the store cannot hold.
UNSTORABLE = "unstorable"
#: Name that stands for all vehicles beyond the first thousand, and for messages without a vehicle.
OTHERS = "(others)"
_MAX_VEHICLES = 1000
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


class MessageQueue:
    """Queues of messages, one for each vehicle; from any thread.

    Parameters
    ----------
    max_bytes
        Bytes of all messages that may wait.

    Notes
    -----
    A message is refused if those of its vehicle would take more than a quarter of the bytes that are free. One vehicle
    that floods the monitor thus takes a fifth of all, n of them n / (n + 4), and there is always room for others.
    Vehicles take turns, so that one with one message waits for at most one message of every other vehicle.

    References
    ----------
    Choudhury and Hahne (1998), Dynamic queue length thresholds for shared-memory packet switches, IEEE/ACM Transactions
    on Networking 6(2).
    """

    def __init__(self, max_bytes: int = MAX_WAITING) -> None:
        self._most = max_bytes
        self._lock = threading.Lock()
        self._queues: dict[str, deque[tuple[str, bytes]]] = {}
        self._sizes: dict[str, int] = {}
        self._turns: deque[str] = deque()
        self._n_bytes = 0

    @property
    def n_bytes(self) -> int:
        """Bytes of the messages that wait."""
        return self._n_bytes

    @property
    def is_empty(self) -> bool:
        """Whether no message waits."""
        return not self._turns

    def put(self, name: str, payload: bytes) -> bool:
        """Queue a message of a topic, and return whether there was room for it."""
        vehicle = vehicle_of(name)
        size = len(name) + len(payload) + OVERHEAD
        with self._lock:
            of_vehicle = self._sizes.get(vehicle, 0) + size
            if of_vehicle > _SHARE * (self._most - self._n_bytes):
                return False
            if vehicle not in self._queues:
                self._queues[vehicle] = deque()
                self._turns.append(vehicle)
            self._queues[vehicle].append((name, payload))
            self._sizes[vehicle] = of_vehicle
            self._n_bytes += size
            return True

    def take(self) -> tuple[str, bytes] | None:
        """Return the oldest message of the vehicle whose turn it is; None if no message waits."""
        with self._lock:
            if not self._turns:
                return None
            vehicle = self._turns.popleft()
            waiting = self._queues[vehicle]
            name, payload = waiting.popleft()
            size = len(name) + len(payload) + OVERHEAD
            self._n_bytes -= size
            self._sizes[vehicle] -= size
            if waiting:
                self._turns.append(vehicle)
            else:
                del self._queues[vehicle], self._sizes[vehicle]
            return name, payload


class Refusals:
    """Counts refused messages; from any thread.

    Notes
    -----
    Only the first 1000 vehicles are counted by name, so that nobody can fill memory or figures with made-up names.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._counts: dict[tuple[str, str], int] = {}
        self._vehicles: set[str] = set()

    @property
    def total(self) -> int:
        """Number of refused messages."""
        return sum(self.counts.values())

    @property
    def counts(self) -> Mapping[tuple[str, str], int]:
        """Number of refused messages by vehicle and reason."""
        with self._lock:
            return dict(self._counts)

    def add(self, vehicle: str, reason: str) -> None:
        """Count a refused message of a vehicle; empty: of no vehicle."""
        with self._lock:
            if vehicle and len(self._vehicles) < _MAX_VEHICLES:
                self._vehicles.add(vehicle)
            key = (vehicle if vehicle in self._vehicles else OTHERS, reason)
            self._counts[key] = self._counts.get(key, 0) + 1


def vehicle_of(name: str) -> str:
    """Return the vehicle of a topic; empty if the topic is not one of this version."""
    try:
        return parse_topic(name)[0]
    except FormatError:
        return ""


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
