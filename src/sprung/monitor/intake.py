"""Intake of messages from vehicles: validated, stored once, and only then acknowledged."""

import logging
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from sprung.errors import FormatError, ParameterError
from sprung.link import VERSION, Header, Key, VersionError, checked_map, decode, message, parse_topic, topic
from sprung.link.messages import count, text
from sprung.storage import Store, StoredFrame
from sprung.vehicles import vehicle_from_text

LOG = logging.getLogger("sprung.monitor")

#: The monitor's own name among the vehicles.
MONITOR = "monitor"
#: Largest number of channels that a vehicle may announce, and of characters of its description, of a line, and a name.
_MOST_CHANNELS, _MOST_TEXT, _LONGEST_LINE, _LONGEST_NAME = 256, 100_000, 1000, 256
#: Kinds of messages that boxes with on-board identification send in the sequence of frames.
REPORTS = ("corr", "modes")
#: Fields of a box's answer to a request for samples.
_ANSWER = ("boot", "last", "frames", "from", "to")
#: Time between updates of when vehicles were last seen [ns]: each is a transaction of its own.
_NOTED_EVERY = 10**9
#: Largest number of refusals, and of answers of boxes, that are remembered.
_MOST_REFUSALS, _MOST_ANSWERS = 100, 1000


@dataclass(frozen=True, slots=True)
class Taken:
    """Contents of a batch of messages.

    Parameters
    ----------
    arrived
        Sequence number up to which nothing is missing, by vehicle and boot of the messages.
    described
        Vehicles with a new description.
    frames
        Frames that were stored.
    """

    arrived: dict[tuple[str, int], int] = field(default_factory=dict)
    described: set[str] = field(default_factory=set)
    frames: list[StoredFrame] = field(default_factory=list)


class Intake:
    """Takes in messages of vehicles.

    Parameters
    ----------
    store
        Store of the frames.
    publish
        Function that sends a payload to a topic.

    Notes
    -----
    A frame is acknowledged after the transaction that stored it, and again whenever it is repeated; the acknowledgement
    has the highest sequence number up to which nothing is missing.
    """

    def __init__(self, store: Store, publish: Callable[[str, bytes], object]) -> None:
        self._store, self._publish = store, publish
        self._counts = {"messages": 0, "refused": 0, "frames": 0, "lost": 0}
        self._refusals: dict[str, str] = {}
        self._parked: set[str] = set()
        self._free: dict[str, float] = {}
        self._answers: dict[tuple[str, int], Mapping[str, Any]] = {}
        self._seen: dict[str, int] = {}
        self._noted = 0

    @property
    def figures(self) -> dict[str, float]:
        """Figures of `sprung.monitor.serving.FIGURES` that count messages, and the least free disk space of a box."""
        counts, free = self._counts, list(self._free.values())
        return {
            "sprung_messages_total": counts["messages"],
            "sprung_messages_refused_total": counts["refused"],
            "sprung_frames_total": counts["frames"],
            "sprung_frames_lost_total": counts["lost"],
            **({"sprung_boxes_free_bytes": min(free)} if free else {}),
        }

    def is_parked(self, vehicle: str) -> bool:
        """Return whether a vehicle was switched off in good order."""
        return vehicle in self._parked

    def answer(self, vehicle: str, number: int) -> Mapping[str, Any] | None:
        """Return the answer of a box to the request of a number; None before it answered."""
        return self._answers.get((vehicle, number))

    def take(self, messages: Iterable[tuple[str, bytes]], *, now: int) -> Taken:
        """Store the contents of messages, and acknowledge them.

        Parameters
        ----------
        messages
            Topics and payloads.
        now
            Present time, UTC ns.

        Raises
        ------
        StoreError
            If the store cannot write: nothing is acknowledged, and boxes will send the messages again.
        """
        frames: list[StoredFrame] = []
        taken = Taken()
        for name, payload in messages:
            self._counts["messages"] += 1
            try:
                vehicle, what = parse_topic(name)
                if vehicle == MONITOR:
                    continue  # messages of monitors about themselves
                if what == "raw" or what in REPORTS:
                    frames.append(_frame(vehicle, payload) if what == "raw" else _report(vehicle, what, payload))
                else:
                    self._handle(vehicle, what, checked_map(payload), taken, now)
                # The broker retains descriptions, and sends them even if the vehicle is long gone.
                self._seen |= {} if what == "meta" else {vehicle: now}
            except (FormatError, ParameterError) as error:
                self._refuse(name, error)
        if frames:
            taken.arrived.update(self._store.inbox.add_frames(frames, now=now))
            taken.frames.extend(frames)
            self._counts["frames"] += len(frames)
        if self._seen and abs(now - self._noted) >= _NOTED_EVERY:
            self._store.inbox.seen(self._seen)
            self._seen, self._noted = {}, now
        for (vehicle, boot), contiguous in taken.arrived.items():
            if contiguous >= 0:
                document = {Key.VERSION: VERSION, Key.BOOT: boot, Key.SEQ: contiguous}
                self._publish(topic(vehicle, "ack"), message(document))
        return taken

    def _handle(self, vehicle: str, what: str, document: dict[Any, Any], taken: Taken, now: int) -> None:
        """Handle a message that is neither a frame nor a report; those of unknown kinds are ignored."""
        if what == "meta" and self._describe(vehicle, document, now):
            taken.described.add(vehicle)
        elif what == "health":
            self._free[vehicle] = _free_bytes(document)
        elif what == "event" and document.get("did") == "raw":
            self._keep_answer(vehicle, document)
        elif what == "event" and document.get("did") == "misnamed":
            raise FormatError(_misnamed(vehicle, document))
        elif what == "state":
            taken.arrived.update(self._update_state(vehicle, document, now))

    def _refuse(self, name: str, reason: FormatError | ParameterError) -> None:
        """Count a refused message, log the first reason of each topic, and announce the supported version."""
        self._counts["refused"] += 1
        if name[:120] not in self._refusals:
            LOG.warning(f"messages on {name[:120]} are refused: {reason}")
        if isinstance(reason, VersionError) and name[:120] not in self._refusals:
            request = message({Key.VERSION: VERSION, "do": "speak", "versions": [VERSION]})
            self._publish(topic(parse_topic(name)[0], "cmd"), request)
        self._refusals[name[:120]] = str(reason)
        if len(self._refusals) > _MOST_REFUSALS:
            self._refusals.pop(next(iter(self._refusals)))

    def _describe(self, vehicle: str, document: dict[Any, Any], now: int) -> bool:
        """Store a vehicle's description, and return whether it is new."""
        description, quantities = document.get("description"), document.get("quantities")
        configuration = document.get(Key.CONFIGURATION)
        if not isinstance(description, str) or not isinstance(configuration, str) or not isinstance(quantities, dict):
            raise FormatError("a description without text, configuration and quantities of the channels")
        if len(quantities) > _MOST_CHANNELS:
            raise FormatError(f"a description of {len(quantities)} channels: at most {_MOST_CHANNELS}")
        # The time to parse a key of many dotted names grows with the square of its length.
        if len(description) > _MOST_TEXT or max(map(len, description.splitlines()), default=0) > _LONGEST_LINE:
            raise FormatError(f"a description of more than {_MOST_TEXT} characters, or {_LONGEST_LINE} in a line")
        if any(len(name) > _LONGEST_NAME or "\0" in name for name in map(str, (configuration, *quantities))):
            raise FormatError(f"names of more than {_LONGEST_NAME} characters in a description, or with a null in them")
        vehicle_from_text(description, source=f"the vehicle file of {vehicle}")
        channels = [[str(name), str(quantity)] for name, quantity in quantities.items()]
        inbox = self._store.inbox
        known = inbox.vehicle(vehicle)
        if known is not None and (known.description, known.channels) == (description, channels):
            return False
        inbox.put_vehicle(vehicle, configuration=configuration, description=description, channels=channels, now=now)
        return True

    def _keep_answer(self, vehicle: str, document: dict[Any, Any]) -> None:
        """Keep the answer of a box to a request."""
        number, answer = _answer(document)
        self._answers[vehicle, number] = answer
        if len(self._answers) > _MOST_ANSWERS:
            self._answers.pop(next(iter(self._answers)))

    def _update_state(self, vehicle: str, document: dict[Any, Any], now: int) -> dict[tuple[str, int], int]:
        """Declare lost the frames that a box no longer has, and note whether it was switched off."""
        (self._parked.add if document.get("is_leaving") else self._parked.discard)(vehicle)
        arrived = {}
        boots = document.get("boots")
        if not isinstance(boots, list) or len(boots) > 10_000:
            raise FormatError("a state without boots")
        for entry in boots:
            if not (isinstance(entry, list) and len(entry) == 3 and all(isinstance(number, int) for number in entry)):
                raise FormatError(f"{str(entry)[:40]!r} found where boot, first and end are expected")
            boot, first, _ = entry
            if first > 0:
                inbox = self._store.inbox
                known = inbox.cursor(vehicle, boot)
                if known.contiguous < first - 1:
                    arrived[vehicle, boot] = inbox.declare_lost(vehicle, boot, first, now=now)
                    self._counts["lost"] += inbox.cursor(vehicle, boot).lost - known.lost
        return arrived


