"""The box on the vehicle: from a source of samples to frames that the monitor has acknowledged."""

import hashlib
import queue
import resource
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from sprung.errors import FormatError, ParameterError
from sprung.link import (
    VERSION,
    Address,
    Frame,
    Link,
    Sending,
    Spool,
    check_vehicle,
    checked_map,
    encode,
    message,
    quantised,
    topic,
)
from sprung.recording import Recording

if TYPE_CHECKING:
    from sprung.box.onboard import OnBoard, Request

#: Names that brokers know others by.
RESERVED = ("monitor", "viewer")
#: Seconds between two reports of the box' state, and between two looks at the link.
_REPORT, _LOOK = 5.0, 0.02
#: Seconds between reports of the box' health.
_EXAMINE = 60.0
#: Why no samples are sent when they are asked for.
_ALL_SENT = "its box sends all samples as they come: there is nothing to ask for"
_NONE_HELD = "its box holds none of that time: ask further back with --minutes"
#: Most bytes of samples in a frame.
_LARGEST_DATA = 900_000


@dataclass(frozen=True, slots=True)
class BoxSettings:
    """How a box works.

    Parameters
    ----------
    vehicle
        Its name.
    description
        Its vehicle file.
    width
        Bytes of a count: 2, 3 or 4.
    patience
        Time without progress after which everything is sent again [s].
    """

    vehicle: str
    description: str
    width: int = 2
    patience: float = 10.0

    def __post_init__(self) -> None:
        check_vehicle(self.vehicle)
        if self.vehicle in RESERVED:
            raise ParameterError(
                f"no vehicle can be called {self.vehicle!r}: that is a user of the broker, take another name"
            )

    @property
    def configuration(self) -> str:
        """Of the vehicle file: the first figures of its SHA-256."""
        return hashlib.sha256(self.description.encode()).hexdigest()[:16]


