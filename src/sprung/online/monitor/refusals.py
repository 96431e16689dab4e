"""Counts of refused messages, by vehicle and reason."""

import threading
from collections.abc import Mapping

#: Reasons why messages are refused: no message of this version, a program of another version, more starts of a box than
#: are kept, more bytes than wait at once, values that the store cannot hold.
INVALID, VERSION_UNKNOWN, BOOTS, OVERLOAD, UNSTORABLE = "invalid", "version", "boots", "overload", "unstorable"
#: Name that stands for all vehicles beyond the first thousand, and for messages without a vehicle.
OTHERS = "(others)"
_MOST_VEHICLES = 1000


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
            if vehicle and len(self._vehicles) < _MOST_VEHICLES:
                self._vehicles.add(vehicle)
            key = (vehicle if vehicle in self._vehicles else OTHERS, reason)
            self._counts[key] = self._counts.get(key, 0) + 1
