"""A world of boxes, broker and one or two monitors under a seed: it goes wrong, heals, and must be as if it had not."""

import sqlite3
from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from analysis import InlineWorkers
from chance import RATES, TAKEOVERS, Chance
from checker import Checker, Place, ViolationError
from monitor import SENDERS, Monitor, Reservations, empty_store, new_station, opened
from network import Broker, SimulatedLink
from vehicle import CHANNEL, Vehicle, description

from sprung.link import VERSION, Key, message, topic
from sprung.online.monitor import Station

#: Largest number of rounds without faults until all is delivered.
_ROUNDS = 600
#: One seed of so many has a second monitor that stands by.
_TWO = 4


@dataclass(frozen=True, slots=True)
class Report:
    """What came of one seed.

    Parameters
    ----------
    seed, steps
        Seed and number of its steps.
    faults
        Number of faults of each kind.
    digest
        Digest of all that happened.
    failure
        The promise that was broken; empty if none was.
    frames, acknowledgements, windows, messages
        Numbers of frames recorded, acknowledgements published, windows stored, messages passed on to people.
    """

    seed: int
    steps: int
    faults: dict[str, int]
    digest: str
    failure: str = ""
    frames: int = 0
    acknowledgements: int = 0
    windows: int = 0
    messages: int = 0


