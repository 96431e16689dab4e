"""Storage of the analysis: results and progress in one transaction, samples in an archive, alerts."""

import json
import logging
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from sprung.diagnosis import Baseline, Diagnosis, Observation
from sprung.errors import FormatError, SprungError
from sprung.link import Every, Key, checked_map
from sprung.link.archive import write_archive
from sprung.link.messages import count
from sprung.link.summaries import summary_from_document
from sprung.online.monitor.alert_book import Context
from sprung.online.monitor.events import Event, Identified, Observed, Restored
from sprung.online.monitor.jobs import Outcome
from sprung.online.store import Progress, RefusedError, StoredFrame, StoreError
from sprung.recording import Recording
from sprung.results.documents import baseline_document, detectable_document, finding_document, observation_document
from sprung.results.tables import describe_diagnosis
from sprung.state import Conclusion

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


LOG = logging.getLogger("sprung.monitor")

#: Alerts about the analysis of a vehicle, which the next window clears.
_TROUBLES = ("monitor:analysis", "monitor:state", "monitor:opening")
#: Largest number of results that wait to be stored together.
_MAX_WAITING = 1000
#: Useful digits of identified modes.
_OF_MODES = 6
#: Useful digits of the windows that diagnosis and types compare.
_OF_WINDOWS = 9


