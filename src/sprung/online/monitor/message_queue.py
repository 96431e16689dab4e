"""Messages that wait for intake: bounded in bytes, taken vehicle by vehicle in turn; and counts of those refused."""

import threading
from collections import deque
from collections.abc import Mapping

from sprung.errors import FormatError
from sprung.link import parse_topic

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
