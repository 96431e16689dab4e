"""Frames just stored, from where they are given to workers without being read back."""

from collections.abc import Iterable

from sprung.online.store import StoredFrame

#: Largest size of the frames that are held, and of those of one vehicle [bytes].
_HELD = 1 << 26
_HELD_OF_ONE = 1 << 21


class FrameCache:
    """Frames that the store has; bounded in size.

    Parameters
    ----------
    max_bytes
        Largest size of all payloads [bytes]; frames beyond it are read from the store.

    Notes
    -----
    Of several frames with one number the first counts, as in the store.
    """

    def __init__(self, max_bytes: int = _HELD) -> None:
        self._most = max_bytes
        self._frames: dict[str, dict[tuple[int, int], StoredFrame]] = {}
        self._sizes: dict[str, int] = {}
        self._size = 0

    @property
    def n_bytes(self) -> int:
        """Size of all payloads held."""
        return self._size

    def hold(self, frames: Iterable[StoredFrame]) -> None:
        """Hold frames that the store has."""
        for frame in frames:
            size, place = len(frame.payload), (frame.boot, frame.seq)
            own = self._sizes.get(frame.vehicle, 0) + size
            held = self._frames.setdefault(frame.vehicle, {})
            if place not in held and self._size + size <= self._most and own <= _HELD_OF_ONE:
                held[place] = frame
                self._sizes[frame.vehicle] = own
                self._size += size

    def following(self, vehicle: str, boot: int, *, after: int, until: int, limit: int) -> list[StoredFrame]:
        """Return the unbroken run of frames that follows a sequence number, as far as it is held."""
        held = self._frames.get(vehicle, {})
        run: list[StoredFrame] = []
        while len(run) < limit and after < until and (boot, after + 1) in held:
            after += 1
            run.append(held[boot, after])
        return run

    def release(self, vehicle: str, boot: int, seq: int) -> None:
        """Forget the frames of a boot up to a sequence number, and of all boots before."""
        held = self._frames.get(vehicle, {})
        for place in [place for place in held if place <= (boot, seq)]:
            size = len(held.pop(place).payload)
            self._sizes[vehicle] -= size
            self._size -= size
        if not held:
            self.forget(vehicle)

    def forget(self, vehicle: str) -> None:
        """Forget the frames of a vehicle, which the store has."""
        self._frames.pop(vehicle, None)
        self._size -= self._sizes.pop(vehicle, 0)
