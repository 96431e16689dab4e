"""Windows of the monitor into a lake, for engines that analyse fleets."""

import logging
import threading
from collections.abc import Callable

from sprung.errors import SprungError
from sprung.link import Every
from sprung.online.monitor.alert_book import Context
from sprung.recording import Recording

LOG = logging.getLogger("sprung.monitor")

#: Longest wait of a window, and of all after a failure [s].
_WAIT = 600.0
#: Number of windows that do not wait that long.
_MANY = 64
#: Time between checks [s].
_LOOK = 5.0
#: Time between deletions of old dates and compactions [s].
_DAY = 86400.0
#: Largest size of a date that the monitor compacts [bytes].
_COMPACTED = 1 << 28
#: Longest wait for a commit under way at the end [s].
_CLOSING = 2.0


class LakeWriter:
    """Keeps windows on disk, and writes them to a lake in a thread of its own: a slow object store delays nothing else.

    Parameters
    ----------
    context
        Settings, and clocks.
    location
        Folder or URL of the lake.
    """

    def __init__(self, context: Context, location: str) -> None:
        from sprung.fleet.lake import Lake, Outbox

        keep = context.site.keep
        self._lake = Lake(location)
        self._outbox = Outbox(context.site.outbox, max_bytes=1e9 * keep.raw_gigabytes)
        self._source = f"monitor {context.site.name}"
        self._keep = keep
        self._clock = context.clock
        self._moving = Every(_WAIT, context.timer)
        self._tidying = Every(_DAY, context.timer)
        self._moving.start()
        self._n_written = 0
        self._n_failures = 0
        self._reasons: dict[str, str] = {}
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="lake", daemon=True)

    @property
    def figures(self) -> dict[str, float]:
        """Figures of `sprung.online.monitor.station.FIGURES` about the lake."""
        return {
            "sprung_lake_windows_total": self._n_written,
            "sprung_lake_windows_waiting": len(self._outbox.files),
            "sprung_lake_failures_total": self._n_failures,
        }

    @property
    def problem(self) -> str:
        """Sentence about the last failures; empty if there is none."""
        reasons = list(dict.fromkeys(self._reasons.copy().values()))
        return f"windows are not written to the lake: {'; '.join(reasons)}" if reasons else ""

    def open(self) -> None:
        """Start writing."""
        self._thread.start()

    def close(self) -> None:
        """Stop; windows that wait stay on the disk."""
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join(_CLOSING)

    def keep(self, vehicle: str, recording: Recording) -> None:
        """Keep a window until it is written; a failure is logged and raises an alert."""
        from sprung.fleet.lake import window_of_recording

        try:
            self._outbox.put(window_of_recording(vehicle, recording, source=self._source))
            self._reasons.pop("keep", None)
        except (SprungError, OSError) as error:
            self._fail("keep", error)

    def step(self) -> None:
        """Do what is due."""
        n_waiting = len(self._outbox.files)
        has_failed = "write" in self._reasons
        if n_waiting and (self._moving.is_due or (n_waiting >= _MANY and not has_failed)):
            self._attempt("write", self._move)
            self._moving.start()
        elif not n_waiting:
            self._moving.start()  # the next window waits for as long as any
        if self._tidying.is_due:
            self._tidying.start()
            self._attempt("tidy", self._tidy)

    def _move(self) -> None:
        """Write the windows that wait."""
        self._n_written += self._outbox.move(self._lake)

    def _tidy(self) -> None:
        """Delete old dates, and compact."""
        self._lake.prune(before=self._keep.before(self._keep.days_in_lake, self._clock()))
        self._lake.compact(max_bytes=_COMPACTED)

    def _attempt(self, what: str, act: Callable[[], None]) -> None:
        """Do something with the lake; whatever fails is logged, and tried again later."""
        try:
            act()
            self._reasons.pop(what, None)
        except Exception as error:  # an object store fails in many ways, and the monitor continues
            self._fail(what, error)

    def _fail(self, what: str, error: Exception) -> None:
        """Record and log a failure."""
        self._n_failures += 1
        self._reasons[what] = str(error) or type(error).__name__
        LOG.warning("windows are not written to the lake", extra={"reason": self._reasons[what]})

    def _run(self) -> None:
        """Do what is due until stopped."""
        while not self._stopping.wait(_LOOK):
            self.step()
