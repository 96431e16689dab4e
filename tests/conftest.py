"""Fixtures of all tests."""

import gc
import hashlib
import io
import json
import os
import pickle
import pwd
import random
import shutil
import signal
import socket
import subprocess
import time
import tracemalloc
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from functools import wraps
from itertools import islice
from pathlib import Path
from typing import Any, Protocol, TypeVar

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy: matrices are small, more threads only wait

# Java for minutes: its thorough compiler would take longer than what it saves.
os.environ.setdefault("JDK_JAVA_OPTIONS", "-XX:TieredStopAtLevel=1 -XX:+UseSerialGC")
os.environ.setdefault("SPARK_CONF_DIR", str(Path(__file__).parent / "spark"))

import numpy as np
import pytest
from hypothesis import settings

settings.register_profile("same every time", derandomize=True, deadline=None)  # no test asserts a time
settings.load_profile("same every time")

Value = TypeVar("Value")

DATA = Path(os.environ.get("SPRUNG_DATA", Path(__file__).parents[2] / "shared" / "data"))
#: Claims of `docs/conformance.md`, and the file that takes those of this run (`benchmarks/conformance.py`).
CLAIMS = Path(__file__).parents[1] / "benchmarks" / "data" / "conformance.jsonl"
NEW_CLAIMS = os.environ.get("SPRUNG_CONFORMANCE")

#: Folders whose tests take the longest, dealt to the processes in this order; those of one share Spark or a browser.
LONGEST = ("acceptance", "jobs", "reproduce", "journeys", "golden", "world", "tutorials")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin every process with some of the longest tests, so that none is left alone with one; the rest is in order."""
    # Each process begins with an equal number of consecutive tests, and takes from the end of those of others.
    n_processes = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    folders = [item.path.parent.name for item in items]
    pairs = list(zip(folders, items, strict=True))
    rest = iter([item for folder, item in pairs if folder not in LONGEST])
    ordered: list[pytest.Item] = []
    for number in range(n_processes):
        begun = len(ordered)
        for chosen in LONGEST[number::n_processes]:
            ordered += [item for folder, item in pairs if folder == chosen]
        ordered += islice(rest, max(0, len(items) // n_processes - (len(ordered) - begun)))
    items[:] = [*ordered, *rest]
    if NEW_CLAIMS:
        items[:] = [item for item in items if "conforms" in getattr(item, "fixturenames", ())]


def pytest_collection_finish() -> None:
    """Leave modules and tests out of garbage collection: some tests collect, each time through a million objects."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session")
