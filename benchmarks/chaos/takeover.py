"""Whether a monitor and one that stands by come to the results of an undisturbed one, whoever works at the moment.

    boxes (one process, live) -> mosquitto -> monitors -> PostgreSQL, messages to people -> a web server

The monitor that works is killed (SIGKILL) or ended in good order (SIGTERM) and started again, or the connection that
reserves the store for it is cut. In the end every table, and every message that people got, must be that of one
undisturbed monitor.

Run as `python benchmarks/chaos/takeover.py`.
"""

import argparse
import json
import os
import random
import re
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from processes import MOSQUITTO, SPRUNG, Program, broker, free_port, tail, until
from servers import Database, Mailbox, postgresql

from fleet import WINDOW, Fleet
from sprung.online.store.database import MONITOR_LOCK

#: What is compared, in an order that does not depend on when it was stored, without row numbers and times of the clock.
_OWN = "vehicle <> 'monitor'"
TABLES = {
    "vehicles": "SELECT vehicle, configuration, description, channels, is_parked FROM vehicles ORDER BY vehicle",
    "frames": "SELECT vehicle, boot, seq FROM frames ORDER BY 1, 2, 3",
    "cursors": "SELECT vehicle, boot, contiguous, done, lost FROM cursors ORDER BY 1, 2",
    "observations": "SELECT vehicle, boot, number, t0, md5(document) FROM observations ORDER BY 1, 2, 3",
    "modes": "SELECT vehicle, boot, number, t0, md5(document) FROM modes ORDER BY 1, 2, 3",
    "findings": "SELECT vehicle, boot, number, place, t0, md5(document) FROM findings ORDER BY 1, 2, 3, 4",
    "baselines": "SELECT vehicle, version, reason, document FROM baselines ORDER BY 1, 2",
    "snapshots": "SELECT vehicle, boot, seq, md5(document) FROM snapshots ORDER BY 1",
    "statuses": "SELECT vehicle, document FROM statuses ORDER BY 1",
    "alerts": f"SELECT vehicle, cause, severity, text, is_active, is_acknowledged, count, assignee FROM alerts"
    f" WHERE {_OWN} ORDER BY 1, 2",
    "history": f"SELECT vehicle, cause, what, who, comment FROM alert_history JOIN alerts ON alert = alerts.number"
    f" WHERE {_OWN} ORDER BY 1, 2, alert_history.id",
    "notifications": f"SELECT vehicle, cause, notifications.document::json ->> 'what', notifications.document::json"
    f" ->> 'text', sent IS NULL FROM notifications JOIN alerts ON alert = alerts.number WHERE {_OWN}"
    f" ORDER BY 1, 2, notifications.id",
}
#: Parts of a message that depend on the clock and on the order of alerts of different vehicles.
_CHANGING = {"time", "key", "number", "raised", "updated", "cleared", "link"}
#: Longest time until another monitor has taken over [s].
_TAKE_OVER = 30.0
#: Server process and name of the monitor that works: it holds the lock with the number of `store.reservation`.
_HOLDER = (
    "SELECT pid, application_name FROM pg_locks JOIN pg_stat_activity USING (pid) WHERE locktype = 'advisory'"
    f" AND granted AND mode = 'ExclusiveLock' AND (classid::bigint << 32) + objid::bigint = {MONITOR_LOCK}"
    " AND pg_locks.database = (SELECT oid FROM pg_database WHERE datname = current_database())"
)
#: Names of all monitors that are connected.
_MONITORS = (
    "SELECT DISTINCT application_name FROM pg_stat_activity WHERE datname = current_database()"
    " AND position('process' IN application_name) > 0"
)
_TIME = re.compile(r"\d{4}-\d\d-\d\d[T ][\d:.]+Z?")


@dataclass(frozen=True)
class Plan:
    """Monitors, vehicles, how many of them drive, windows of each, length of the storm, time between its events [s]."""

    monitors: int
    vehicles: int
    driving: int
    windows: int
    seconds: float
    every: float
    patience: float
    seed: int