class World:
    """Boxes, a broker, and a monitor; with some seeds a second one that stands by, as on PostgreSQL.

    Parameters
    ----------
    seed
        Seed of all that happens.
    folder
        Folder for the store.
    on_line
        Function that receives each line of the trace.
    """

    def __init__(self, seed: int, folder: Path, *, on_line: Callable[[str], None] | None = None) -> None:
        self._reservations = Reservations() if seed % _TWO == _TWO // 2 else None
        rates = RATES if self._reservations is None else RATES | TAKEOVERS
        self.chance = Chance(seed, rates=rates, on_line=on_line)
        path = folder / "store.sqlite"
        for file in folder.glob("store.sqlite*"):
            file.unlink()
        path.touch(mode=0o600)
        path.write_bytes(empty_store())
        self.checker = Checker(path, self.chance)
        self.broker = Broker(self.chance, on_acknowledgement=self.checker.acknowledge)
        self.vehicles = [
            Vehicle(f"car-{number}", self.broker, self.chance, self.checker)
            for number in range(1, self.chance.random.randint(1, 3) + 1)
        ]
        names = ("monitor",) if self._reservations is None else ("monitor", "monitor 2")
        self.monitors = [
            Monitor(
                name,
                path,
                broker=self.broker,
                chance=self.chance,
                checker=self.checker,
                reservations=self._reservations,
            )
            for name in names
        ]
        self._folder = folder
        pace = self.chance.random.choice((0.05, 0.2, 1.0))
        self._pause = lambda: self.chance.random.expovariate(1 / pace)

    def run(self, steps: int) -> None:
        """Let everything go wrong for a number of steps, then heal, and check.

        Raises
        ------
        ViolationError
            If a promise is broken.
        """
        for _ in range(steps):
            self.chance.now += self._pause()
            self._act()
            self._break()
            self._recover(0.1)
        self._heal()
        analysed = self.checker.finish(SENDERS)
        self._compare(analysed)

    def close(self) -> None:
        """Release the files."""
        for monitor in self.monitors:
            if monitor.is_on:
                monitor.end()
        self.checker.close()

    def _act(self) -> None:
        """Let one of the processes do something."""
        random = self.chance.random
        vehicle, monitor = random.choice(self.vehicles), self._one_monitor()
        acts: list[tuple[Callable[[], None], int]] = [
            (vehicle.produce, 4),
            (vehicle.step, 4),
            (self._deliver, 8),
            (monitor.step, 4),
            (monitor.post, 1),
        ]
        random.choices([act for act, _ in acts], [weight for _, weight in acts])[0]()

    def _one_monitor(self) -> Monitor:
        """Return a monitor, whichever works."""
        return self.monitors[0] if self._reservations is None else self.chance.random.choice(self.monitors)

    def _deliver(self) -> None:
        for _ in range(self.chance.random.randint(1, 8)):
            self.broker.deliver()

    def _break(self) -> None:
        """Let something fail that no call of a process is the occasion for."""
        chance = self.chance
        vehicle = chance.random.choice(self.vehicles)
        if vehicle.is_on and chance.happens("box killed", vehicle.name):
            vehicle.kill("kill")
        if vehicle.is_on and chance.happens("box loses power", vehicle.name):
            vehicle.kill("power")
        if vehicle.is_on and chance.happens("box stopped", vehicle.name):
            vehicle.stop()
        vehicle.disk.is_full |= chance.happens("disk of a box full", vehicle.name)
        vehicle.disk.is_read_only |= chance.happens("disk of a box read-only", vehicle.name)
        monitor = self._one_monitor()
        if monitor.is_on and chance.happens("monitor killed"):
            monitor.kill()
        if self._reservations is not None:
            if chance.happens("reservation lost at once"):
                self._reservations.holder = None
            for name in (vehicle.name, monitor.name):
                chance.set_clock(name)
        if chance.happens("disk of the store short"):
            self._set_free(10**6)
        if chance.happens("broker crashes"):
            self.broker.crash()
        if self.broker.links:
            link = chance.random.choice(self.broker.links)
            if link.is_connected and chance.happens("connection lost", link.name):
                self.broker.lose(link)
            if link.is_connected and chance.happens("connection silently cut", link.name):
                link.is_cut = True

    def _recover(self, probability: float) -> None:
        """Let something recover that failed."""
        random = self.chance.random
        for vehicle in self.vehicles:
            if not vehicle.is_on and random.random() < probability:
                vehicle.start()
            if random.random() < probability / 2:
                vehicle.disk.is_full = vehicle.disk.is_read_only = False
        for monitor in self.monitors:
            if not monitor.is_on and random.random() < probability:
                monitor.start()
        if random.random() < probability / 2:
            self._set_free(10**12)
        for link in list(self.broker.links):
            if link.is_cut and random.random() < probability:
                self.broker.lose(link)
            if not link.is_connected and random.random() < probability * 2:
                self.chance.note("connected", link.name)
                self.broker.connect(link)

    def _set_free(self, n_bytes: int) -> None:
        """Set the free space beside the store [bytes]."""
        for monitor in self.monitors:
            monitor.free = n_bytes

    def _heal(self) -> None:
        """End all faults, and go on until everything is delivered."""
        self.chance.note("HEALING")
        self.chance.is_on = False
        for number in range(_ROUNDS):
            self.chance.now += 0.5 if number < _ROUNDS // 2 else 60.0
            self._recover(1.0)
            for vehicle in self.vehicles:
                vehicle.step()
            while self.broker.n_under_way:
                self.broker.deliver()
            for monitor in self.monitors:
                monitor.step()
                monitor.step()  # the boxes report in every round, and a station that has just taken that is not idle
                monitor.post()
            if number > 20 and self._is_done():
                return
        raise ViolationError(f"all is well again, but not everything is done after {_ROUNDS} rounds: {self._left()}")

    def _is_done(self) -> bool:
        return not any(self._left().values())

    def _left(self) -> dict[str, Any]:
        """Return what is still to be done."""
        station = next((one.station for one in self.monitors if one.is_on and one.station._is_active), None)
        if station is None:
            return {"a monitor that works": True}
        return {
            "boxes that wait": [vehicle.name for vehicle in self.vehicles if not vehicle.is_drained],
            "frames that wait": station.figures()["sprung_backlog_frames"],
            "station at work": not station.is_idle,
            "messages to people": self._unsent(),
            "problems": station.problems(),
        }

    def _unsent(self) -> int:
        with sqlite3.connect(self._folder / "store.sqlite") as reader:
            (count,) = reader.execute(
                "SELECT count(*) FROM notifications WHERE sent IS NULL AND given_up IS NULL"
            ).fetchone()
        reader.close()
        return int(count)

    def _compare(self, analysed: dict[str, list[Place]]) -> None:
        """Compare all tables with those of an undisturbed monitor that received the same frames."""
        path = self._folder / "undisturbed.sqlite"
        for file in self._folder.glob("undisturbed.sqlite*"):
            file.unlink()
        path.touch(mode=0o600)
        path.write_bytes(empty_store())
        url = f"sqlite:///{path}"
        payloads = self.checker.payloads
        with opened(url) as store:
            quiet = Chance(0, rates=dict.fromkeys(RATES, 0.0))
            broker = Broker(quiet, on_acknowledgement=lambda _vehicle, _payload: None)
            undisturbed = new_station(
                store,
                url,
                connect=partial(SimulatedLink, broker, "monitor"),
                workers=InlineWorkers(quiet),
                senders=[],
                now=lambda: quiet.now,
            )
            undisturbed.open()
            for vehicle, places in analysed.items():
                undisturbed.receive(topic(vehicle, "meta"), message(_announcement()))
                for boot, end in self.checker.ends(vehicle).items():
                    for place in places:
                        if place[0] == boot:
                            undisturbed.receive(topic(vehicle, "raw"), payloads[vehicle, place])
                    _settle(undisturbed)  # frames first: what arrived is not lost
                    state = {Key.VERSION: VERSION, "boots": [[boot, end, -1]]}
                    undisturbed.receive(topic(vehicle, "state"), message(state))
                    _settle(undisturbed)
        differing = different(self._folder / "store.sqlite", path, without=self.checker.reordered)
        if differing:
            raise ViolationError(f"other than without faults: {differing}")


