"""Stores on both databases; PostgreSQL runs privately, in a folder of its own, for the time of the tests."""

import getpass
import os
import pwd
import shutil
import signal
import subprocess
import tempfile
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path

import psycopg
import pytest
from sqlalchemy import event

from sprung.online.store import open_store

NUMBERS = count()
#: Nothing of it must outlast the tests, so that it need not wait for the disk.
SETTINGS = ("listen_addresses=''", "fsync=off", "shared_buffers=16MB", "max_connections=40")


def binary(name):
    """Return a program of PostgreSQL, or None."""
    installed = sorted(Path("/usr/lib/postgresql").glob(f"*/bin/{name}"))
    return shutil.which(name) or (str(installed[-1]) if installed else None)


def who_runs_it():
    """Return the user that PostgreSQL runs as, which cannot be root, or None."""
    if os.geteuid() != 0:
        return getpass.getuser()
    try:
        return pwd.getpwnam("postgres").pw_name
    except KeyError:
        return None


@contextmanager
def running_server(initdb, pg_ctl, user):
    """Run PostgreSQL without a network and yield the folder of its socket."""
    folder = Path(tempfile.mkdtemp(prefix="sprung-pg-"))  # the path of a socket has at most 107 characters
    as_user = ["runuser", "-u", user, "--"] if os.geteuid() == 0 else []
    if as_user:
        shutil.chown(folder, user)
    options = " ".join([f"-k {folder}", *(f"-c {setting}" for setting in SETTINGS)])

    def run(*command):
        subprocess.run([*as_user, *command], check=True, capture_output=True, cwd="/")

    try:
        run(initdb, "-D", f"{folder}/data", "-A", "trust", "-U", "sprung", "-E", "UTF8", "--locale=C", "--no-sync")
        run(pg_ctl, "-D", f"{folder}/data", "-l", f"{folder}/log", "-o", options, "-w", "start")
        try:
            yield folder
        finally:
            run(pg_ctl, "-D", f"{folder}/data", "-m", "immediate", "-w", "stop")
    finally:
        shutil.rmtree(folder)


@pytest.fixture(scope="session")
def postgresql_server():
    """The folder of the socket of a server."""
    initdb, pg_ctl, user = binary("initdb"), binary("pg_ctl"), who_runs_it()
    if not (initdb and pg_ctl):
        pytest.skip("no initdb and pg_ctl: install PostgreSQL")
    if user is None:
        pytest.skip("root cannot run PostgreSQL, and there is no user postgres")
    with running_server(initdb, pg_ctl, user) as folder:
        yield folder


def _signal(processes, number):
    """Send a signal to those processes that still run: a worker of the server may end at any time."""
    for process in processes:
        with suppress(ProcessLookupError):
            os.kill(process, number)


@pytest.fixture
def frozen_server(postgresql_server):
    """A context in which all processes of the server are stopped, as by a disk or machine that hangs."""

    @contextmanager
    def frozen():
        server = int((postgresql_server / "data" / "postmaster.pid").read_text().split()[0])
        children = Path(f"/proc/{server}/task/{server}/children").read_text(encoding="utf-8").split()
        processes = [server, *map(int, children)]
        _signal(processes, signal.SIGSTOP)
        try:
            yield
        finally:
            _signal(processes, signal.SIGCONT)

    return frozen


@pytest.fixture
def postgresql_url(postgresql_server):
    """The address of an empty database."""
    name = f"test_{next(NUMBERS)}"
    with psycopg.connect(host=str(postgresql_server), user="sprung", dbname="postgres", autocommit=True) as connection:
        connection.execute(f"CREATE DATABASE {name}")
    return f"postgresql://sprung@/{name}?host={postgresql_server}"


@pytest.fixture
def sqlite_file(tmp_path: Path):
    """A file that is not there yet, in a folder that is not there either."""
    return tmp_path / "new" / "store.sqlite"


@pytest.fixture(params=["sqlite", "postgresql"])
def url(request: pytest.FixtureRequest):
    """The address of an empty store."""
    if request.param == "sqlite":
        return f"sqlite:///{request.getfixturevalue('sqlite_file')}"
    return request.getfixturevalue("postgresql_url")


@pytest.fixture(params=[pytest.param("sqlite_url", id="sqlite"), pytest.param("postgresql_url", id="postgresql")])
def store(request: pytest.FixtureRequest):
    """An empty store."""
    with open_store(request.getfixturevalue(request.param)) as opened:
        yield opened


@pytest.fixture
def statements(store):
    """A context that yields the statements that the store executes in it."""

    @contextmanager
    def watched():
        executed = []

        def note(connection, cursor, statement, *_):
            executed.append(statement)

        event.listen(store.engine, "before_cursor_execute", note)
        try:
            yield executed
        finally:
            event.remove(store.engine, "before_cursor_execute", note)

    return watched


@pytest.fixture
def small_disk(tmp_path: Path):
    """A disk of 2 MB of its own, and a function that makes it read-only or writable."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=2m", "tmpfs", folder], check=False)
    if mounted.returncode != 0:
        pytest.skip("only root can mount a small disk")

    def remount(mode):
        subprocess.run(["mount", "-o", f"remount,{mode}", folder], check=True)

    yield folder, remount
    subprocess.run(["umount", "-l", folder], check=True)
