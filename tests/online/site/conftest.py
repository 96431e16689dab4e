"""A fleet in a store, and a client of the application."""

import json
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from typing import ClassVar

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from pwdlib import PasswordHash
from pwdlib.hashers.argon2 import Argon2Hasher
from starlette.testclient import TestClient
from tests.online.store.conftest import postgresql_server, postgresql_url

from sprung.fleet.lake import AddedFile, Table, file_name
from sprung.online.alerts import AlertSettings, Report, reported
from sprung.online.monitor import Site
from sprung.online.monitor.alert_book import AlertBook
from sprung.online.site import Context, add_account, application
from sprung.online.site import accounts as accounts_module
from sprung.online.store import Progress, StoredFrame, open_store

__all__ = ["postgresql_server", "postgresql_url"]

NOW = 1_795_219_200_000_000_000
HOUR = 3600 * 10**9
PASSWORD = "correct horse battery"
ROLES = ("viewer", "engineer", "admin")
FIGURES = {"sprung_store_writable": 1.0, "sprung_frames_total": 5.0}


@pytest.fixture(autouse=True, scope="session")
def _passwords_cost_little():
    """Hashes that take microseconds instead of a tenth of a second."""
    with pytest.MonkeyPatch.context() as patch:
        hasher = PasswordHash((Argon2Hasher(time_cost=1, memory_cost=8, parallelism=1),))
        patch.setattr(accounts_module, "_hasher", lambda: hasher)
        yield


def fill(opened):
    """Three vehicles; the spring of the first is soft (alert 1), the second is silent (alert 2)."""
    for name, seen in (("bus-1", NOW), ("bus-2", NOW - 5 * HOUR), ("bus-3", NOW)):
        opened.inbox.put_vehicle(name, configuration="c", description="", channels=[["acc_fl", "m/s^2"]], now=seen)
    evidence = {"change": -0.2, "interval": [-0.22, -0.18]}
    raise_alert(
        opened, "bus-1", "front_left.spring", 700, "front-left spring 20 % softer", evidence=evidence, now=NOW - HOUR
    )
    AlertBook(opened, AlertSettings()).report("bus-2", "silent", "bus-2 has sent nothing", now=NOW - HOUR)
    opened.inbox.add_frames([StoredFrame("bus-1", 1, seq, NOW, b"x") for seq in range(9)], now=NOW)
    status = {"share": 0.0, "n_learnt": 12, "n_needed": 12, "until": NOW}
    windows = tuple((k, NOW + k * 600 * 10**9, {"time": k}) for k in range(5))
    opened.results.commit(
        Progress(
            "bus-1",
            1,
            done_seq=8,
            observations=windows,
            modes=windows[:1],
            findings=windows[3:],
            baselines=((1, NOW, "first learning", {"n_windows": 12}),),
            status=status,
            now=NOW,
        )
    )


def raise_alert(store, vehicle, cause, severity=700, text="text", *, evidence=None, now=NOW):
    """Raise an alert, and return its number."""
    report = Report(vehicle, cause, severity, text, evidence or {})
    AlertBook(store, AlertSettings()).put(reported(None, report, AlertSettings(), now), now=now)
    return next(row.number for row in store.alerts.find(vehicle=vehicle) if row.cause == cause)


@pytest.fixture
def store(sqlite_url):
    """Three vehicles; the spring of the first is soft (alert 1), the second is silent (alert 2)."""
    with open_store(sqlite_url) as opened:
        fill(opened)
        yield opened


@pytest.fixture
def serve(store):
    """Function of site settings that returns the context and a client; the clock stands still."""
    opened = []

    def served(*, figures=FIGURES, problems=(), advice=(), diagrams=None, **fields):
        site = Site.model_validate(fields)
        context = Context(
            store,
            site,
            figures=lambda: figures,
            problems=lambda: list(problems),
            advice=lambda: advice,
            clock=lambda: NOW,
        )
        app = application(context, diagrams=diagrams)
        client = TestClient(app, base_url="http://127.0.0.1:8737", raise_server_exceptions=False)
        opened.append(client)
        return context, client

    yield served
    for client in opened:
        client.close()


@pytest.fixture
def people(store):
    """Anna is a viewer, Eve an engineer, Ada an administrator."""
    names = {"viewer": "anna", "engineer": "eve", "admin": "ada"}
    for role, name in names.items():
        add_account(store, name, role, PASSWORD, who="test", now=NOW)
    return names


@pytest.fixture
def log_in(serve, people):
    """Function of a role that returns a client that is logged in, and the headers of its acts."""

    def logged_in(role):
        _, client = serve()
        answer = client.post("/api/v1/session", json={"name": people[role], "password": PASSWORD})
        assert answer.status_code == 200, answer.text
        return client, {"X-CSRF-Token": answer.json()["csrf_token"]}

    return logged_in


#: Columns of the results of runs that the pages read.
_RUN = pa.schema(
    [
        ("vehicle", pa.string()),
        ("type", pa.string()),
        ("verdict", pa.string()),
        ("severity", pa.string()),
        ("e_value", pa.float64()),
        ("is_discovery", pa.bool_()),
        ("n_windows", pa.int64()),
        ("since", pa.int64()),
        ("until", pa.int64()),
        ("reason", pa.string()),
        ("document", pa.string()),
    ]
)


def run_row(vehicle, verdict="no_change_detected", severity=None, *, is_discovery=False, reason=None):
    """Return the diagnosis of a vehicle as a run stores it."""
    return {
        "vehicle": vehicle,
        "type": "bus",
        "verdict": verdict,
        "severity": severity,
        "e_value": None if verdict == "inconclusive" else 1.5,
        "is_discovery": is_discovery,
        "n_windows": 7,
        "since": NOW - HOUR,
        "until": NOW,
        "reason": reason,
        "document": "{}",
    }


def write_run(folder, rows):
    """Replace the results of the fleet, as a run does."""
    table = Table(folder / "diagnoses", _RUN)
    table.create()
    name = file_name({})
    path = folder / "diagnoses" / name
    pq.write_table(pa.Table.from_pylist(rows, _RUN), path)
    table.commit([AddedFile(name, path.stat().st_size, len(rows))], replaces=True)


class _Receiver(BaseHTTPRequestHandler):
    """A server that takes documents, and answers with its `status`."""

    status = 204
    received: ClassVar[list[tuple[str | None, dict[str, object]]]] = []

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers["Content-Length"]))
        self.received.append((self.headers["Idempotency-Key"], json.loads(body)))
        self.send_response(self.status)
        self.end_headers()

    def log_message(self, *_: object) -> None:
        """Write nothing."""


@pytest.fixture
def receiver():
    """Class and address of a server that keeps what is sent to it."""
    handler = type("Receiver", (_Receiver,), {"received": []})
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = Thread(target=server.serve_forever)
        thread.start()
        yield handler, f"http://127.0.0.1:{server.server_port}/orders"
        server.shutdown()
        thread.join()