@dataclass
class Result:
    """What a run came to."""

    plan: Plan
    events: Counter[str] = field(default_factory=Counter)
    frames: int = 0
    sent: int = 0
    acknowledgements: int = 0
    acknowledged_not_stored: int = 0
    rows: dict[str, int] = field(default_factory=dict)
    empty: list[str] = field(default_factory=list)
    differs: list[str] = field(default_factory=list)
    messages: int = 0
    messages_missing: int = 0
    messages_repeated: int = 0
    #: Times until another monitor, or the same one again, worked on the store, where one stood by [s].
    takeovers: list[float] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)
    seconds_to_the_end: float = 0.0

    @property
    def is_kept(self) -> bool:
        """Whether every promise was kept, and shown by tables that are not empty and acknowledgements."""
        broken = (self.acknowledged_not_stored, self.differs, self.messages_missing, self.failures)
        is_soon = max(self.takeovers, default=0.0) <= _TAKE_OVER
        return not any(broken) and not self.empty and is_soon and (self.acknowledgements >= 100 or not self.events)


class Rig:
    """A broker, monitors on a database, and the mailbox of people, in a folder."""

    def __init__(self, folder: Path, plan: Plan, database: Database, *, monitors: int) -> None:
        folder.mkdir(parents=True)
        taken: set[int] = set()
        port = free_port(taken)
        self.url, self.database, self.mailbox = f"mqtt://127.0.0.1:{port}", database, Mailbox()
        self.broker = broker("broker", port, folder)
        self.broker.start()
        self.monitors = [self._monitor(folder, plan, number, free_port(taken)) for number in range(monitors)]

    def _monitor(self, folder: Path, plan: Plan, number: int, port: int) -> Program:
        site = folder / f"site-{number}.toml"
        site.write_text(
            f'schema = "sprung.site/1"\nstore = "{self.database.url}"\nhttp = "127.0.0.1:{port}"\n'
            f'broker = "{self.url}"\n'
            f"[watch]\nwindow_minutes = {WINDOW / 60}\nidentify_every_minutes = {WINDOW / 60}\nlearning_windows = 2\n"
            f"[alerts]\nclear_after_windows = 1\n[keep]\nraw_days = 0\n"
            f'[[send.webhook]]\nurl = "{self.mailbox.url}"\n'
        )
        program = Program(f"monitor-{number}", lambda: [*SPRUNG, "monitor", "--site", str(site)], folder)
        program.start()
        return program

    def is_finished(self, plan: Plan) -> bool:
        """Return whether all windows are stored, and all messages sent."""
        ((n_windows,),) = self.database.rows("SELECT count(*) FROM observations")
        ((n_waiting,),) = self.database.rows("SELECT count(*) FROM notifications WHERE sent IS NULL")
        return n_windows >= plan.vehicles * plan.windows and not n_waiting

    def contents(self) -> dict[str, list[tuple[Any, ...]]]:
        """Return all tables, without times of the clock in sentences."""
        tables = {name: self.database.rows(query) for name, query in TABLES.items()}
        return {name: [tuple(map(timeless, row)) for row in rows] for name, rows in tables.items()}

    def messages(self) -> Counter[tuple[str, str]]:
        """Return the messages that people got, without times and numbers, with the key of each, and how often each."""
        own = [message for message in self.mailbox.messages if message["vehicle"] != "monitor"]
        kept = [{name: value for name, value in one.items() if name not in _CHANGING} for one in own]
        texts = [timeless(json.dumps(message, sort_keys=True)) for message in kept]
        return Counter((text, str(one["key"])) for text, one in zip(texts, own, strict=True))

    def close(self) -> None:
        for program in (*self.monitors, self.broker):
            program.end(signal.SIGTERM)
        self.mailbox.close()


