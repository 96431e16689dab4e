"""Debian's Chromium, which reaches this machine alone, and monitors with stores that it shows."""

import shutil
import sqlite3
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import Browser, BrowserContext, Dialog, Page, Request, Response, Route, expect, sync_playwright
from tests.journeys import depot
from tests.online.site.conftest import PASSWORD, _passwords_cost_little

from sprung.online.monitor import Site
from sprung.online.site import Context, Server, add_account
from sprung.online.site.accounts import log_in
from sprung.online.store import Store, open_store

__all__ = ["_passwords_cost_little"]

#: Playwright's own browser is never downloaded: this one comes with Debian.
CHROMIUM = Path("/usr/bin/chromium")
FLAGS = (
    "--no-sandbox",  # tests may run as root
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1, EXCLUDE localhost",
)
_LOOPBACK = {"127.0.0.1", "localhost"}
#: Longest time for a page, and for what it is to show, on a busy machine [s].
_PATIENCE, _SHOWN = 180, 30
expect.set_options(timeout=1000 * _SHOWN)
PEOPLE = {"viewer": "Anna", "engineer": "Eve", "admin": "Ada"}
#: A narrow phone, in CSS pixels.
PHONE = {"width": 360, "height": 740}


class Watch:
    """Collects what goes wrong on pages: errors, refused or failed requests, dialogs, foreign hosts."""

    def __init__(self) -> None:
        self.faults: list[str] = []
        #: Status codes that a test expects.
        self.expected: set[int] = set()

    def follow(self, context: BrowserContext) -> None:
        """Watch all pages of a browser context, and keep them from other hosts."""
        context.route(_is_foreign, self._block)
        context.on("page", self._follow_page)

    def _follow_page(self, page: Page) -> None:
        page.on("console", lambda message: self._note(message.type == "error", f"console: {message.text}"))
        page.on("pageerror", lambda error: self.faults.append(f"script: {error}"))
        page.on("requestfailed", self._failed)
        page.on("response", self._answered)
        page.on("dialog", self._refuse)

    def _refuse(self, dialog: Dialog) -> None:
        self.faults.append(f"dialog: {dialog.message}")
        dialog.dismiss()

    def _note(self, is_fault: bool, sentence: str) -> None:
        is_expected = any(f"status of {status}" in sentence for status in self.expected)
        if is_fault and not is_expected:
            self.faults.append(sentence)

    def _failed(self, request: Request) -> None:
        # The next page and a download cut requests off, such as the stream of events.
        self._note(request.failure != "net::ERR_ABORTED", f"failed: {request.url} {request.failure}")

    def _answered(self, response: Response) -> None:
        self._note(response.status >= 400 and response.status not in self.expected, f"{response.status} {response.url}")

    def _block(self, route: Route) -> None:
        self.faults.append(f"foreign host: {route.request.url}")
        route.abort()


def _is_foreign(url: str) -> bool:
    """Return whether an address is of another machine."""
    parts = urlsplit(url)
    return parts.scheme in {"http", "https", "ws", "wss"} and parts.hostname not in _LOOPBACK


@dataclass(frozen=True, eq=False)
class Monitor:
    """A store, and a server of its pages."""

    url: str
    store: Store
    context: Context

    def number_of(self, vehicle: str) -> int:
        """Return the number of the only active alert of a vehicle."""
        (row,) = self.store.alerts.find(vehicle=vehicle, is_active=True)
        return row.number

    def session_of(self, role: str) -> str:
        """Return the secret of a new session of the person with a role."""
        secret = log_in(self.store, PEOPLE[role], PASSWORD, now=time.time_ns())
        assert secret is not None
        return secret


@pytest.fixture(scope="module")  # while the driver is open, no other test of the process can run an event loop
def chromium() -> Iterator[Browser]:
    """Debian's Chromium; without it the test is skipped."""
    if not CHROMIUM.exists():
        pytest.skip(f"{CHROMIUM} is missing: run scripts/system-packages")
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture
def watch() -> Iterator[Watch]:
    """What goes wrong on the pages of a test, which fails in the end if anything did."""
    watching = Watch()
    yield watching
    assert not watching.faults


@pytest.fixture
def visit(chromium: Browser, watch: Watch) -> Iterator[Callable[..., Page]]:
    """Return a function that opens an empty page for a monitor, as a person with a role, with options of a context."""
    contexts = []

    def visited(monitor: Monitor, *, role: str = "", **options: Any) -> Page:
        context = chromium.new_context(base_url=monitor.url, **options)
        contexts.append(context)
        context.set_default_timeout(1000 * _PATIENCE)
        watch.follow(context)
        if role:
            context.add_cookies([{"name": "sprung_session", "value": monitor.session_of(role), "url": monitor.url}])
        return context.new_page()

    yield visited
    for context in contexts:
        context.close()


@pytest.fixture(scope="session")
def filled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the file of a store with a depot, to be copied."""
    path = tmp_path_factory.mktemp("depot") / "depot.sqlite"
    with open_store(f"sqlite:///{path}") as store:
        depot.fill(store, now=time.time_ns())
    with sqlite3.connect(path) as connection:
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    connection.close()
    return path


@pytest.fixture
def serve(filled: Path, tmp_path: Path) -> Iterator[Callable[..., Monitor]]:
    """Return a function of roles with an account, that serves a copy of the depot."""
    with ExitStack() as opened:

        def served(*roles: str) -> Monitor:
            copy = shutil.copy(filled, tmp_path / "depot.sqlite")
            return opened.enter_context(serving(f"sqlite:///{copy}", roles))

        yield served


@pytest.fixture(scope="session")
def shown(filled: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Monitor]:
    """A depot with an account of each role, for tests that only look at it."""
    copy = tmp_path_factory.mktemp("shown") / "depot.sqlite"
    shutil.copy(filled, copy)
    with serving(f"sqlite:///{copy}", tuple(PEOPLE)) as monitor:
        yield monitor


@contextmanager
def serving(url: str, roles: Sequence[str] = (), **fields: Any) -> Iterator[Monitor]:
    """Yield a monitor's pages of a store, with accounts of roles."""
    with open_store(url) as store:
        for role in roles:
            add_account(store, PEOPLE[role], role, PASSWORD, who="test", now=time.time_ns())
        site = Site.model_validate({"http": "127.0.0.1:0", "name": "Depot North", **fields})
        context = Context(store, site, figures=lambda: FIGURES, problems=list)
        server = Server(context)
        server.open()
        try:
            yield Monitor("http://{}:{}".format(*server.address), store, context)
        finally:
            server.close()


#: Figures of a monitor that works.
FIGURES = {
    "sprung_vehicles": 214.0,
    "sprung_store_writable": 1.0,
    "sprung_frames_total": 512_300.0,
    "sprung_windows_total": 5123.0,
    "sprung_analysis_cpu_seconds_total": 12_040.0,
    "sprung_failures_total": 0.0,
    "sprung_backlog_frames": 12.0,
    "sprung_backlog_age_seconds": 1.5,
    'sprung_heartbeat_age_seconds{loop="station"}': 0.1,
    'sprung_heartbeat_age_seconds{loop="analysis"}': 2.5,
    'sprung_heartbeat_age_seconds{loop="post log"}': 4.0,
}