def _frame(vehicle: str, payload: bytes) -> StoredFrame:
    """Return a frame in the form of the store, if it belongs to the vehicle."""
    frame = decode(payload)
    if frame.vehicle != vehicle:
        raise FormatError(f"a frame of {frame.vehicle!r} on the topic of {vehicle!r}")
    return StoredFrame(vehicle, frame.boot, frame.seq, frame.start, payload)


def _report(vehicle: str, what: str, payload: bytes) -> StoredFrame:
    """Return correlations or modes in the form of the store, if they belong to the vehicle."""
    document = checked_map(payload)
    if (document.get(Key.VERSION), document.get(Key.VEHICLE), document.get(Key.KIND)) != (VERSION, vehicle, what):
        raise FormatError(f"a message other than {what} of {vehicle!r} in version {VERSION}")
    header = Header.of(document)
    count(document, "number")
    return StoredFrame(vehicle, header.boot, header.seq, header.start, payload, what)


def _answer(document: dict[Any, Any]) -> tuple[int, Mapping[str, Any]]:
    """Return the number of a request for samples, and the answer of a box."""
    number, reason = document.get("number"), document.get("reason", "")
    answer = {key: document.get(key) for key in _ANSWER}
    for value in (number, *answer.values()):
        if not isinstance(value, int) or not -1 <= value < 2**63:
            raise FormatError(f"an answer without number, {', '.join(_ANSWER)}")
    return int(number or 0), MappingProxyType({**answer, "reason": str(reason)[:200]})


def _misnamed(user: str, document: dict[Any, Any]) -> str:
    """Return the sentence about a box whose vehicle has another name than the broker knows it by."""
    vehicle = text(document.get("vehicle"))
    return (
        f"a box with the certificate of {user!r} calls itself {vehicle!r}, so that the broker refuses its samples: use "
        f"--vehicle-id {user} on the box, or give it the certificate of {vehicle}"
    )


def _free_bytes(document: dict[Any, Any]) -> float:
    """Return the free space on the disk of a box [bytes]."""
    free = document.get("free")
    if not isinstance(free, int | float) or not free >= 0:
        raise FormatError("a health report without free disk space")
    return float(free)