@contextmanager
def rig(folder: Path, plan: Plan, server: Path, *, monitors: int) -> Iterator[Rig]:
    """Return a rig on a new database, taken down in the end."""
    database = Database(server, folder.name)
    made = Rig(folder, plan, database, monitors=monitors)
    try:
        # Nobody may begin before the tables are there.
        until(lambda: has_tables(database), timeout=120.0, what="the tables")
        yield made
    finally:
        made.close()
        database.close()


def has_tables(database: Database) -> bool:
    """Return whether the store has its tables, and a monitor works on it."""
    return bool(database.rows(_HOLDER))


def timeless(value: Any) -> Any:
    """Return a value without the times of the clock that a sentence states."""
    return _TIME.sub("TIME", value) if isinstance(value, str) else value


def different(messages: Counter[tuple[str, str]]) -> Counter[str]:
    """Return how many different messages of each contents people got: a repetition has the key of the first."""
    return Counter(text for text, _ in messages)


class Storm:
    """Kills or ends the monitor that works, or cuts its reservation; it strikes again after the take-over.

    The first event of each kind waits for a monitor that stands by. Later ones may come before that is up again.
    """

    def __init__(self, one: Rig, plan: Plan, result: Result) -> None:
        self._rig = one
        self._plan = plan
        self._result = result
        self._random = random.Random(plan.seed)

    def run(self, say: Callable[[str], None]) -> None:
        """Rage for the planned time."""
        end = time.monotonic() + self._plan.seconds
        while time.monotonic() < end:
            time.sleep(self._random.uniform(0.5, 1.5) * self._plan.every)
            self._strike(say)

    def _strike(self, say: Callable[[str], None]) -> None:
        """Do something to the monitor that works, and wait until one works again."""
        # The first three are one of each kind.
        kinds = ["kill", "cut", "end"]
        n_events = sum(self._result.events.values())
        if n_events < len(kinds):
            until(self._stands_by, timeout=120.0, what="a monitor that stands by")
        ((session, name),) = until(self._holder, timeout=60.0, what="a monitor that works")
        program = next(one for one in self._rig.monitors if name.endswith(f"process {one.pid}"))
        stood_by = self._stands_by()
        kind = kinds[n_events] if n_events < len(kinds) else self._random.choices(kinds, (6, 3, 1))[0]
        self._result.events[kind] += 1
        say(f"{kind} {program.name}")
        number = signal.SIGKILL if kind == "kill" else signal.SIGTERM
        begun = time.monotonic()
        if kind == "cut":
            self._rig.database.rows("SELECT pg_terminate_backend(%s)", session)
        else:
            program.send(number)
        if stood_by:
            self._wait_for_other(session, name)
            self._result.takeovers.append(round(time.monotonic() - begun, 1))
        if kind != "cut":
            program.end(number)
            program.start()
        self._wait_for_other(session, name)

    def _wait_for_other(self, session: int, name: str) -> None:
        """Wait until another session, of another monitor or of the same one again, holds the reservation."""
        until(lambda: self._holder() not in ([], [(session, name)]), timeout=120.0, what="a take-over")

    def _stands_by(self) -> bool:
        """Return whether a monitor is connected besides the one that works."""
        return len(self._rig.database.rows(_MONITORS)) > 1

    def _holder(self) -> list[tuple[Any, ...]]:
        return self._rig.database.rows(_HOLDER)


