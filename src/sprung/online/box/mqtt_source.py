"""Blocks of values that sensors publish on topics of an MQTT broker."""

import json
import queue
import secrets
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from sprung.errors import FormatError, ParameterError
from sprung.link import Address, Link
from sprung.online.box.sources import Regular
from sprung.recording import Recording

#: Longest wait for the broker [s].
_CONNECT = 10.0
#: Longest wait for a message between checks whether to stop [s].
_LOOK = 0.2
#: Longest wait for more of a block [s].
_PAUSE = 5.0
#: Largest number of messages that wait to be read.
_MAX_WAITING = 100_000
#: Largest message [bytes].
_LARGEST = 1 << 16
# Largest number of different problems that are reported.
_MAX_PROBLEMS = 100
# A time before 2000 or after 2100 [s] is that of a clock that was not set, or in another unit.
_YEAR_2000, _YEAR_2100 = 946_684_800, 4_102_444_800


def from_mqtt(
    address: Address | str,
    topics: Sequence[str],
    *,
    names: Sequence[str],
    sampling_rate: float,
    is_done: Callable[[], bool] = lambda: False,
    on_problem: Callable[[str], None] = lambda _sentence: None,
    clock: Callable[[], int] = time.time_ns,
) -> Iterator[Recording]:
    """Return the blocks of what sensors publish: JSON objects, or one number per topic.

    Parameters
    ----------
    address
        Address of the broker, such as mqtt://host:1883.
    topics
        Topic filters to subscribe to, with the wildcards + and #.
    names
        Names of the channels. An object has values under these names, in SI units, and "time" in s since 1970; a
        message that is one number is that of the channel which the last level of its topic names.
    sampling_rate
        As for `Regular`.
    is_done
        Function that returns whether to stop, called about five times a second.
    on_problem
        Function called with a sentence the first time a topic has an unusable message; such messages are ignored.
    clock
        Present time, UTC ns, used for messages without time, or with one before 2000 from a clock that was not set.

    Raises
    ------
    ParameterError
        If address, topics or names cannot be used.
    LinkError
        If the broker cannot be reached within 10 s; after a later loss the connection is awaited.

    Examples
    --------
    >>> channel = {"names": ["acc_fl"], "sampling_rate": 400.0}
    >>> blocks = from_mqtt("mqtt://depot:1883", ["sensors/+"], **channel)
    >>> next(blocks).n_samples  # doctest: +SKIP
    400
    >>> from_mqtt("mqtt://depot:1883", "sensors/+", **channel)
    Traceback (most recent call last):
        ...
    sprung.errors.ParameterError: topics='sensors/+' must be a list of one or more topics: name those of the sensors
    """
    broker = Address.parse(address) if isinstance(address, str) else address
    if isinstance(topics, str) or not topics:
        raise ParameterError(f"topics={topics!r} must be a list of one or more topics: name those of the sensors")
    for topic in topics:
        _check_filter(topic)
    regular = Regular(names, sampling_rate)
    reader = _Reader(names, on_problem)
    return _blocks(broker, topics, regular=regular, reader=reader, is_done=is_done, clock=clock)


def _blocks(
    address: Address,
    topics: Sequence[str],
    *,
    regular: Regular,
    reader: "_Reader",
    is_done: Callable[[], bool],
    clock: Callable[[], int],
) -> Iterator[Recording]:
    """Yield the blocks of messages until it is time to stop."""
    inbox: queue.Queue[tuple[int, str, bytes]] = queue.Queue(_MAX_WAITING)

    def received(topic: str, payload: bytes) -> None:
        try:
            inbox.put_nowait((clock(), topic, payload))
        except queue.Full:
            reader.has_overflowed = True

    link = Link(address, f"sprung-source-{secrets.token_hex(6)}", topics=topics, on_message=received)
    link.open(timeout=_CONNECT, is_patient=True)
    heard = time.monotonic()
    try:
        while not is_done():
            try:
                arrived, topic, payload = inbox.get(timeout=_LOOK)
            except queue.Empty:
                if time.monotonic() - heard > _PAUSE:
                    yield from regular.finish()
                continue
            heard = time.monotonic()
            for when, values in reader.values(topic, payload, arrived):
                yield from regular.add(when, values)
        yield from regular.finish()
    finally:
        link.close()