class Ledger:
    """Stores the results of workers' jobs.

    Parameters
    ----------
    context
        Settings, including those of the archive, store of results and progress, and alerts.
    lake
        Lake writer that keeps the samples of windows; None: no lake.

    Notes
    -----
    Modes of an incomplete window wait to be stored with those of other vehicles, until `flush`. After a restart their
    frames are analysed again, perhaps with late ones of an earlier boot before them: the modes replace those stored.
    """

    def __init__(self, context: Context, *, lake: LakeWriter | None = None) -> None:
        self._store = context.store
        self._alerts = context.alerts
        self._clock = context.clock
        self._samples = context.site.archive
        self._correlations = context.site.correlations
        self._lake = lake
        self._warned: dict[tuple[str, str], str] = {}
        self._waiting: list[Progress] = []
        self._reopened: set[str] = set()
        self._n_windows = 0
        self._n_identifications = 0
        self._n_frames_quarantined = 0
        self._n_states_quarantined = 0

    @property
    def figures(self) -> dict[str, float]:
        """Figures of `sprung.online.monitor.station.FIGURES` about results."""
        return {
            "sprung_windows_total": self._n_windows,
            "sprung_identifications_total": self._n_identifications,
            "sprung_frames_quarantined_total": self._n_frames_quarantined,
            "sprung_states_quarantined_total": self._n_states_quarantined,
        }

    def reopen(self, vehicle: str) -> None:
        """Let a vehicle continue from its stored state: modes since then will be identified again."""
        self._waiting = [each for each in self._waiting if each.vehicle != vehicle]
        self._reopened.add(vehicle)

    def commit(self, outcome: Outcome, boot: int, seq: int) -> bool:
        """Store the events of a job: those of a window in one transaction with the state after it, others at `flush`.

        Parameters
        ----------
        outcome
            Outcome of the job.
        boot, seq
            Boot of its frames, and sequence number of the last one.

        Returns
        -------
        bool
            Whether the frames up to `seq` are recorded as analysed, which requires a state.

        Raises
        ------
        StoreError
            If the store cannot write.
        """
        windows = [event for event in outcome.events if isinstance(event, Observed)]
        identified = [event for event in outcome.events if isinstance(event, Identified)]
        changes = [event for event in outcome.events if isinstance(event, Observed | Restored)]
        # Without modes nothing is kept: why a window has none is in its observation.
        modes = tuple(_modes(event) for event in identified if event.modes)
        self._n_windows += len(windows)
        self._n_identifications += len(identified)
        is_saved = outcome.state is not None
        if not (identified or is_saved):
            return False
        now = self._clock()
        for event in windows:
            self._archive(outcome.vehicle, boot, event)
            if self._lake is not None:
                self._lake.keep(outcome.vehicle, event.recording)
        done = seq if is_saved else -1
        progress = Progress(
            outcome.vehicle,
            boot,
            done_seq=done,
            delete_through_seq=done,
            observations=tuple(
                _numbered(event, window_document(event.observation, event.diagnosis)) for event in windows
            ),
            modes=modes,
            findings=tuple(_numbered(event, finding) for event in windows for finding in _findings(event)),
            baselines=tuple(_baseline(change.baseline, now) for change in changes if change.baseline is not None),
            snapshot=outcome.state,
            status=outcome.status._asdict(),
            now=now,
            modes_from=identified[0].number if identified and outcome.vehicle in self._reopened else None,
        )
        if not is_saved:
            self._waiting.append(progress)
            self._reopened.discard(outcome.vehicle)
            if len(self._waiting) >= _MAX_WAITING:
                self.flush()
            return False
        waiting = [each for each in self._waiting if each.vehicle == outcome.vehicle]
        self._store.results.commit(progress, *waiting)
        self._waiting = [each for each in self._waiting if each.vehicle != outcome.vehicle]
        if identified:
            self._reopened.discard(outcome.vehicle)
        for change in changes:
            if change.baseline is not None:
                learnt = {"version": change.baseline.version, "windows": change.baseline.n_windows}
                words = "baseline restored" if isinstance(change, Restored) else "baseline learnt"
                LOG.info(words, extra={"vehicle": outcome.vehicle, **learnt})
            elif outcome.status.is_learning and outcome.status.note:
                reason = {"reason": outcome.status.note}
                LOG.info("window not used for learning", extra={"vehicle": outcome.vehicle, **reason})
        return True

    def flush(self) -> None:
        """Store the results that wait, in one transaction.

        Raises
        ------
        StoreError
            If the store cannot write: they wait on. Those that it refuses are dropped.
        """
        waiting = self._waiting
        if not waiting:
            return
        try:
            self._store.results.commit(waiting[-1], *waiting[:-1])
        except RefusedError:
            for progress in waiting:
                self._store_alone(progress)
        except StoreError:
            self._waiting = waiting[-_MAX_WAITING:]
            raise
        else:
            self._waiting = []

    def update_alerts(self, vehicle: str, events: tuple[Event | Restored, ...]) -> None:
        """Raise, update and clear alerts according to windows, which clear those about the analysis.

        Raises
        ------
        StoreError
            If the store cannot write.
        """
        for event in events:
            if isinstance(event, Observed):
                self._alerts.take_window(vehicle, event, now=self._clock())
                for cause in _TROUBLES:
                    self._alerts.clear(vehicle, cause, now=self._clock())
                    self._warned.pop((vehicle, cause), None)

    def complete(self, vehicle: str, boot: int, seq: int) -> None:
        """Remove the frames of a boot up to a sequence number, which the stored state covers.

        Raises
        ------
        StoreError
            If the store cannot write.
        """
        self._store.results.commit(Progress(vehicle, boot, done_seq=seq, delete_through_seq=seq))

    def quarantine_frames(self, vehicle: str, boot: int, first: int, last: int, *, reason: str) -> None:
        """Quarantine the frames of a boot between two sequence numbers, and raise an alert.

        Raises
        ------
        StoreError
            If the store cannot write.
        """
        now = self._clock()
        self._n_frames_quarantined += self._store.quarantine.put_frames(
            vehicle, boot, first, last, reason=reason, now=now
        )
        self.warn(vehicle, "monitor:analysis", f"frames could not be analysed and were quarantined: {reason}")

    def quarantine_state(self, vehicle: str, *, reason: str) -> bool:
        """Quarantine the saved state of a vehicle, and raise an alert; return whether there was one.

        Raises
        ------
        StoreError
            If the store cannot write.
        """
        if not self._store.quarantine.put_state(vehicle, reason=reason, now=self._clock()):
            return False
        self._n_states_quarantined += 1
        sentence = (
            f"the saved state could not be used and was quarantined: {reason}; monitoring starts again from the "
            "baseline and the windows in the store, and no frame is left out"
        )
        self.warn(vehicle, "monitor:state", sentence)
        return True

    def warn(self, vehicle: str, cause: str, sentence: str) -> None:
        """Log a problem with the analysis of a vehicle, and raise an alert, unless it is the same as before.

        Raises
        ------
        StoreError
            If the store cannot write.
        """
        if self._warned.get((vehicle, cause)) != sentence:
            LOG.error(sentence, extra={"vehicle": vehicle})
            self._alerts.report(vehicle, cause, sentence, now=self._clock())
            self._warned[vehicle, cause] = sentence

    def store_report(self, frame: StoredFrame) -> None:
        """Store modes, or archive correlations, from a box; invalid ones are logged and removed.

        Raises
        ------
        StoreError
            If the store cannot write.
        """
        modes: tuple[tuple[int, int, dict[str, Any]], ...] = ()
        try:
            document = checked_map(frame.payload)
            if frame.kind == "modes":
                modes = ((document["number"], frame.t0, reported_modes(document)),)
            elif self._correlations is not None:
                archive_correlations(document, self._correlations, frame.vehicle)
        except SprungError as error:
            LOG.warning("report of a box discarded", extra={"vehicle": frame.vehicle, "reason": str(error)})
        self._store.results.commit(
            Progress(
                frame.vehicle,
                frame.boot,
                done_seq=frame.seq,
                delete_through_seq=frame.seq,
                modes=modes,
                now=self._clock(),
            )
        )

    def _store_alone(self, progress: Progress) -> None:
        """Store results by themselves, or drop them if the store refuses them."""
        try:
            self._store.results.commit(progress)
        except RefusedError as error:
            LOG.error("modes were not stored", extra={"vehicle": progress.vehicle, "reason": str(error)})
        self._waiting = [each for each in self._waiting if each is not progress]

    def _archive(self, vehicle: str, boot: int, event: Observed) -> None:
        """Write the samples of a window to the archive; a failure is only logged."""
        recording = event.recording
        if self._samples is None:
            return
        try:
            write_archive(
                self._samples,
                vehicle,
                boot,
                event.number,
                recording.start or 0,
                samples=recording.samples,
                channels=recording.names,
                sampling_rate=recording.sampling_rate,
                gaps=[(gap.index, gap.duration) for gap in recording.gaps],
                quantities=[channel.quantity for channel in recording.channels],
            )
        except (SprungError, OSError) as error:
            LOG.warning("samples were not archived", extra={"vehicle": vehicle, "reason": str(error)})


