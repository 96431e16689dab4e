"""Blocks of signals on a CAN bus, decoded with a database that locates them in messages."""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from sprung._checks import required
from sprung.errors import FormatError, ParameterError
from sprung.online.box.sources import Regular
from sprung.recording import Channel, Recording
from sprung.units import conversion

# Stamps before 2000 [ns] do not count from 1970, but from the start of the adapter or the log.
_YEAR_2000 = 946_684_800_000_000_000


def from_can(
    messages: Iterable[Any],
    database: Any,
    *,
    names: Sequence[str],
    sampling_rate: float,
    start: Callable[[], int] = time.time_ns,
    on_problem: Callable[[str], None] = lambda _sentence: None,
) -> Iterator[Recording]:
    """Return the blocks of signals on a CAN bus, in SI units where the database states a known unit.

    Parameters
    ----------
    messages
        Messages of python-can, from a `Bus` or a `LogReader`.
    database
        Database of cantools, which locates signals in messages.
    names
        Names of the signals; MESSAGE.SIGNAL where several messages have one of that name.
    sampling_rate
        As for `Regular`.
    start
        Returns the time of the first message, UTC ns, where stamps do not count from 1970.
    on_problem
        Function called with a sentence the first time a message of an id cannot be decoded; such messages are ignored.

    Raises
    ------
    ParameterError
        If a signal is not in the database, or in several messages.
    FormatError
        If the bus or the log can no longer be read.

    Examples
    --------
    >>> import can
    >>> import cantools
    >>> text = 'BU_: BOX  BO_ 256 ACC: 2 BOX  SG_ acc_fl : 0|16@1- (0.01,0) [0|0] "m/s^2" BOX'
    >>> database = cantools.database.load_string(text)
    >>> times = [1_700_000_000 + k / 100 for k in range(200)]
    >>> sent = {"arbitration_id": 256, "is_extended_id": False, "data": [50, 0]}
    >>> messages = [can.Message(timestamp=time, **sent) for time in times]
    >>> blocks = list(from_can(messages, database, names=["acc_fl"], sampling_rate=100.0))
    >>> [(block.n_samples, block.channels[0].unit, float(block.samples[0, 0])) for block in blocks]
    [(100, 'm/s^2', 0.5), (100, 'm/s^2', 0.5)]
    """
    wanted = _wanted(database, names)
    channels = [signal.channel for name in names for signals in wanted.values() for signal in signals.by_name(name)]
    regular = Regular(channels, sampling_rate)
    return _blocks(messages, wanted, regular, start, on_problem)


def can_bus(interface: str, channel: str) -> Any:
    """Return a bus of python-can, such as of socketcan and can0.

    Raises
    ------
    ParameterError
        If the bus cannot be opened.

    Examples
    --------
    >>> import can
    >>> with can_bus("virtual", "depot") as receiver, can.Bus("depot", interface="virtual") as sender:
    ...     sender.send(can.Message(arbitration_id=256, data=[1, 2]))
    ...     message = receiver.recv(timeout=1.0)
    >>> message.arbitration_id, message.data.hex()
    (256, '0102')
    """
    can = required("can", purpose="a CAN bus", extra="can")
    try:
        return can.Bus(interface=interface, channel=channel)
    except (OSError, can.CanError, ValueError, ImportError) as error:
        raise ParameterError(
            f"the CAN bus {interface} {channel} cannot be opened ({_detail(error)}): check that it is connected and up"
        ) from None


@dataclass(frozen=True, slots=True)
class _Signal:
    """A signal of a message: its name there, its channel, and its factor to SI."""

    name: str
    channel: Channel
    factor: float


@dataclass(frozen=True, slots=True)
class _Wanted:
    """A message of the database, and the requested signals in it."""

    message: Any
    signals: tuple[_Signal, ...]

    def by_name(self, name: str) -> list[_Signal]:
        """Return the signal of that name, if it is in this message."""
        return [signal for signal in self.signals if signal.channel.name == name]


def _wanted(database: Any, names: Sequence[str]) -> dict[tuple[int, bool], _Wanted]:
    """Return the messages with signals of some names, by id and whether that is an extended one."""
    wanted: dict[tuple[int, bool], _Wanted] = {}
    for name in names:
        holders = [
            (message, signal)
            for message in database.messages
            for signal in message.signals
            if name in (signal.name, f"{message.name}.{signal.name}")
        ]
        if not holders:
            known = sorted({signal.name for message in database.messages for signal in message.signals})
            raise ParameterError(f"the CAN database has no signal {name!r}: it has {', '.join(known)[:200]}")
        if len(holders) > 1:
            several = " and ".join(message.name for message, _ in holders[:2])
            raise ParameterError(f"signal {name!r} is in the CAN messages {several}: write {holders[0][0].name}.{name}")
        message, signal = holders[0]
        key = message.frame_id, bool(message.is_extended_frame)
        before = wanted[key].signals if key in wanted else ()
        wanted[key] = _Wanted(message, (*before, _signal(name, signal)))
    return wanted


def _signal(name: str, signal: Any) -> _Signal:
    """Return a signal of the database as a channel."""
    try:
        quantity, factor = conversion(signal.unit or "")
    except ParameterError:
        quantity, factor = "unknown", 1.0
    return _Signal(signal.name, Channel(name, quantity), factor)


def _blocks(
    messages: Iterable[Any],
    wanted: dict[tuple[int, bool], _Wanted],
    regular: Regular,
    start: Callable[[], int],
    on_problem: Callable[[str], None],
) -> Iterator[Recording]:
    cantools = required("cantools", purpose="a CAN bus", extra="can")
    broken: set[tuple[int, bool]] = set()
    offset: int | None = None
    for message in _received(messages):
        key = message.arbitration_id, bool(message.is_extended_id)
        if message.is_error_frame or message.is_remote_frame or key not in wanted:
            continue
        requested = wanted[key]
        try:
            decoded = requested.message.decode(bytes(message.data), decode_choices=False)
        except (cantools.Error, ValueError, KeyError) as error:
            if key not in broken:
                broken.add(key)
                on_problem(
                    f"CAN message {requested.message.name} (id {key[0]:#x}) cannot be decoded ({_detail(error)}): "
                    "check that the database is that of this bus"
                )
            continue
        stamp = round(message.timestamp * 1e9)
        if offset is None:
            offset = 0 if stamp >= _YEAR_2000 else start() - stamp
        values = {s.channel.name: float(decoded[s.name]) * s.factor for s in requested.signals if s.name in decoded}
        yield from regular.add(stamp if stamp >= _YEAR_2000 else stamp + offset, values)
    yield from regular.finish()


def _received(messages: Iterable[Any]) -> Iterator[Any]:
    """Yield messages as long as the bus or the log can be read."""
    can = required("can", purpose="a CAN bus", extra="can")
    try:
        yield from (message for message in messages if message is not None)
    except (OSError, can.CanError, ValueError) as error:
        raise FormatError(f"the CAN bus or log can no longer be read ({_detail(error)}): check that it is up") from None


def _detail(error: Exception) -> str:
    """Return the message of an error in one line."""
    return " ".join(str(error).split())[:200] or type(error).__name__
