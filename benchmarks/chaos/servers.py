"""A private PostgreSQL, and a server that people's messages are posted to."""

import getpass
import json
import os
import pwd
import shutil
import subprocess
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from copy import copy
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import psycopg

_BINARIES = sorted(Path("/usr/lib/postgresql").glob("*/bin"))
#: Only monitors are killed: the server need not wait for the disk.
_SETTINGS = ("listen_addresses=''", "fsync=off", "shared_buffers=128MB", "max_connections=100")


@contextmanager
def postgresql() -> Iterator[Path]:
    """Run PostgreSQL and yield the folder of its socket."""
    if not _BINARIES:
        raise SystemExit("there is no PostgreSQL: install Debian's package (scripts/system-packages)")
    folder = Path(tempfile.mkdtemp(prefix="sprung-pg-"))  # the path of a socket has at most 107 characters
    user = pwd.getpwnam("postgres").pw_name if os.geteuid() == 0 else getpass.getuser()
    as_user = ["runuser", "-u", user, "--"] if os.geteuid() == 0 else []
    if as_user:
        shutil.chown(folder, user)
    options = " ".join([f"-k {folder}", *(f"-c {setting}" for setting in _SETTINGS)])

    def run(name: str, *arguments: str) -> None:
        command = [*as_user, str(_BINARIES[-1] / name), "-D", f"{folder}/data", *arguments]
        subprocess.run(command, check=True, capture_output=True, cwd="/")

    try:
        run("initdb", "-A", "trust", "-U", "sprung", "-E", "UTF8", "--locale=C", "--no-sync")
        run("pg_ctl", "-l", f"{folder}/log", "-o", options, "-w", "start")
        try:
            yield folder
        finally:
            run("pg_ctl", "-m", "immediate", "-w", "stop")
    finally:
        shutil.rmtree(folder)


class Database:
    """One database of a server, read by one thread."""

    def __init__(self, folder: Path, name: str) -> None:
        self.url = f"postgresql://sprung@/{name}?host={folder}"
        with psycopg.connect(host=str(folder), user="sprung", dbname="postgres", autocommit=True) as server:
            server.execute(f"CREATE DATABASE {name}")
        self._connection = self._connect()

    def again(self) -> "Database":
        """Return another connection, for another thread."""
        other = copy(self)
        other._connection = self._connect()
        return other

    def _connect(self) -> "psycopg.Connection[tuple[Any, ...]]":
        return psycopg.connect(self.url, autocommit=True)

    def rows(self, query: str, *values: object) -> list[tuple[Any, ...]]:
        """Return what a query finds."""
        return self._connection.execute(query, values).fetchall()

    def close(self) -> None:
        self._connection.close()


class Mailbox:
    """A web server that keeps what is posted to it."""

    def __init__(self) -> None:
        self.messages: list[dict[str, Any]] = []
        messages = self.messages

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                messages.append(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
                self.send_response(200)
                self.end_headers()

            def log_message(self, *_: object) -> None:
                pass

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self._server.server_address[1]}/"

    def close(self) -> None:
        self._server.shutdown()
        self._server.server_close()