def _empty_store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the file of a store with all tables and no rows."""
    from sprung.online.store import open_store

    path = tmp_path_factory.mktemp("empty") / "store.sqlite"
    open_store(f"sqlite:///{path}").close()
    return path


@pytest.fixture
def sqlite_url(_empty_store: Path, tmp_path: Path) -> str:
    """Return the address of an empty store, a copy: to make its tables takes ten times as long."""
    return f"sqlite:///{shutil.copy(_empty_store, tmp_path / 'store.sqlite')}"


@pytest.fixture
def real_file() -> Callable[[str], Path]:
    """Return a function from a path below the real recordings to the file; it skips the test where that is absent."""

    def find(name: str) -> Path:
        path = DATA / name
        if not path.exists():
            pytest.skip(f"no {name} among the real recordings: set SPRUNG_DATA to their folder")
        return path

    return find


class Conforms(Protocol):
    """Comparison with a clause of a standard or paper."""

    def __call__(
        self,
        source: str,
        clause: str,
        what: str,
        found: Any,
        expected: Any,
        *,
        rel: float | None = None,
        absolute: float | None = None,
        unit: str = "",
        rounding: float | None = None,
    ) -> None:
        """Compare."""


def in_figures(deviation: float, rounding: float) -> float:
    """Return a deviation in two significant figures; 0 below what rounding of the processor may change."""
    return 0.0 if deviation < rounding else float(f"{deviation:.1e}")


@pytest.fixture
def conforms(request: pytest.FixtureRequest) -> Conforms:
    """Return a comparison with a standard: within the tolerance, and no other than `docs/conformance.md` states."""

    def compare(
        source: str,
        clause: str,
        what: str,
        found: Any,
        expected: Any,
        *,
        rel: float | None = None,
        absolute: float | None = None,
        unit: str = "",
        rounding: float | None = None,
    ) -> None:
        tolerance = absolute if rel is None else rel
        assert tolerance is not None
        assert rel is None or absolute is None
        found, expected = np.asarray(found), np.asarray(expected)
        assert found.size
        errors = np.abs(found - expected) / (1.0 if rel is None else np.abs(expected))
        deviation = float(np.max(errors))
        if rounding is None:
            rounding = tolerance if tolerance <= 1e-9 else min(1e-6, 1e-3 * tolerance)
        assert deviation <= tolerance, f"{source}, {clause}: off by {deviation:.3g}, more than {tolerance:g}"
        claim = {
            "source": source,
            "clause": clause,
            "what": what,
            "values": int(np.broadcast(found, expected).size),
            "tolerance": float(tolerance),
            "deviation": in_figures(deviation, rounding),
            "rounding": float(rounding),
            "unit": "relative" if absolute is None else unit,
            "test": request.node.nodeid,
        }
        if NEW_CLAIMS:
            with Path(NEW_CLAIMS).open("a", encoding="utf-8") as file:
                file.write(json.dumps(claim, ensure_ascii=False) + "\n")
            return
        known = map(json.loads, CLAIMS.read_text(encoding="utf-8").splitlines())
        names = ("source", "clause", "what", "test")
        stated = [each for each in known if all(each[name] == claim[name] for name in names)]
        stale = "write the page anew: python -m benchmarks.conformance"
        assert len(stated) == 1, f"docs/conformance.md has {len(stated)} claims {what!r} of {source}: {stale}"
        last_figure = 10.0 ** np.floor(np.log10(deviation)) / 10 if deviation else 0.0
        assert stated[0] | {"deviation": 0} == claim | {"deviation": 0}, stale
        assert np.abs(stated[0]["deviation"] - claim["deviation"]) <= 1.01 * max(last_figure, rounding), stale

    return compare


def once(function: Callable[..., Value]) -> Callable[..., Value]:
    """Return the function, computed once for arguments of equal content; for results that nobody can change.

    Iterators are read to their end, and progress is not reported.
    """
    results: dict[bytes, Value] = {}

    @wraps(function)
    def look_up(*arguments: object, **options: object) -> Value:
        arguments = tuple(list(each) if isinstance(each, Iterator) else each for each in arguments)
        options.pop("on_progress", None)
        content = io.BytesIO()
        pickler = pickle.Pickler(content)
        pickler.fast = True  # equal values give equal bytes, whether or not they are one object
        pickler.dump((arguments, options))
        key = hashlib.sha256(content.getbuffer()).digest()
        if key not in results:
            results[key] = function(*arguments, **options)
        return results[key]

    return look_up


@pytest.fixture(scope="session")
def fits_once() -> Mapping[str, Callable[..., Any]]:
    """Fits of windows and identifications that are computed once, for tests of what is done with them."""
    from sprung.diagnosis import observe_window
    from sprung.diagnosis.observation import fit_drive
    from sprung.identification import METHODS

    fits = {each.__name__: once(each) for each in (observe_window, fit_drive)}
    return fits | {name: once(METHODS[name]) for name in METHODS}


class MemoryBelow(Protocol):
    """Context that fails where more than `most` bytes are taken at once in it, or `kept` after it."""

    def __call__(self, most: float, *, kept: float | None = None) -> AbstractContextManager[None]:
        """Return the context."""


@pytest.fixture
def memory_below() -> MemoryBelow:
    """Return a context that fails where more bytes than given are taken at once in it, or `kept` after it."""

    @contextmanager
    def bounded(most: float, *, kept: float | None = None) -> Iterator[None]:
        tracemalloc.start()
        try:
            yield
            left, peak = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
        assert peak < most
        assert kept is None or left < kept

    return bounded


def violations(
    value: object, schema: Mapping[str, Any], definitions: Mapping[str, Any], place: str = "document"
) -> Iterator[str]:
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


def _object_violations(
    value: Mapping[str, object], schema: Mapping[str, Any], definitions: Mapping[str, Any], place: str
) -> Iterator[str]:
    known, rest = schema.get("properties", {}), schema.get("additionalProperties", "properties" not in schema)
    yield from (f"{place} lacks {name}" for name in schema.get("required", []) if name not in value)
    for name, member in value.items():
        rule = known.get(name, rest)
        if rule is False:
            yield f"{place} has an unknown {name}"
        elif rule is not True:
            yield from violations(member, rule, definitions, f"{place}.{name}")


def _has_type(value: object, name: str) -> bool:
    if isinstance(value, bool):
        return name == "boolean"
    kinds: dict[str, type | tuple[type, ...]] = {
        "object": dict,
        "array": list,
        "string": str,
        "integer": int,
        "number": (int, float),
        "null": type(None),
    }
    return name in kinds and isinstance(value, kinds[name])


@pytest.fixture(scope="session")
def check_document() -> Callable[[dict[str, Any]], dict[str, Any]]:
    """Return a function that checks a JSON document against the JSON Schema that its key `schema` names."""
    from sprung.results.documents import json_schema

    def check(document: dict[str, Any]) -> dict[str, Any]:
        schema = json_schema(document["schema"])
        assert list(violations(document, schema, schema.get("$defs", {}))) == []
        return document

    return check


#: The broker as in production, private to the tests.
@dataclass(frozen=True)
class Outcome:
    code: int
    out: str
    err: str
    check_document: Callable[[Any], Any]

    def document(self) -> Any:
        """The JSON document on standard output, without NaN and Infinity, checked against its JSON Schema."""

        def refuse(constant: str) -> None:
            raise AssertionError(f"{constant} is not valid JSON")

        assert self.code in {0, 3}, self.err
        return self.check_document(json.loads(self.out, parse_constant=refuse))


@pytest.fixture
def sprung(capfd: pytest.CaptureFixture[str], check_document: Callable[[Any], Any]) -> Callable[..., Outcome]:
    """Run the command line in this process."""
    from sprung.cli import main

    def run(*words: object) -> Outcome:
        capfd.readouterr()
        code = main([str(word) for word in words])
        return Outcome(code, *capfd.readouterr(), check_document)

    return run


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


def until(condition: Callable[[], Value], *, timeout: float = 10.0, what: str = "the condition") -> Value:
    """Return the first true value of a condition."""
    end = time.monotonic() + timeout
    while not (value := condition()):
        assert time.monotonic() < end, f"{what} did not come true within {timeout:g} s"
        time.sleep(0.005)
    return value


class Broker:
    """A running mosquitto; `{port}` and `{folder}` in its configuration are its own."""

    def __init__(self, program: str, config_text: str, folder: Path) -> None:
        self.folder = folder
        self._program = program
        self._process: subprocess.Popen[bytes] | None = None
        for _ in range(20):
            self.port = random.randrange(PORTS.start, PORTS.stop)
            self._settings.write_text(config_text.replace("{port}", str(self.port)).replace("{folder}", str(folder)))
            if self._start():
                return
            if "Address already in use" not in self.log:
                break
        raise RuntimeError(f"mosquitto does not start:\n{self.log}")

    @property
    def log(self) -> str:
        """What it logged."""
        return "".join(path.read_text(errors="replace") for path in sorted(self.folder.glob("*.log")))

    @property
    def address(self) -> str:
        return f"mqtt://127.0.0.1:{self.port}"

    def kill9(self) -> None:
        """End it without a chance to say goodbye."""
        self._end(signal.SIGKILL)

    def stop(self) -> None:
        """End it in good order."""
        self._end(signal.SIGTERM)

    def restart(self) -> None:
        """Start it again on the same port; stop it where it runs."""
        self.stop()
        if not self._start():
            raise RuntimeError(f"mosquitto does not start again:\n{self.log}")

    @property
    def _settings(self) -> Path:
        return self.folder / "broker.conf"

    def _start(self) -> bool:
        with (self.folder / "output.log").open("ab") as output:
            process = subprocess.Popen(
                [self._program, "-c", self._settings], stdin=subprocess.DEVNULL, stdout=output, stderr=output
            )
        self._process = process
        return until(lambda: self._state(process), what="the broker") == "listens"

    def _state(self, process: subprocess.Popen[bytes]) -> str:
        if process.poll() is not None:
            return "ended"
        with socket.socket() as trial:
            listens = trial.connect_ex(("127.0.0.1", self.port)) == 0
        # Whoever listens there may be another program, and ours about to say so and end.
        return "listens" if listens and f"listen socket on port {self.port}" in self.log else ""

    def _end(self, number: int) -> None:
        process = self._process
        if process is None:
            return

        def is_over() -> bool:
            # A mosquitto that has only just started may miss the first signal.
            if process.poll() is None:
                process.send_signal(number)
                with suppress(subprocess.TimeoutExpired):
                    process.wait(0.5)
            return process.poll() is not None

        until(is_over, what="the end of the broker")


@pytest.fixture(scope="session")
def mosquitto(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[..., Broker]]:
    """Return a function from a configuration (None: plain, open to anybody) to a running broker of that kind."""
    if PROGRAM is None:
        pytest.skip("no mosquitto: install Debian's package (scripts/system-packages)")
    program, brokers = PROGRAM, list[Broker]()

    def start(config_text: str | None = None) -> Broker:
        # As root, mosquitto would become a user that may not read the folder.
        user = f"\nuser {pwd.getpwuid(os.geteuid()).pw_name}\n"
        broker = Broker(program, (config_text or PLAIN) + user, Path(tmp_path_factory.mktemp("mosquitto")))
        brokers.append(broker)
        return broker

    yield start
    for broker in brokers:
        broker.stop()


@pytest.fixture(scope="session")
def coach() -> Any:
    """Return the shipped coach with four lateral accelerometers on its frames."""
    from sprung.vehicles import Sensor, read_vehicle

    vehicle = read_vehicle("coach")
    sensors = [
        Sensor(
            channel=f"bogie{number}_{end}y",
            quantity="acceleration",
            unit="m/s^2",
            position=(x, 0.0, 0.0),
            direction=(0.0, 1.0, 0.0),
            on=f"bogie{number}",
        )
        for number in (1, 2)
        for end, x in (("f", 1.28), ("r", -1.28))
    ]
    return vehicle.model_copy(update={"sensor": (*vehicle.sensor, *sensors)})
