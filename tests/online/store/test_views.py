"""Views for dashboards by SQL state what the store holds, on both databases."""

from pathlib import Path

import pytest
import sqlalchemy as sa

from sprung.online.alerts import AlertSettings, Report, reported
from sprung.online.monitor.alert_book import AlertBook
from sprung.online.store import VerdictRow
from sprung.online.store.schema import OBSERVATIONS

VIEWS = Path(__file__).parents[3] / "deploy" / "views.sql"
DAY = 86_400 * 10**9
NOW = 20_000 * DAY + 5 * 10**9


@pytest.fixture
def rows(store):
    """Return a function from a view to its rows; the views are made twice, as after an upgrade."""
    lines = [line for line in VIEWS.read_text(encoding="utf-8").splitlines() if not line.startswith("--")]
    with store.alerts._database.writing() as connection:
        for statement in ["\n".join(lines)] * 2:
            for part in filter(str.strip, statement.split(";")):
                connection.execute(sa.text(part))

    def read(view):
        with store.alerts._database.reading() as connection:
            return [dict(row) for row in connection.execute(sa.text(f"SELECT * FROM {view}")).mappings()]

    return read


def test_a_vehicle_its_alert_and_the_verdict_of_the_workshop(store, rows) -> None:
    for name in ("bus-1", "bus-2"):
        store.inbox.put_vehicle(name, configuration="c", description="", channels=[["acc_fl", "m/s^2"]], now=NOW)
    report = Report("bus-1", "front_left.spring", 700, "front-left spring 20 % softer", {})
    AlertBook(store, AlertSettings()).put(reported(None, report, AlertSettings(), NOW), now=NOW)
    (alert,) = store.alerts.find(vehicle="bus-1")
    store.verdicts.add(VerdictRow(alert.number, NOW + DAY, "anna", "confirmed", "front_left.spring", "replaced", NOW))
    seconds = NOW // 10**9
    first, second = sorted(rows("dashboard_vehicles"), key=lambda row: row["vehicle"])
    assert (first["vehicle"], first["last_seen"], first["active_alerts"], first["severity"]) == (
        "bus-1",
        seconds,
        1,
        700,
    )
    assert (second["active_alerts"], second["severity"], second["frames_lost"]) == (0, 0, 0)
    assert (second["baseline"], bool(second["is_learning"])) == (None, False)
    (shown,) = rows("dashboard_alerts")
    assert (shown["number"], shown["sentence"], shown["raised"]) == (alert.number, alert.text, seconds)
    assert (shown["cleared"], bool(shown["is_active"])) == (None, True)
    (verdict,) = rows("dashboard_verdicts")
    assert (verdict["vehicle"], verdict["verdict"], verdict["stated"]) == ("bus-1", "confirmed", seconds + 86_400)
    window = {"vehicle": "bus-1", "boot": 1, "document": {}, "stored": NOW}
    windows = [window | {"number": number, "t0": NOW + number * DAY // 3} for number in range(5)]
    with store.alerts._database.writing() as connection:
        connection.execute(OBSERVATIONS.insert(), windows)
    days = {row["day"]: row["windows"] for row in rows("dashboard_windows")}
    assert days == {20_000 * 86_400: 3, 20_001 * 86_400: 2}