class _Reader:
    """Turns messages into values, and reports each problem once."""

    def __init__(self, names: Sequence[str], on_problem: Callable[[str], None]) -> None:
        self._names = frozenset(names)
        self._on_problem = on_problem
        self._reported: set[tuple[str, str]] = set()
        self.has_overflowed = False

    def values(self, topic: str, payload: bytes, arrived: int) -> Iterator[tuple[int, dict[str, float]]]:
        """Yield the time and values of a message, if it has any."""
        if self.has_overflowed:
            self.has_overflowed = False
            self._report("", "overflow", f"more than {_MAX_WAITING} messages wait, some are lost: send fewer")
        try:
            document = _parsed(topic, payload)
            when = _time(topic, document, arrived)
        except FormatError as error:
            self._report(topic, "message", str(error))
            return
        values = {}
        for name in self._names & document.keys():
            value = _number(document[name])
            if value is None:
                self._report(
                    topic, name, f"topic {_short(topic)}: {name!r} is {_short(document[name])}: send a number, or null"
                )
            else:
                values[name] = value
        if not self._names & document.keys():
            has = ", ".join(_short(name) for name in list(document)[:5]) or "nothing"
            self._report(topic, "names", f"topic {_short(topic)} has none of the channels, but {has}: check the names")
        yield when, values

    def _report(self, topic: str, kind: str, problem: str) -> None:
        """Report a problem of a kind of a topic, once only."""
        if (topic, kind) not in self._reported and len(self._reported) < _MAX_PROBLEMS:
            self._reported.add((topic, kind))
            self._on_problem(problem)


def _parsed(topic: str, payload: bytes) -> Mapping[str, Any]:
    """Return the object in a message; a bare number is that of the last level of the topic."""
    if len(payload) > _LARGEST:
        raise FormatError(f"topic {_short(topic)} has a message of {len(payload)} bytes: send at most {_LARGEST}")
    try:
        document = json.loads(payload)
    except (ValueError, RecursionError):
        raise FormatError(
            f"topic {_short(topic)} has a message that is not JSON: {_short(payload.decode(errors='replace'))}: send "
            "an object of numbers, or one number"
        ) from None
    if isinstance(document, dict):
        return document
    if _number(document) is None:
        raise FormatError(
            f"topic {_short(topic)} has the message {_short(document)}: send an object of numbers, or one number"
        )
    return {topic.rsplit("/", maxsplit=1)[-1]: document}


def _time(topic: str, document: Mapping[str, Any], arrived: int) -> int:
    """Return the time of a message, UTC ns."""
    stated = document.get("time")
    if stated is None:
        return arrived
    seconds = _number(stated)
    if seconds is None or not 0 <= seconds < _YEAR_2100:
        raise FormatError(f"topic {_short(topic)}: time is {_short(stated)}: send seconds since 1970, or leave it out")
    return arrived if seconds < _YEAR_2000 else round(seconds * 1e9)


def _number(value: object) -> float | None:
    """Return a number, NaN for null; None for what is neither."""
    if value is None:
        return float("nan")
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        return float(value)
    except OverflowError:
        return float("nan")


def _check_filter(topic: str) -> None:
    """Refuse topic filters that are not valid (MQTT 5.0, section 4.7)."""
    levels = topic.split("/")
    is_wrong = any(("+" in level or "#" in level) and len(level) > 1 for level in levels) or "#" in levels[:-1]
    if not topic or is_wrong or "\0" in topic or len(topic.encode()) > 65535:
        raise ParameterError(f"{topic[:60]!r} is not a topic filter: + and # stand for whole levels, # for the last")


def _short(value: object) -> str:
    """Return a value as text for a message."""
    return repr(value)[:60]
