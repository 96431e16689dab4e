"""Times of pages and interface with a large fleet, on SQLite and PostgreSQL: whole answers, as a browser gets them.

    python benchmarks/fleet_pages.py [--vehicles 100000] [--alerts 100000] [--repeats 3]

A quarter of the alerts is active; every fiftieth vehicle learns, every hundredth is silent; one alert in twenty has a
verdict of the workshop. PostgreSQL runs for the time of the measurement, in a folder of its own.
"""

import argparse
import random
import tempfile
import time
from collections.abc import Callable
from statistics import median

from chaos.servers import Database, postgresql
from httpx2 import Response
from starlette.testclient import TestClient

from sprung.online.monitor import Site
from sprung.online.site import Context, application
from sprung.online.store import Store, open_store
from sprung.online.store.schema import ALERT_HISTORY, ALERTS, BASELINES, STATUSES, VEHICLES, VERDICTS

NOW = 1_795_219_200_000_000_000
HOUR = 3600 * 10**9
SECOND = 10**9
CAUSES = ("front_left.spring", "front_right.damper", "rear_left.tyre", "sensor:acc_rr", "silent")
WORDS = ("confirmed", "another part", "nothing found", "not looked at")
BATCH = 2000
PAGES = (
    ("fleet", "/"),
    ("fleet, deep", "/?cursor={deep}"),
    ("fleet, search", "/?text=0999"),
    ("fleet, search that finds nothing", "/?text=tram"),
    ("fleet, critical", "/?step=critical"),
    ("fleet, learning", "/?is_learning=true"),
    ("fleet, silent", "/?is_silent=true"),
    ("fleet, mine", "/?assignee=eve"),
    ("fleet, unacknowledged", "/?is_unacknowledged=true"),
    ("counts of the fleet", "/api/v1/counts"),
    ("vehicle", "/vehicles/bus-000077"),
    ("alerts", "/alerts"),
    ("alerts, deep", "/alerts?is_complete=true&cursor=200~0~0"),
    ("alerts, shelved", "/alerts?state=shelved"),
    ("alerts of one vehicle", "/alerts?vehicle=bus-000077"),
    ("alerts, mine", "/alerts?assignee=eve"),
    ("counts of alerts", "/api/v1/alert-counts"),
    ("alert", "/alerts/77"),
    ("site", "/site"),
)


