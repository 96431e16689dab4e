"""The box on the vehicle: from a source of samples to frames that the monitor has acknowledged."""

import hashlib
import json
import queue
import re
import resource
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from sprung._checks import check_number
from sprung.errors import FormatError, ParameterError
from sprung.link import (
    MAX_LOSSES,
    TIME_SET,
    VERSION,
    Address,
    Every,
    Frame,
    Header,
    Key,
    Link,
    Loss,
    Sending,
    Spool,
    check_vehicle,
    checked_map,
    common_name,
    encode,
    joined,
    message,
    quantised,
    topic,
)
from sprung.link.messages import MAX_BOOTS, VEHICLE, checksum
from sprung.recording import Recording

if TYPE_CHECKING:
    from sprung.online.box.onboard import OnBoard, Request

#: User names of the broker that are not vehicles: monitors and viewers, also the second one and so on.
RESERVED = re.compile(r"(monitor|viewer)(-[0-9]+)?")
#: Time between reports of the spool [s].
_REPORT = 5.0
#: Time between reports of the box's health [s].
_EXAMINE = 60.0
#: Time between checks of the link while the spool is drained [s].
_LOOK = 0.02
#: Reasons why no samples are sent on request.
_ALL_SENT = "the box sends all samples as they come: there is nothing to request"
_NONE_HELD = "the box holds no samples of that time: request earlier ones with --minutes"
#: Largest number of bytes of samples in a frame.
_LARGEST_DATA = 900_000


@dataclass(frozen=True, slots=True)
class BoxSettings:
    """Settings of a box.

    Parameters
    ----------
    vehicle
        Name of the vehicle.
    description
        Text of its vehicle file.
    width
        Bytes of a count: 2, 3 or 4.
    patience
        Time without progress after which everything is sent again [s].
    time_status
        Status of the time of its samples, as in `Frame`.
    frame_seconds
        Length of a frame of samples [s], up to 60: blocks that follow each other are joined up to the next multiple of
        it in UTC, and until then are in memory only. 0: each block is a frame.

    Raises
    ------
    ParameterError
        If the name of the vehicle or the length of a frame is not valid.
    """

    vehicle: str
    description: str
    width: int = 2
    patience: float = 10.0
    time_status: int = TIME_SET
    frame_seconds: float = 0.0

    def __post_init__(self) -> None:
        check_number("frame_seconds", self.frame_seconds, at_least=0, at_most=60)
        check_vehicle(self.vehicle)
        if RESERVED.fullmatch(self.vehicle):
            raise ParameterError(f"vehicle {self.vehicle!r} has the name of a user of the broker: use another name")

    @property
    def configuration(self) -> str:
        """Hash of the vehicle file: the first 16 digits of its SHA-256."""
        return hashlib.sha256(self.description.encode()).hexdigest()[:16]