def run(plan: Plan, folder: Path, say: Callable[[str], None]) -> Result:
    """Run one monitor undisturbed and two through the storm, and compare."""
    result = Result(plan)
    pace = WINDOW * plan.windows / plan.seconds
    with ExitStack() as stack:
        server = stack.enter_context(postgresql())
        calm = stack.enter_context(rig(folder / "calm", plan, server, monitors=1))
        drive(calm, plan, None, Result(plan), lambda: None)
        expected, people = calm.contents(), different(calm.messages())
        for program in calm.monitors:
            program.end(signal.SIGTERM)
        say(f"undisturbed: {len(expected['observations'])} windows, {sum(people.values())} messages")
        one = stack.enter_context(rig(folder / "storm", plan, server, monitors=plan.monitors))
        try:
            drive(one, plan, pace, result, lambda: Storm(one, plan, result).run(say))
        except TimeoutError as error:
            result.failures.append(str(error))
        for program in one.monitors:
            if program.exit_code is not None:
                result.failures.append(f"{program.name} ended by itself: {tail(program.log)}")
        found, got = one.contents(), one.messages()
    result.rows = {name: len(rows) for name, rows in found.items()}
    result.empty = [name for name, n_rows in result.rows.items() if not n_rows and plan.driving and name != "frames"]
    result.differs = [name for name in TABLES if found[name] != expected[name]]
    received = different(got)
    result.messages = sum(received.values())
    result.messages_missing = sum(((people - received) + (received - people)).values())
    result.messages_repeated = sum(got.values()) - len(got)
    (folder / "messages.differs").write_text(f"{people - received}\n{received - people}")
    for name in result.differs:
        (folder / f"{name}.differs").write_text(f"{set(expected[name]) ^ set(found[name])}")
    return result


def drive(one: Rig, plan: Plan, pace: float | None, result: Result, disturb: Callable[[], None]) -> None:
    """Let the fleet drive while something disturbs the monitors, and wait for the end."""

    def check(vehicle: str, seq: int) -> None:
        """Check that what is acknowledged is stored at this moment."""
        stored = checking.rows("SELECT contiguous FROM cursors WHERE vehicle = %s AND boot = 1", vehicle)
        result.acknowledged_not_stored += not stored or stored[0][0] < seq

    checking = one.database.again()
    fleet = Fleet(one.url, plan.vehicles, windows=plan.windows, pace=pace, check=check, driving=plan.driving)
    try:
        disturb()
        calm = time.monotonic()
        until(lambda: fleet.is_done, timeout=plan.patience, what="all frames acknowledged")
        until(lambda: one.is_finished(plan), timeout=plan.patience, what="all windows stored and messages sent")
        result.seconds_to_the_end = round(time.monotonic() - calm, 1)
    finally:
        result.frames = plan.vehicles * fleet.n_frames
        result.sent, result.acknowledgements = fleet.sent, fleet.acknowledgements
        fleet.close()
        checking.close()


def as_document(result: Result) -> dict[str, Any]:
    """Return the fields of a result, with which `asdict` alone would make pairs of the counts of events."""
    return asdict(result) | {"events": dict(result.events), "is_kept": result.is_kept}


def table(result: Result) -> str:
    """Return the result as lines."""
    fields = as_document(result)
    return "\n".join(f"{name.replace('_', ' '):26} {value}" for name, value in fields.items())


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--monitors", type=int, default=2)
    parser.add_argument("--vehicles", type=int, default=300)
    parser.add_argument("--driving", type=int, default=3, help="of the vehicles: the others stand")
    parser.add_argument("--windows", type=int, default=10, help="of each vehicle, two minutes each")
    parser.add_argument("--seconds", type=float, default=600.0, help="length of the storm")
    parser.add_argument("--every", type=float, default=6.0, help="mean time between its events [s]")
    parser.add_argument("--patience", type=float, default=300.0, help="for the end after the storm [s]")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path, help="folder for logs; default: one that is removed")
    parser.add_argument("--json", action="store_true", help="one JSON object instead of a table")
    given = vars(parser.parse_args())
    if MOSQUITTO is None:
        parser.error("there is no mosquitto: install Debian's package (scripts/system-packages)")
    keep, is_json = given.pop("keep"), given.pop("json")
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("stopped"))
    with tempfile.TemporaryDirectory() as temporary:
        result = run(Plan(**given), keep or Path(temporary), lambda text: print(text, file=sys.stderr, flush=True))
    print(json.dumps(as_document(result)) if is_json else table(result))
    return 0 if result.is_kept else 1


if __name__ == "__main__":
    sys.exit(main())
