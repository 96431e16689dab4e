"""State of a stream of frames in Spark: one assembly of windows for each vehicle."""

from collections.abc import Iterator
from typing import Any

from pyspark.sql import Row
from pyspark.sql.streaming.stateful_processor import StatefulProcessor, StatefulProcessorHandle

from sprung.fleet.lake import SCHEMA, LakeWindow, window_of_recording
from sprung.link.windows import WindowAssembly


class FrameState(StatefulProcessor):
    """Joins the frames of each vehicle into windows, whose rows are those of a lake.

    Parameters
    ----------
    duration
        Length of a window [s].

    Notes
    -----
    Spark keeps the state with the batch that made it, so that a batch that is repeated begins with the state before it.
    """

    def __init__(self, duration: float) -> None:
        self._duration = duration

    def init(self, handle: StatefulProcessorHandle) -> None:
        """Open what is kept for each vehicle."""
        self._kept = _Kept(handle)

    def handleInputRows(self, key: Any, rows: Iterator[Row], timerValues: Any) -> Iterator[Row]:  # noqa: N802
        """Yield the windows that the messages of a batch complete, and a row with the number of refused messages."""
        vehicle = str(key[0])
        assembly = WindowAssembly(vehicle, self._kept, duration=self._duration)
        for recording in assembly.update(bytes(row["value"] or b"") for row in rows):
            yield _row(window_of_recording(vehicle, recording, source="frames"))
        if assembly.refused:
            reason, _ = assembly.refused.most_common(1)[0]
            blank = dict.fromkeys(SCHEMA.names)
            yield Row(**blank | {"vehicle": vehicle}, n_refused=assembly.refused.total(), refusal=reason)

    def close(self) -> None:
        """Do nothing: Spark keeps the state."""


class _Messages:
    """A list of messages in the state of Spark."""

    def __init__(self, handle: StatefulProcessorHandle, name: str) -> None:
        self._list = handle.getListState(name, "message binary")

    def get(self) -> list[bytes]:
        return [bytes(message) for (message,) in self._list.get()]

    def put(self, messages: list[bytes]) -> None:
        if messages:
            self._list.put([(message,) for message in messages])
        else:
            self._list.clear()

    def append(self, messages: list[bytes]) -> None:
        self._list.appendList([(message,) for message in messages])


class _Kept:
    """What is kept for the vehicle at hand."""

    def __init__(self, handle: StatefulProcessorHandle) -> None:
        self.window = _Messages(handle, "window")
        self.waiting = _Messages(handle, "waiting")
        self._progress = handle.getValueState("progress", "progress string")

    def get_progress(self) -> str:
        found = self._progress.get()
        return "" if found is None else str(found[0])

    def put_progress(self, progress: str) -> None:
        self._progress.update((progress,))


def _row(window: LakeWindow) -> Row:
    channels = [Row(**channel) for channel in window.row["channels"]]
    gaps = [Row(**gap) for gap in window.row["gaps"]]
    conditions = dict(window.row["conditions"])
    parts = {"channels": channels, "gaps": gaps, "conditions": conditions}
    return Row(**{name: window.row[name] for name in SCHEMA.names} | parts, n_refused=0, refusal="")