class Box:
    """Sends blocks of samples until the monitor has acknowledged them.

    `take` and `step` may be called from different threads.

    Parameters
    ----------
    settings
        Vehicle and form of its frames.
    spool
        Spool in which frames wait.
    address
        Address of the broker.
    quantities
        Function that returns the quantity of each channel of a block, by name.
    on_board
        Identification on the vehicle; None: samples are sent.
    clock
        Present time [s] of a monotonic clock.
    sleep
        Function that waits for a time [s].
    now
        Present time, UTC ns.
    connect
        Function of address, name, topics and handlers that returns a link, such as `Link`.
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
        now: Callable[[], int] = time.time_ns,
        connect: Callable[..., Link] = Link,
    ) -> None:
        self._settings = settings
        self._spool = spool
        self._sending = Sending(spool, patience=settings.patience)
        self._on_board = on_board
        self._quantities = quantities
        self._clock = clock
        self._sleep = sleep
        self._now = now
        self._address = address
        self._user = common_name(address.cert) if address.cert else address.user
        self._received: queue.SimpleQueue[tuple[str, bytes]] = queue.SimpleQueue()
        self._announced = _quantities_in(spool.remembered)
        self._has_samples = False
        self._is_described = False
        self._announcement = 0
        self._announcing = Every(settings.patience, clock)
        self._reporting = Every(_REPORT, clock)
        self._examining = Every(_EXAMINE, clock)
        self._warning = Every(_EXAMINE, clock)
        self._problem = ""
        self._blocks: list[Recording] = []
        self._stalling = Every(2 * settings.frame_seconds, clock)
        self._lock = threading.Lock()
        self._link = connect(
            address,
            f"sprung-box-{settings.vehicle}",
            topics=[topic(settings.vehicle, "ack"), topic(settings.vehicle, "cmd")],
            on_message=lambda name, payload: self._received.put((name, payload)),
            on_connected=lambda: self._received.put(("connected", b"")),
        )

    @property
    def is_connected(self) -> bool:
        """Whether the box is connected to the broker."""
        return self._link.is_connected

    @property
    def problem(self) -> str:
        """Known reason why frames do not get through; empty if they do."""
        return self._problem or self.refusal or self._link.problem

    @property
    def refusal(self) -> str:
        """Known reason why the broker refuses messages of the vehicle, and what to do; empty if it accepts them."""
        if not self._link.is_rejected:
            return ""
        vehicle = self._settings.vehicle
        sentence = f"the broker {self._address} refuses messages of vehicle {vehicle!r}"
        if not self._user:
            return f"{sentence}: check its list of permissions (ACL)"
        if self._user == vehicle:
            return f"{sentence}: its list of permissions (ACL) denies them to {vehicle!r}"
        known_by = f"the certificate {self._address.cert}" if self._address.cert else "the user"
        return (
            f"{sentence}, as {known_by} is that of {self._user!r}: use --vehicle-id {self._user}, or the credentials "
            f"of {vehicle}"
        )

    @property
    def losses(self) -> tuple[Loss, ...]:
        """Frames that the spool dropped before the monitor had acknowledged them, as in `Spool.losses`."""
        return self._spool.losses

    @property
    def n_waiting(self) -> int:
        """Number of frames that the monitor has not acknowledged."""
        return sum(1 for _ in self._spool.frames())

    def open(self, *, timeout: float = 0.0) -> None:
        """Start connecting, as `Link.open`."""
        self._link.open(timeout=timeout)

    def resume_time(self) -> int | None:
        """Return the end of the samples in the spool, UTC ns; None if it is empty."""
        payload = self._spool.last_frame()
        return None if payload is None else Header.of(checked_map(payload)).end

    def take(self, block: Recording) -> None:
        """Put a block into the spool as one or more frames."""
        with self._lock:
            self._take(block)

    def step(self) -> None:
        """Handle what has arrived, and send what is due."""
        with self._lock:
            now = self._clock()
            if self._blocks and self._stalling.is_due:
                self._spool_blocks()
            self._receive(now)
            if self._link.is_connected:
                self._send(now)

    def drain(self, *, timeout: float) -> bool:
        """Send what is left, and return whether all of it was acknowledged within a time [s]; not if it is refused."""
        with self._lock:
            self._spool_blocks()
        end = self._clock() + timeout
        while self._clock() < end:
            self.step()
            if next(self._spool.frames(), None) is None:
                return True
            self._sleep(_LOOK)
            if self.refusal:
                break
        return False

    def close(self) -> None:
        """Report that the vehicle is switched off and disconnect; what is in the spool stays there."""
        with self._lock:
            self._spool_blocks()
        self._report(is_leaving=True)
        self._link.close()
        self._spool.close()

    def _take(self, block: Recording) -> None:
        """Put a block into the spool, or into the ring of a box that identifies on board."""
        if not self._has_samples:
            quantities = dict(self._quantities(block))
            self._has_samples = True
            if quantities != self._announced:
                self._announced = quantities
                self._announce()
        if self._on_board is not None:
            self._keep(block, self._on_board.ring)
            for kind, document in self._on_board.take(block):
                self._append({**document, Key.CONFIGURATION: self._settings.configuration, Key.KIND: kind})
            return
        if self._blocks and not _is_followed(self._blocks[-1], block):
            self._spool_blocks()
        if not self._blocks:
            self._stalling.start()
        self._blocks.append(block)
        if _is_complete(self._blocks, self._settings.frame_seconds):
            self._spool_blocks()

    def _spool_blocks(self) -> None:
        """Put the blocks of the present frame into the spool."""
        blocks, self._blocks = self._blocks, []
        if blocks:
            self._keep(joined(blocks) if len(blocks) > 1 else blocks[0], self._spool)

    def _keep(self, block: Recording, spool: Spool) -> None:
        """Put a block into a spool, or a ring, as one or more frames."""
        most = _LARGEST_DATA // (len(block.names) * self._settings.width)
        for first in range(0, block.n_samples, most):
            spool.append(self._encoder(block.part(first, min(first + most, block.n_samples))))

    def _encoder(self, block: Recording) -> Callable[[int, int], bytes]:
        """Return a function that encodes a block as the frame of a boot and a sequence number."""
        settings = self._settings
        counts, scale, flags = quantised(block.samples, width=settings.width)
        interval = round(1e9 / block.sampling_rate)
        start = block.start or 0
        previous = self._spool.previous

        def encoded(boot: int, seq: int) -> bytes:
            frame = Frame(
                settings.vehicle,
                boot,
                seq,
                start,
                interval,
                block.names,
                scale,
                counts,
                settings.width,
                flags,
                time_status=settings.time_status,
                configuration=settings.configuration,
                previous=previous,
            )
            return encode(frame)

        return encoded

    def _append(self, document: Mapping[Any, Any]) -> None:
        """Put a report, or a frame from the ring, into the spool."""
        previous = {} if self._spool.previous is None else {Key.PREVIOUS: list(self._spool.previous)}
        whole = {Key.VERSION: VERSION, Key.VEHICLE: self._settings.vehicle, **document, **previous}
        self._spool.append(lambda boot, seq: message({**whole, Key.BOOT: boot, Key.SEQ: seq}))

    def _receive(self, now: float) -> None:
        """Handle what has arrived."""
        while True:
            try:
                name, payload = self._received.get_nowait()
            except queue.Empty:
                return
            if name == "connected":
                self._sending.start_again(now)
                self._announce()
                self._reporting.reset()
            else:
                self._handle(name, payload, now)

    def _handle(self, name: str, payload: bytes, now: float) -> None:
        """Handle an acknowledgement or a command; ignore malformed ones."""
        try:
            document = checked_map(payload)
        except FormatError:
            return
        boot, seq = document.get(Key.BOOT), document.get(Key.SEQ)
        if name.endswith("/ack") and isinstance(boot, int) and isinstance(seq, int):
            self._sending.acknowledged(boot, seq, now)
        elif name.endswith("/cmd") and document.get("do") == "described":
            self._is_described |= document.get("checksum") == self._announcement
        elif name.endswith("/cmd") and document.get("do") == "speak":
            versions = document.get("versions")
            if isinstance(versions, list) and VERSION not in versions:
                self._problem = f"the monitor reads frames of version {versions}, this box writes {VERSION}: update one"
        elif name.endswith("/cmd") and document.get("do") == "raw":
            number, begin, end = document.get("number", 0), document.get("from"), document.get("to")
            if isinstance(number, int) and isinstance(begin, int) and isinstance(end, int):
                self._publish("event", {"did": "raw", "number": number, **self._answer((number, begin, end))})

    def _send(self, now: float) -> None:
        """Send reports and frames that are due, and the announcement until the monitor has it."""
        if not self._is_described and self._announcing.is_due:
            self._announce()
        if self._reporting.is_due:
            self._report()
        if self._examining.is_due:
            self._examine()
        if self._link.is_rejected and self._warning.is_due:
            self._warn()
        for _, _, payload in self._sending.due(now):
            kind = "raw" if self._on_board is None else checked_map(payload).get(Key.KIND, "raw")
            if not self._link.publish(topic(self._settings.vehicle, kind), payload):
                self._sending.start_again(now)
                break

    def _answer(self, request: "Request") -> Mapping[str, Any]:
        """Send the samples of a request, once only, and return what was sent."""
        if self._on_board is None:
            return {**self._sent([]), "reason": _ALL_SENT}
        answer = self._on_board.answers.get(request)
        if answer is None:
            _, begin, end = request
            headers = []
            for document in self._on_board.frames_between(begin, end):
                self._append(document)
                headers.append(Header.of(document))
            answer = {**self._sent(headers), "reason": "" if headers else _NONE_HELD}
            self._on_board.answers.keep(request, answer)
        return answer

    def _sent(self, headers: list[Header]) -> dict[str, Any]:
        """Return boot, last sequence number, count, start and end of the frames that were sent."""
        return {
            "boot": self._spool.boot,
            "last": self._spool.next_seq - 1,
            "frames": len(headers),
            "from": min((header.start for header in headers), default=0),
            "to": max((header.end for header in headers), default=0),
        }

    def _announce(self) -> None:
        """Publish vehicle file and channels; the broker keeps them for monitors that connect later.

        The channels are remembered in the spool: frames of an earlier start need them before there are new samples.
        """
        if not self._announced:
            return
        self._spool.remember(json.dumps(self._announced))
        document = {
            Key.CONFIGURATION: self._settings.configuration,
            "description": self._settings.description,
            "quantities": self._announced,
            "program": version("sprung"),
            "versions": [VERSION],
        }
        payload = self._message(document)
        self._announcement = checksum(payload)
        self._is_described = False
        self._announcing.start()
        self._link.publish(topic(self._settings.vehicle, "meta"), payload, is_retained=True)

    def _report(self, *, is_leaving: bool = False) -> None:
        """Publish the contents of the spool, of many boots the oldest, and the number of dropped frames."""
        self._reporting.start()
        boots = self._boot_before_oldest() | self._spool.boots
        before = dict([self._spool.previous]) if self._spool.previous else {}
        ends = {**before, self._spool.boot: self._spool.next_seq}
        document = {
            Key.BOOT: self._spool.boot,
            "boots": [[boot, first, ends.get(boot, -1)] for boot, first in sorted(boots.items())[:MAX_BOOTS]],
            "dropped": self._spool.dropped,
            "lost": [list(loss) for loss in self._spool.unreported_losses[:MAX_LOSSES]],
            "spooled": self._spool.n_bytes,
            "time": self._now(),
            "is_leaving": is_leaving,
        }
        self._publish("state", document)

    def _examine(self) -> None:
        """Publish the health of the box."""
        self._examining.start()
        used = resource.getrusage(resource.RUSAGE_SELF)
        document = {
            "cpu_seconds": used.ru_utime + used.ru_stime,
            "memory": used.ru_maxrss * 1024,
            "free": self._spool.free,
            "waiting": self._sending.n_under_way,
            "problem": self.problem,
        }
        self._publish("health", document)

    def _warn(self) -> None:
        """Report to the monitor, under the name that the broker knows, that the vehicle has another one."""
        if self._user != self._settings.vehicle and VEHICLE.fullmatch(self._user):
            self._warning.start()
            document = {Key.VERSION: VERSION, "did": "misnamed", "vehicle": self._settings.vehicle}
            self._link.publish(topic(self._user, "event"), message(document))

    def _boot_before_oldest(self) -> dict[int, int]:
        """Return the boot before that of the oldest frame, and its end; all of its frames may have been dropped."""
        oldest = next(self._spool.frames(), None)
        previous = None if oldest is None else Header.of(checked_map(oldest[2])).previous
        return {} if previous is None else dict([previous])

    def _publish(self, what: str, document: Mapping[Any, Any]) -> None:
        """Publish a map on a topic of the vehicle."""
        self._link.publish(topic(self._settings.vehicle, what), self._message(document))

    def _message(self, document: Mapping[Any, Any]) -> bytes:
        """Return a map as a message of the vehicle."""
        return message({Key.VERSION: VERSION, Key.VEHICLE: self._settings.vehicle, **document})


def _quantities_in(text: str) -> dict[str, str]:
    """Return the quantities of channels that an earlier start remembered; empty if they are damaged."""
    with suppress(ValueError):
        quantities = json.loads(text)
        if isinstance(quantities, dict) and all(isinstance(quantity, str) for quantity in quantities.values()):
            return quantities
    return {}


def _is_followed(block: Recording, by: Recording) -> bool:
    """Return whether a block continues another one: the same channels and rate, without a gap."""
    is_alike = (block.channels, block.sampling_rate) == (by.channels, by.sampling_rate)
    return is_alike and block.start is not None and by.start is not None and not joined([block, by]).gaps


def _is_complete(blocks: Sequence[Recording], length: float) -> bool:
    """Return whether blocks reach the end of their frame: the next multiple of a length [s] in UTC."""
    start, last = blocks[0].start, blocks[-1]
    if not length or start is None or last.start is None:
        return True
    step = round(1e9 * length)
    end = last.start + round(1e9 * (last.n_samples + 0.5) / last.sampling_rate)
    return end // step > start // step