def _settle(station: Station) -> None:
    """Let a station work until it has nothing to do."""
    station.step()
    while not station.is_idle:
        station.step()


def _announcement() -> dict[Any, Any]:
    """Return the announcement of a vehicle."""
    return {
        Key.VERSION: VERSION,
        Key.CONFIGURATION: "",
        "description": description(),
        "quantities": {CHANNEL: "acceleration"},
    }


_TABLES = {
    "observations": "SELECT vehicle, boot, number, t0, document FROM observations ORDER BY vehicle, number",
    "modes": "SELECT vehicle, boot, number, t0, document FROM modes ORDER BY vehicle, number",
    "findings": "SELECT vehicle, boot, number, place, document FROM findings ORDER BY vehicle, number, place",
    "snapshots": "SELECT vehicle, boot, seq, document FROM snapshots ORDER BY vehicle",
    "frames": "SELECT frames.vehicle, frames.boot, seq FROM frames JOIN cursors ON cursors.vehicle = frames.vehicle"
    " AND cursors.boot = frames.boot WHERE seq <= contiguous ORDER BY frames.vehicle, frames.boot, seq",
    "alerts": "SELECT vehicle, cause, severity, text, is_active, is_acknowledged, count FROM alerts"
    " WHERE cause LIKE 'sensor:%' ORDER BY vehicle, cause",
    "history": "SELECT vehicle, cause, what FROM alert_history JOIN alerts ON alerts.number = alert"
    " WHERE cause LIKE 'sensor:%' AND what NOT IN ('undelivered', 'delivered', 'abandoned')"
    " ORDER BY vehicle, cause, alert_history.id",
    "notifications": "SELECT vehicle, cause, json_extract(notifications.document, '$.what') FROM notifications"
    " JOIN alerts ON alerts.number = alert WHERE cause LIKE 'sensor:%' ORDER BY vehicle, cause, notifications.id",
}


def different(path: Path, other: Path, *, without: Collection[str] = ()) -> str:
    """Return the first difference between two stores, up to times and some vehicles; empty if there is none."""
    with sqlite3.connect(path) as one, sqlite3.connect(other) as two:
        for name, query in _TABLES.items():
            rows, expected = ([row for row in store.execute(query) if row[0] not in without] for store in (one, two))
            if rows != expected:
                place = next(
                    (k for k, pair in enumerate(zip(rows, expected, strict=False)) if pair[0] != pair[1]),
                    min(len(rows), len(expected)),
                )
                return (
                    f"{name}: {len(rows)} rows instead of {len(expected)}, row {place} is"
                    f" {rows[place:][:1]} instead of {expected[place:][:1]}"
                )
    return ""


def run(seed: int, steps: int, folder: Path, *, on_line: Callable[[str], None] | None = None) -> Report:
    """Return what came of a seed."""
    world = World(seed, folder, on_line=on_line)
    failure = ""
    try:
        world.run(steps)
    except ViolationError as violation:
        failure = str(violation)
    except Exception as error:
        failure = f"{type(error).__name__}: {error}"
        if on_line is not None:
            raise
    finally:
        try:
            world.close()
        except ViolationError as violation:
            failure = failure or str(violation)
    counts = world.checker.counts
    return Report(seed, steps, dict(world.chance.counts), world.chance.digest, failure, **counts)
