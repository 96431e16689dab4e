"""What a store holds that another process writes."""

import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

VEHICLE = "car-1"


def rows(store: Path, query: str) -> list[tuple[Any, ...]]:
    """Return what a query finds in a store that another process writes; nothing where there is none yet."""
    if not store.exists():
        return []
    with closing(sqlite3.connect(f"file:{store}?mode=ro", uri=True, timeout=30.0)) as connection:
        try:
            return connection.execute(query).fetchall()
        except sqlite3.OperationalError as error:
            if "no such table" in str(error):
                return []
            raise


def cursors(store: Path) -> dict[int, tuple[int, int, int]]:
    """Return contiguous, done and lost of every boot."""
    return {row[0]: row[1:] for row in rows(store, "SELECT boot, contiguous, done, lost FROM cursors")}


def contents(store: Path) -> dict[str, list[tuple[Any, ...]]]:
    """Return what was found out about the vehicle, whatever boots it came in."""
    return {
        "observations": rows(store, "SELECT number, t0, document FROM observations ORDER BY number"),
        "modes": rows(store, "SELECT number, t0, document FROM modes ORDER BY number"),
        "findings": rows(store, "SELECT number, place, t0, document FROM findings ORDER BY number, place"),
        "baselines": rows(store, "SELECT version, reason, document FROM baselines ORDER BY version"),
        "alerts": rows(
            store, f"SELECT cause, severity, text, is_active FROM alerts WHERE vehicle = '{VEHICLE}' ORDER BY cause"
        ),
        "history": rows(
            store,
            f"SELECT cause, what, who, comment FROM alert_history JOIN alerts ON alert = alerts.number"
            f" WHERE vehicle = '{VEHICLE}' ORDER BY cause, alert_history.id",
        ),
        "notifications": rows(
            store,
            f"SELECT cause, json_extract(notifications.document, '$.what'),"
            f" json_extract(notifications.document, '$.document.text')"
            f" FROM notifications JOIN alerts ON alert = alerts.number"
            f" WHERE vehicle = '{VEHICLE}' ORDER BY cause, notifications.id",
        ),
    }
