"""The protocol broken on purpose, one way at a time: the checker must find each."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from dataclasses import replace
from typing import Any
from unittest.mock import patch

from disk import SimulatedDisk
from sqlalchemy import delete

from sprung.link import Key, Sending, Spool, checked_map, message, parse_topic, topic
from sprung.link import spool as spool_module
from sprung.link.windows import FrameOrder
from sprung.online.monitor import failures, station
from sprung.online.monitor.alert_book import AlertBook, Context
from sprung.online.monitor.dispatch import Dispatch, FrameCache
from sprung.online.monitor.intake import Intake
from sprung.online.monitor.notifier import Notifier
from sprung.online.store import Store, StoredFrame, StoreError, inbox
from sprung.online.store.inbox import Inbox, Quarantine
from sprung.online.store.results import Results
from sprung.online.store.schema import FRAMES

Patches = Iterator[AbstractContextManager[Any]]


class Apart:
    """A store in which what is written in one context is several transactions."""

    def __init__(self, store: Store) -> None:
        self._store = store

    def together(self) -> AbstractContextManager[None]:
        return nullcontext()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._store, name)


def not_together() -> AbstractContextManager[Any]:
    """Store a window, its alerts and its progress one by one, each of them as a whole."""
    commit = Dispatch._commit

    def mutant(self: Dispatch, *given: Any) -> None:
        with patch.object(self, "_store", Apart(self._store)):
            commit(self, *given)

    return patch.object(Dispatch, "_commit", mutant)


def acknowledges_before_it_stores() -> Patches:
    take = Intake.take

    def mutant(self: Intake, messages: Any, *, now: int) -> Any:
        batch = list(messages)
        for name, payload in batch:
            vehicle, what = parse_topic(name)
            if what == "raw":
                document = checked_map(payload)
                numbers = {Key.VERSION: 1, Key.BOOT: document[Key.BOOT], Key.SEQ: document[Key.SEQ]}
                self._publish(topic(vehicle, "ack"), message(numbers))
        return take(self, batch, now=now)

    yield patch.object(Intake, "take", mutant)


def acknowledges_one_too_many() -> Patches:
    init = Intake.__init__

    def mutant(self: Intake, context: Context, publish: Callable[[str, bytes], object], **options: Any) -> None:
        def generous(name: str, payload: bytes) -> object:
            document = checked_map(payload)
            if name.endswith("/ack"):
                document[Key.SEQ] += 1
            return publish(name, message(document))

        init(self, context, generous, **options)

    yield patch.object(Intake, "__init__", mutant)


def removes_what_the_broker_confirmed() -> Patches:
    due = Sending.due

    def mutant(self: Sending, now: float) -> Any:
        for boot, seq, payload in due(self, now):
            yield boot, seq, payload
            self._spool.acknowledge(boot, seq)

    yield patch.object(Sending, "due", mutant)


def never_sends_again() -> Patches:
    yield patch.object(Sending, "start_again", lambda _self, _now: None)


def stores_duplicates_again() -> Patches:
    add = Inbox.add_frames

    def mutant(self: Inbox, frames: Any, **options: Any) -> Any:
        reached = add(self, frames, **options)
        with self._database.writing() as connection:
            for frame in frames:
                connection.execute(self._database.insert(FRAMES).values(frame._asdict()).on_conflict_do_nothing())
        return reached

    yield patch.object(Inbox, "add_frames", mutant)


def passes_over_gaps() -> Patches:
    yield patch.object(inbox, "_run", lambda batch, after: max([after, *batch]))


def stores_the_state_before_the_window() -> Patches:
    commit = Results.commit

    def mutant(self: Results, progress: Any, *before: Any) -> None:
        commit(self, replace(progress, observations=(), modes=(), findings=(), baselines=()))
        commit(self, replace(progress, snapshot=None), *before)

    yield patch.object(Results, "commit", mutant)
    yield not_together()


def removes_frames_before_it_stores_the_state() -> Patches:
    commit = Results.commit

    def mutant(self: Results, progress: Any, *before: Any) -> None:
        commit(self, replace(progress, snapshot=None, observations=(), modes=()), *before)
        commit(self, progress)

    yield patch.object(Results, "commit", mutant)
    yield not_together()


def stores_alerts_after_the_window() -> Patches:
    yield not_together()


def goes_on_with_a_worker_ahead_of_the_store() -> Patches:
    settle = Dispatch.settle

    def mutant(self: Dispatch, outcome: Any) -> None:
        with patch.object(self._workers, "close_vehicle", lambda _vehicle: None) as _:
            try:
                settle(self, outcome)
            except StoreError:
                order = self._vehicles[outcome.vehicle].order
                order.dispatched |= {max(order.contiguous): max(order.contiguous.values())}
                raise

    yield patch.object(Dispatch, "settle", mutant)


def does_not_wait_for_the_boot_before() -> Patches:
    yield patch.object(FrameOrder, "_is_ready", lambda _self, _first: True)


def accepts_torn_records() -> Patches:
    header = spool_module._HEADER

    def mutant(data: bytes) -> Iterator[tuple[int, int, bytes]]:
        place = 0
        while place + header.size + 4 <= len(data):
            _, boot, seq, length = header.unpack_from(data, place)
            end = place + header.size + length
            yield boot, seq, data[place + header.size : end]
            place = end + 4

    yield patch.object(spool_module, "_intact", mutant)


def writes_on_behind_a_torn_record() -> Patches:
    write = Spool._write
    torn: set[str] = set()

    def mutant(self: Spool, record: bytes) -> None:
        try:
            with patch.object(self._disk, "truncate", lambda _file, _size: None):
                write(self, record)
        except OSError:
            torn.update(("_close", "_drop_oldest"))  # what follows a failure
            raise

    def kept(name: str) -> AbstractContextManager[Any]:
        act = getattr(Spool, name)
        return patch.object(Spool, name, lambda self: torn.discard(name) if name in torn else act(self))

    yield patch.object(Spool, "_write", mutant)
    yield kept("_close")
    yield kept("_drop_oldest")


def does_not_sync_the_folder() -> Patches:
    yield patch.object(SimulatedDisk, "sync_folder", lambda _self, _folder: None)


def does_not_sync_frames() -> Patches:
    yield patch.object(SimulatedDisk, "sync", lambda _self, _handle: None)


def declares_a_frame_too_many_lost() -> Patches:
    boots = Spool.boots.fget
    assert boots is not None
    yield patch.object(Spool, "boots", property(lambda self: {boot: first + 1 for boot, first in boots(self).items()}))


def takes_an_acknowledgement_for_all_boots() -> Patches:
    acknowledge = Spool.acknowledge

    def mutant(self: Spool, boot: int, seq: int) -> None:
        for held in {file.boot for file in self._files} | {boot}:
            acknowledge(self, held, seq)

    yield patch.object(Spool, "acknowledge", mutant)


def records_messages_as_sent_before_it_sends_them() -> Patches:
    def mutant(self: Notifier) -> bool:
        now = self._context.clock()
        row = self._store.alerts.next_notification(self.name, now=now)
        if row is None:
            return False
        self._settle(row, "", now)
        self._attempt(row)
        return True

    yield patch.object(Notifier, "send", mutant)


def sends_messages_without_recording_it() -> Patches:
    settle = Notifier._settle

    def mutant(self: Notifier, row: Any, error: str, now: int) -> None:
        settle(self, row, error or ("" if now // 10**7 % 3 else "forgotten"), now)

    yield patch.object(Notifier, "_settle", mutant)


def hands_over_past_what_memory_lacks() -> Patches:
    def mutant(self: FrameCache, vehicle: str, boot: int, *, after: int, until: int, limit: int) -> list[StoredFrame]:
        held = sorted(self._frames.get(vehicle, {}).items())
        return [frame for (of, seq), frame in held if of == boot and after < seq <= until][:limit]

    yield patch.object(FrameCache, "following", mutant)


def hands_over_repeats() -> Patches:
    def mutant(self: FrameCache, vehicle: str, boot: int, *, after: int, until: int, limit: int) -> list[StoredFrame]:
        held = sorted(self._frames.get(vehicle, {}).items())
        return [frame for (of, seq), frame in held if of == boot and seq <= until][:limit]

    yield patch.object(FrameCache, "following", mutant)
    yield patch.object(FrameCache, "release", lambda *_: None)


def forgets_losses() -> Patches:
    yield patch.object(Spool, "_lose", lambda _self, _loss: None)


def forgets_losses_at_a_restart() -> Patches:
    yield patch.object(Spool, "_write_losses", lambda _self: None)


def conceals_losses_from_people() -> Patches:
    yield patch.object(AlertBook, "report_lost", lambda *_, **__: None)


def quarantines_frames_at_the_first_failure() -> Patches:
    yield patch.object(failures, "_MAX_FAILURES", 1)


def forgets_quarantined_frames() -> Patches:
    def mutant(self: Quarantine, vehicle: str, boot: int, first: int, last: int, **_: Any) -> int:
        chosen = (FRAMES.c.vehicle == vehicle, FRAMES.c.boot == boot, FRAMES.c.seq.between(first, last))
        with self._database.writing() as connection:
            return connection.execute(delete(FRAMES).where(*chosen)).rowcount

    yield patch.object(Quarantine, "put_frames", mutant)


#: What the protocol does wrong, by the way in which it is broken.
def checks_the_reservation_once_a_minute_alone() -> Patches:
    yield patch.object(Store, "checked", lambda _self, _check: nullcontext())
    yield patch.object(station, "_CHECK", 60.0)


MUTANTS: dict[str, Callable[[], Patches]] = {
    function.__name__.replace("_", " "): function
    for function in (
        acknowledges_before_it_stores,
        acknowledges_one_too_many,
        removes_what_the_broker_confirmed,
        never_sends_again,
        stores_duplicates_again,
        passes_over_gaps,
        stores_the_state_before_the_window,
        removes_frames_before_it_stores_the_state,
        stores_alerts_after_the_window,
        goes_on_with_a_worker_ahead_of_the_store,
        does_not_wait_for_the_boot_before,
        accepts_torn_records,
        writes_on_behind_a_torn_record,
        does_not_sync_the_folder,
        does_not_sync_frames,
        declares_a_frame_too_many_lost,
        takes_an_acknowledgement_for_all_boots,
        records_messages_as_sent_before_it_sends_them,
        sends_messages_without_recording_it,
        hands_over_past_what_memory_lacks,
        hands_over_repeats,
        forgets_losses,
        forgets_losses_at_a_restart,
        conceals_losses_from_people,
        quarantines_frames_at_the_first_failure,
        forgets_quarantined_frames,
        checks_the_reservation_once_a_minute_alone,
    )
}

#: Seeds of 400 steps that find what few seeds find: where a trial may begin that is to be short.
RARE = {
    "never sends again": 3,
    "stores the state before the window": 10,
    "removes frames before it stores the state": 4,
    "stores alerts after the window": 7,
    "goes on with a worker ahead of the store": 13,
    "does not wait for the boot before": 109,
    "writes on behind a torn record": 2,
    "takes an acknowledgement for all boots": 3,
    "hands over past what memory lacks": 4,
    "forgets losses at a restart": 4,
    "quarantines frames at the first failure": 5,
    "forgets quarantined frames": 53,
    "checks the reservation once a minute alone": 14,
}


@contextmanager
def broken(name: str) -> Iterator[None]:
    """Break the protocol in a way; empty: leave it as it is."""
    with ExitStack() as stack:
        for change in MUTANTS[name]() if name else ():
            stack.enter_context(change)
        yield
