"""Fixtures of all tests."""

import os
import pwd
import random
import shutil
import signal
import socket
import subprocess
import time
import tracemalloc
from contextlib import contextmanager, suppress
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy: matrices are small, more threads only wait

import pytest
from hypothesis import settings

settings.register_profile("same every time", derandomize=True)
settings.load_profile("same every time")

DATA = Path(os.environ.get("SPRUNG_DATA", Path(__file__).parents[2] / "shared" / "data"))


@pytest.fixture
def real_file():
    """Return a function from a path below the real recordings to the file; it skips the test where that is absent."""

    def find(name):
        path = DATA / name
        if not path.exists():
            pytest.skip(f"no {name} among the real recordings: set SPRUNG_DATA to their folder")
        return path

    return find


@pytest.fixture
def memory_below():
    """Return a context that fails where more bytes than given are taken at once meanwhile, or `kept` after it."""

    @contextmanager
    def bounded(most, *, kept=None):
        tracemalloc.start()
        try:
            yield
            left, peak = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
        assert peak < most
        assert kept is None or left < kept

    return bounded


def violations(value, schema, definitions, place="document"):
    """Yield where a value breaks a JSON Schema, as far as those of the package go; a key that it does not list, too."""
    if "$ref" in schema:
        schema = definitions[schema["$ref"].removeprefix("#/$defs/")]
    choices = schema.get("anyOf")
    if choices is not None:
        if not any(not list(violations(value, choice, definitions)) for choice in choices):
            yield f"{place} fits none of {choices}"
        return
    if "const" in schema and value != schema["const"]:
        yield f"{place} is {value!r}, not {schema['const']!r}"
    if "enum" in schema and value not in schema["enum"]:
        yield f"{place} is {value!r}, not one of {schema['enum']}"
    types = schema.get("type", [])
    if types and not any(_has_type(value, name) for name in ([types] if isinstance(types, str) else types)):
        yield f"{place} is {value!r}, not {types}"
    elif isinstance(value, dict):
        yield from _object_violations(value, schema, definitions, place)
    elif isinstance(value, list):
        items = schema.get("prefixItems", [schema.get("items", {})] * len(value))
        if len(items) != len(value):
            yield f"{place} has {len(value)} entries, not {len(items)}"
        for k, (item, rule) in enumerate(zip(value, items, strict=False)):
            yield from violations(item, rule, definitions, f"{place}[{k}]")


def _object_violations(value, schema, definitions, place):
    known, rest = schema.get("properties", {}), schema.get("additionalProperties", "properties" not in schema)
    yield from (f"{place} lacks {name}" for name in schema.get("required", []) if name not in value)
    for name, member in value.items():
        rule = known.get(name, rest)
        if rule is False:
            yield f"{place} has an unknown {name}"
        elif rule is not True:
            yield from violations(member, rule, definitions, f"{place}.{name}")


def _has_type(value, name):
    if isinstance(value, bool):
        return name == "boolean"
    kinds = {"object": dict, "array": list, "string": str, "integer": int, "number": (int, float), "null": type(None)}
    return name in kinds and isinstance(value, kinds[name])


@pytest.fixture(scope="session")
def check_document():
    """Return a function that checks a JSON document against the JSON Schema that its key `schema` names."""
    from sprung.documents import json_schema

    def check(document):
        schema = json_schema(document["schema"])
        assert list(violations(document, schema, schema.get("$defs", {}))) == []
        return document

    return check


#: The broker as in production, private to the tests.
PROGRAM = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin:/usr/local/sbin")
PLAIN = """
listener {port} 127.0.0.1
allow_anonymous true
persistence false
log_dest file {folder}/broker.log
log_type all
"""
# Below the ports that the system gives to outgoing connections, so that a restart finds its port free.
PORTS = range(20000, 30000)


def until(condition, *, timeout=10.0, what="the condition"):
    """Return the first true value of a condition."""
    end = time.monotonic() + timeout
    while not (value := condition()):
        assert time.monotonic() < end, f"{what} did not come true within {timeout:g} s"
        time.sleep(0.005)
    return value


class Broker:
    """A running mosquitto; `{port}` and `{folder}` in its configuration are its own."""

    def __init__(self, config_text, folder):
        self.folder = folder
        self._text = config_text
        self._process = None
        for _ in range(20):
            self.port = random.randrange(PORTS.start, PORTS.stop)
            self._settings.write_text(config_text.replace("{port}", str(self.port)).replace("{folder}", str(folder)))
            if self._start():
                return
            if "Address already in use" not in self.log:
                break
        raise RuntimeError(f"mosquitto does not start:\n{self.log}")

    @property
    def log(self):
        """What it said."""
        return "".join(path.read_text(errors="replace") for path in sorted(self.folder.glob("*.log")))

    @property
    def address(self):
        return f"mqtt://127.0.0.1:{self.port}"

    def kill9(self):
        """End it without a chance to say goodbye."""
        self._end(signal.SIGKILL)

    def stop(self):
        """End it in good order."""
        self._end(signal.SIGTERM)

    def restart(self):
        """Start it again on the same port; stop it where it runs."""
        self.stop()
        if not self._start():
            raise RuntimeError(f"mosquitto does not start again:\n{self.log}")

    @property
    def _settings(self):
        return self.folder / "broker.conf"

    def _start(self):
        with (self.folder / "output.log").open("ab") as output:
            self._process = subprocess.Popen(
                [PROGRAM, "-c", self._settings], stdin=subprocess.DEVNULL, stdout=output, stderr=output
            )
        return until(self._is_up, what="the broker") == "listens"

    def _is_up(self):
        if self._process.poll() is not None:
            return "ended"
        with socket.socket() as trial:
            listens = trial.connect_ex(("127.0.0.1", self.port)) == 0
        # Whoever listens there may be another program, and ours about to say so and end.
        return "listens" if listens and f"listen socket on port {self.port}" in self.log else ""

    def _end(self, number):
        def is_over():
            # A mosquitto that has only just started may miss the first signal.
            if self._process.poll() is None:
                self._process.send_signal(number)
                with suppress(subprocess.TimeoutExpired):
                    self._process.wait(0.5)
            return self._process.poll() is not None

        if self._process is not None:
            until(is_over, what="the end of the broker")


@pytest.fixture(scope="session")
def mosquitto(tmp_path_factory: pytest.TempPathFactory):
    """Return a function from a configuration (None: plain, open to anybody) to a running broker of that kind."""
    if PROGRAM is None:
        pytest.skip("no mosquitto: install Debian's package (scripts/system-packages)")
    brokers = []

    def start(config_text=None):
        # As root, mosquitto would become a user that may not read the folder.
        user = f"\nuser {pwd.getpwuid(os.geteuid()).pw_name}\n"
        broker = Broker((config_text or PLAIN) + user, Path(tmp_path_factory.mktemp("mosquitto")))
        brokers.append(broker)
        return broker

    yield start
    for broker in brokers:
        broker.stop()