class Box:
    """Takes blocks of samples and sees to it that the monitor gets them.

    `take` and `look` may be called from different threads.

    Parameters
    ----------
    settings
        Vehicle and wire.
    spool
        Where frames wait.
    address
        Of the broker.
    quantities
        Returns those of the channels of a block, which it announces.
    on_board
        Identifies modes on the vehicle; None: samples are sent.
    clock, sleep
        In s; any clock that only goes forward.
    """

    def __init__(
        self,
        settings: BoxSettings,
        spool: Spool,
        address: Address,
        *,
        quantities: Callable[[Recording], Mapping[str, str]],
        on_board: "OnBoard | None" = None,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._settings, self._spool = settings, spool
        self._sending = Sending(spool, patience=settings.patience)
        self._on_board = on_board
        self._quantities, self._clock, self._sleep = quantities, clock, sleep
        self._inbox: queue.SimpleQueue[tuple[str, bytes]] = queue.SimpleQueue()
        self._announced: dict[str, str] = {}
        self._reported = self._examined = -1e9
        self._problem = ""
        self._lock = threading.Lock()
        self._link = Link(
            address,
            f"sprung-box-{settings.vehicle}",
            topics=[topic(settings.vehicle, "ack"), topic(settings.vehicle, "cmd")],
            on_message=lambda name, payload: self._inbox.put((name, payload)),
            on_connected=lambda: self._inbox.put(("connected", b"")),
        )

    @property
    def is_connected(self) -> bool:
        """Whether the broker has let it in."""
        return self._link.is_connected

    @property
    def problem(self) -> str:
        """Why frames do not get through, as far as known; empty where nothing stands in the way."""
        return self._problem or self._link.problem

    @property
    def n_waiting(self) -> int:
        """Frames that the monitor has not acknowledged."""
        return sum(1 for _ in self._spool.frames())

    def open(self, *, timeout: float = 0.0) -> None:
        """Begin to connect, as for `Link.open`."""
        self._link.open(timeout=timeout)

    def resume_time(self) -> int | None:
        """Return where the samples of the spool end, UTC ns; None where it is empty."""
        payload = self._spool.last_frame()
        if payload is None:
            return None
        document = checked_map(payload)
        return int(document[4] + document[5] * document[7])

    def take(self, block: Recording) -> None:
        """Keep a block as a frame."""
        with self._lock:
            self._take(block)

    def look(self) -> None:
        """See what came, and send what is due."""
        with self._lock:
            self._look()

    def _take(self, block: Recording) -> None:
        """Keep a block as a frame."""
        if not self._announced:
            self._announced = dict(self._quantities(block))
            self._announce()
        most = _LARGEST_DATA // (len(block.names) * self._settings.width)
        for first in range(0, block.n_samples, most):
            encoded = self._frame(block.part(first, min(first + most, block.n_samples)))
            (self._spool if self._on_board is None else self._on_board.ring).append(encoded)
        if self._on_board is not None:
            for kind, document in self._on_board.take(block):
                self._spool_map({**document, 14: self._settings.configuration, 16: kind})

    def _frame(self, block: Recording) -> Callable[[int, int], bytes]:
        """Return what makes a block a frame of a boot and a sequence number."""
        counts, scale, flags = quantised(block.samples, width=self._settings.width)
        interval = round(1e9 / block.sampling_rate)
        start = block.start or 0
        previous = self._spool.previous

        def encoded(boot: int, seq: int) -> bytes:
            return encode(
                Frame(
                    self._settings.vehicle,
                    boot,
                    seq,
                    start,
                    interval,
                    block.names,
                    scale,
                    counts,
                    self._settings.width,
                    flags,
                    configuration=self._settings.configuration,
                    previous=previous,
                )
            )

        return encoded

    def _spool_map(self, document: Mapping[Any, Any]) -> None:
        """Keep a message that is no frame of samples, or a frame from the ring."""
        previous = {} if self._spool.previous is None else {15: list(self._spool.previous)}
        whole = {0: 1, 1: self._settings.vehicle, **document, **previous}
        self._spool.append(lambda boot, seq: message({**whole, 2: boot, 3: seq}))

    def _look(self) -> None:
        """See what came, and send what is due."""
        now = self._clock()
        while True:
            try:
                name, payload = self._inbox.get_nowait()
            except queue.Empty:
                break
            if name == "connected":
                self._sending.start_again(now)
                self._announce()
                self._reported = -1e9
            else:
                self._told(name, payload, now)
        if not self._link.is_connected:
            return
        if now - self._reported > _REPORT:
            self._report(now)
        if now - self._examined > _EXAMINE:
            self._examine(now)
        for _, _, payload in self._sending.due(now):
            kind = "raw" if self._on_board is None else checked_map(payload).get(16, "raw")
            if not self._link.publish(topic(self._settings.vehicle, kind), payload):
                self._sending.start_again(now)
                break

    def drain(self, *, timeout: float) -> bool:
        """Send what is left, and return whether all of it was acknowledged within a time [s]."""
        end = self._clock() + timeout
        while self._clock() < end:
            self.look()
            if next(self._spool.frames(), None) is None:
                return True
            self._sleep(_LOOK)
        return False

    def close(self) -> None:
        """Say that the vehicle is switched off and disconnect; what is in the spool stays there."""
        self._report(self._clock(), is_leaving=True)
        self._link.close()
        self._spool.close()

    def _told(self, name: str, payload: bytes, now: float) -> None:
        """Heed an acknowledgement or a wish for samples; one that is garbled is passed over."""
        try:
            document = checked_map(payload)
            boot, seq = document.get(2), document.get(3)
        except FormatError:
            return
        if name.endswith("/ack") and isinstance(boot, int) and isinstance(seq, int):
            self._sending.acknowledged(boot, seq, now)
        elif name.endswith("/cmd") and document.get("do") == "speak":
            versions = document.get("versions")
            if isinstance(versions, list) and VERSION not in versions:
                self._problem = f"the monitor reads frames of version {versions}, this box writes {VERSION}: update one"
        elif name.endswith("/cmd") and document.get("do") == "raw":
            number, begin, end = document.get("number", 0), document.get("from"), document.get("to")
            if isinstance(number, int) and isinstance(begin, int) and isinstance(end, int):
                self._publish("event", {"did": "raw", "number": number, **self._answer((number, begin, end))})

    def _answer(self, request: "Request") -> Mapping[str, Any]:
        """Send the samples that are asked for, but once, and return what was sent."""
        if self._on_board is None:
            return {**self._sent([]), "reason": _ALL_SENT}
        answer = self._on_board.answers.get(request)
        if answer is None:
            times = []
            for frame in self._on_board.asked_for(*request[1:]):
                self._spool_map(frame)
                times += [frame[4], frame[4] + frame[5] * frame[7]]
            answer = {**self._sent(times), "reason": "" if times else _NONE_HELD}
            self._on_board.answers.keep(request, answer)
        return answer

    def _sent(self, times: list[int]) -> dict[str, Any]:
        """Return up to which frame, how many and of which time samples were sent; `times` of begin and end of each."""
        place = {"boot": self._spool.boot, "last": self._spool.next_seq - 1, "frames": len(times) // 2}
        return {**place, "from": min(times, default=0), "to": max(times, default=0)}

    def _announce(self) -> None:
        """Say what the vehicle and its channels are; kept by the broker for monitors that come later."""
        if self._announced:
            self._publish(
                "meta",
                {
                    14: self._settings.configuration,
                    "description": self._settings.description,
                    "quantities": self._announced,
                    "program": version("sprung"),
                    "versions": [VERSION],
                },
                is_retained=True,
            )

    def _report(self, now: float, *, is_leaving: bool = False) -> None:
        """Say what the spool holds and has lost."""
        self._reported = now
        boots = self._told_before() | self._spool.boots
        before = dict([self._spool.previous]) if self._spool.previous else {}
        ends = {**before, self._spool.boot: self._spool.next_seq}
        self._publish(
            "state",
            {
                2: self._spool.boot,
                "boots": [[boot, first, ends.get(boot, -1)] for boot, first in sorted(boots.items())],
                "dropped": self._spool.dropped,
                "spooled": self._spool.n_bytes,
                "time": time.time_ns(),
                "is_leaving": is_leaving,
            },
        )

    def _examine(self, now: float) -> None:
        """Say how the box is."""
        self._examined = now
        used = resource.getrusage(resource.RUSAGE_SELF)
        document = {
            "cpu_seconds": used.ru_utime + used.ru_stime,
            "memory": used.ru_maxrss * 1024,
            "free": self._spool.free,
            "waiting": self._sending.n_under_way,
            "problem": self.problem,
        }
        self._publish("health", document)

    def _told_before(self) -> dict[int, int]:
        """Return the boot that the oldest frame waits for, with its end; its frames may all have been dropped."""
        oldest = next(self._spool.frames(), None)
        previous = None if oldest is None else checked_map(oldest[2]).get(15)
        return {} if previous is None else {previous[0]: previous[1]}

    def _publish(self, what: str, document: dict[Any, Any], *, is_retained: bool = False) -> None:
        """Publish a map."""
        whole = {0: 1, 1: self._settings.vehicle, **document}
        self._link.publish(topic(self._settings.vehicle, what), message(whole), is_retained=is_retained)