def _numbered(event: Observed, document: dict[str, Any]) -> tuple[int, int, dict[str, Any]]:
    """Return number, time and a document of a window."""
    return event.number, event.recording.start or 0, rounded(document, _OF_WINDOWS)


def window_document(observation: Observation, diagnosis: Diagnosis | None) -> dict[str, Any]:
    """Return the document of a window, with the conclusion of the diagnosis after it."""
    document = observation_document(observation)
    if diagnosis is None or diagnosis.detection is None:
        return document
    sentence, detectable = describe_diagnosis(diagnosis)[0], detectable_document(diagnosis.detectable)
    return {**document, "conclusion": Conclusion(diagnosis.verdict, sentence, detectable)._asdict()}


def _modes(event: Identified) -> tuple[int, int, dict[str, Any]]:
    """Return number, time and document of an identification."""
    return event.number, event.start or 0, {"modes": rounded(list(event.modes), _OF_MODES), "reason": event.reason}


def rounded(value: Any, digits: int) -> Any:
    """Return plain values with all floats rounded to significant digits."""
    if isinstance(value, float):
        return float(f"{value:.{digits}g}")
    if isinstance(value, dict):
        return {name: rounded(own, digits) for name, own in value.items()}
    if isinstance(value, list | tuple):
        return [rounded(own, digits) for own in value]
    return value


def _findings(event: Observed) -> list[dict[str, Any]]:
    """Return the findings of a window as documents."""
    return [] if event.diagnosis is None else [finding_document(finding) for finding in event.diagnosis.findings]


def _baseline(baseline: Baseline, now: int) -> tuple[int, int, str, dict[str, Any]]:
    """Return version, time, reason and document of a baseline that is in use from now on."""
    return baseline.version, now, baseline.reason, baseline_document(baseline).as_json()


def reported_modes(document: Mapping[Any, Any]) -> dict[str, Any]:
    """Return the modes in a report of a box, in the form of the store.

    Raises
    ------
    FormatError
        If they cannot be written as JSON.
    """
    modes = {"modes": document.get("modes"), "reason": document.get("reason"), "is_on_board": True}
    try:
        json.dumps(modes, allow_nan=False)  # a report that the store cannot hold would be sent repeatedly
    except (TypeError, ValueError) as error:
        raise FormatError(f"modes that cannot be stored: {error}") from None
    return modes


def archive_correlations(document: Mapping[Any, Any], folder: Path, vehicle: str) -> None:
    """Write the correlations in a report of a box to an archive.

    Raises
    ------
    FormatError
        If they are incomplete.
    StoreError
        If the archive cannot be written.
    """
    summary = document.get("summary")
    if not isinstance(summary, Mapping):
        raise FormatError("a report of correlations without a summary")
    average = summary_from_document(summary).average
    write_archive(
        folder,
        vehicle,
        count(document, Key.BOOT),
        count(document, "number"),
        count(document, Key.START),
        samples=average.values.reshape(-1, average.values.shape[-1]),
        channels=[f"{name}:{reference}" for name in average.channels for reference in average.references],
        sampling_rate=average.sampling_rate,
    )
