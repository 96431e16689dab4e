"""Failures of the analysis on frames: which of them are set aside so that the others continue."""

from dataclasses import dataclass

#: Failures in one place after which its frame is set aside.
_MOST = 2


@dataclass(slots=True)
class _Failures:
    """Failures of a vehicle since its last stored state.

    Parameters
    ----------
    place
        Boot and sequence number of the frame of the last failure.
    count
        Number of failures there in a row.
    left_out
        Boot and sequence number of the last frame that was set aside; None: none was.
    """

    place: tuple[int, int] = (-1, -1)
    count: int = 0
    left_out: tuple[int, int] | None = None

    @property
    def is_of_window(self) -> bool:
        """Whether the last failure is behind a frame that was set aside."""
        return self.left_out is not None and self.place > self.left_out


class Strikes:
    """Failures of all vehicles since their last stored states.

    Notes
    -----
    A frame on which the analysis fails twice is set aside. If a later frame fails before a state is stored, it is the
    window that cannot be analysed, and its frames are set aside. A failure on an earlier one, which is analysed again,
    is a first failure.
    """

    def __init__(self) -> None:
        self._of: dict[str, _Failures] = {}

    def add(self, vehicle: str, boot: int, seq: int, *, done: int) -> int | None:
        """Record a failure on a frame.

        Parameters
        ----------
        vehicle
            Name of the vehicle.
        boot, seq
            Boot and sequence number of the frame.
        done
            Sequence number of the last frame of the boot that the stored state covers.

        Returns
        -------
        int or None
            First sequence number of those to set aside, which end at the frame; None: it is tried again.
        """
        failures = self._of.setdefault(vehicle, _Failures())
        failures.count = failures.count + 1 if (boot, seq) == failures.place else 1
        failures.place = boot, seq
        if failures.is_of_window:
            return done + 1
        return seq if failures.count >= _MOST else None

    def leave_out(self, vehicle: str) -> None:
        """Record that the store has set aside what `add` returned."""
        failures = self._of[vehicle]
        if failures.is_of_window:
            self.forget(vehicle)
        else:
            failures.left_out = max(failures.place, failures.left_out or failures.place)

    def forget(self, vehicle: str) -> None:
        """Reset, as a state was stored."""
        self._of.pop(vehicle, None)