def main() -> None:
    """Measure, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vehicles", type=int, default=100_000)
    parser.add_argument("--alerts", type=int, default=100_000)
    parser.add_argument("--repeats", type=int, default=3)
    given = parser.parse_args()
    columns = {}
    with tempfile.TemporaryDirectory() as folder:
        columns["SQLite"] = measured(f"sqlite:///{folder}/store.sqlite", given)
    try:
        with postgresql() as server:
            columns["PostgreSQL"] = measured(Database(server, "fleet").url, given)
    except SystemExit as error:
        print(f"PostgreSQL was left out: {error}\n")
    print(f"{given.vehicles:,} vehicles, {given.alerts:,} alerts")
    print(f"Median (processor time of the server) of {given.repeats} answers [ms]\n")
    print(f"| page | {' | '.join(columns)} |")
    print(f"|---|{'---|' * len(columns)}")
    for name, _ in PAGES:
        print(f"| {name} | {' | '.join(times[name] for times in columns.values())} |")


def measured(url: str, given: argparse.Namespace) -> dict[str, str]:
    """Return the times of all pages with a new store."""
    with open_store(url) as store:
        fill(store, given.vehicles, given.alerts)
        ticks = iter(range(0, 10**9, 3600))
        context = Context(
            store,
            Site(),
            figures=lambda: {"sprung_store_writable": 1.0},
            problems=list,
            clock=lambda: NOW,
            timer=lambda: float(next(ticks)),
        )
        with TestClient(application(context), base_url="http://127.0.0.1:8737") as client:
            deep = f"0~0.0~bus-{given.vehicles * 9 // 10:06d}"
            return {
                name: timed(lambda path=path: client.get(path.format(deep=deep)), given.repeats) for name, path in PAGES
            }


def timed(ask: Callable[[], Response], repeats: int) -> str:
    """Return the median time of an answer, and of the processor for it [ms], in words."""
    times, own = [], []
    for _ in range(repeats):
        begin, own_begin = time.perf_counter(), time.process_time()
        answer = ask()
        times.append(1000 * (time.perf_counter() - begin))
        own.append(1000 * (time.process_time() - own_begin))
        if answer.status_code != 200:
            raise RuntimeError(f"{answer.request.url} answered {answer.status_code}: {answer.text[:300]}")
    return f"{median(times):.0f} ({median(own):.0f})"


def fill(store: Store, n_vehicles: int, n_alerts: int) -> None:
    """Fill a store; its tables are written directly, as the monitor would take a day."""
    chance = random.Random(1)
    database = store
    with database.writing() as connection:
        for first in range(0, n_vehicles, BATCH):
            numbers = range(first, min(first + BATCH, n_vehicles))
            connection.execute(VEHICLES.insert(), [vehicle(k) for k in numbers])
            connection.execute(STATUSES.insert(), [status(k) for k in numbers])
            connection.execute(BASELINES.insert(), [baseline(k) for k in numbers])
        for first in range(1, n_alerts + 1, BATCH):
            numbers = range(first, min(first + BATCH, n_alerts + 1))
            connection.execute(ALERTS.insert(), [alert(k, n_vehicles, chance) for k in numbers])
            connection.execute(ALERT_HISTORY.insert(), [event(k) for k in numbers])
            connection.execute(VERDICTS.insert(), [verdict(k, chance) for k in numbers if k % 20 == 0])
        if connection.dialect.name == "postgresql":
            connection.exec_driver_sql("ANALYZE")


def vehicle(k: int) -> dict[str, object]:
    """Return a row of a vehicle."""
    return {
        "vehicle": f"bus-{k:06d}",
        "configuration": "c" * 16,
        "description": "x" * 2000,
        "channels": [[name, "m/s^2"] for name in ("acc_fl", "acc_fr", "acc_rl", "acc_rr")],
        "first_seen": NOW - 90 * 24 * HOUR,
        "is_parked": False,
        "last_seen": NOW - (48 * HOUR if k % 100 == 3 else k % 60 * SECOND),
    }


def status(k: int) -> dict[str, object]:
    """Return a row of the progress of a vehicle."""
    document: dict[str, object] = {"share": 0.1, "n_learnt": 4, "n_needed": 12, "note": "", "until": NOW}
    document["is_learning"] = k % 50 == 0
    return {
        "vehicle": f"bus-{k:06d}",
        "document": document | {"window": 600.0, "repeated": 0.0},
        "is_learning": k % 50 == 0,
    }


def baseline(k: int) -> dict[str, object]:
    """Return a row of a baseline."""
    document = {"n_windows": 12, "mean": [0.0] * 12}
    return {
        "vehicle": f"bus-{k:06d}",
        "version": 1,
        "created": NOW - 80 * 24 * HOUR,
        "reason": "",
        "document": document,
    }


def alert(k: int, n_vehicles: int, chance: random.Random) -> dict[str, object]:
    """Return a row of an alert."""
    is_active = k % 4 == 0
    cause = CAUSES[k % len(CAUSES)]
    raised = raised_at(k)
    evidence = {
        "change": -0.2,
        "interval": [-0.22, -0.18],
        "since": raised / 1e9 - 7200,
        "advice": "inspect it",
        "x": "x" * 400,
    }
    return {
        "number": k,
        "vehicle": f"bus-{k * 7919 % n_vehicles:06d}",
        "cause": cause,
        "severity": chance.randrange(1, 1001),
        "text": "front-left spring 20 % softer (18 to 22 %) since 12 Nov; inspect before the next 500 km",
        "is_active": is_active,
        "is_acknowledged": k % 3 != 0,
        "shelved_until": NOW + HOUR if k % 97 == 0 else None,
        "raised": raised,
        "updated": raised,
        "cleared": None if is_active else raised + HOUR,
        "count": 1,
        "assignee": "eve" if k % 211 == 0 else None,
        "evidence": evidence,
        "streak": 1,
        "worst": 0,
    }


def raised_at(k: int) -> int:
    """Return when an alert was raised, UTC ns."""
    return NOW - (k * 7919 % (60 * 24 * 3600) + 1) * SECOND


def event(k: int) -> dict[str, object]:
    """Return a row of the history of an alert."""
    return {
        "alert": k,
        "time": NOW - HOUR,
        "what": "raised",
        "who": "",
        "comment": "",
        "assignee": None,
        "shelved_until": None,
    }


def verdict(k: int, chance: random.Random) -> dict[str, object]:
    """Return a row of what the workshop found."""
    word = chance.choices(WORDS, (6, 1, 2, 1))[0]
    part = "bush" if word == "another part" else ""
    return {
        "alert": k,
        "time": NOW,
        "who": "eve",
        "verdict": word,
        "part": part,
        "action": "",
        "raised": raised_at(k),
        "request": None,
    }


if __name__ == "__main__":
    main()
