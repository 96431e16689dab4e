"""What vehicles send: validated, stored once, and only then acknowledged."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

from sprung.errors import FormatError, ParameterError
from sprung.link import VERSION, VersionError, checked_map, decode, message, parse_topic, topic
from sprung.storage import Store
from sprung.vehicles import vehicle_from_text

#: The monitor's own name among the vehicles.
MONITOR = "monitor"
#: Most channels that a vehicle may announce, and most characters of its description, a line of that, and a name.
_MOST_CHANNELS, _MOST_TEXT, _LONGEST_LINE, _LONGEST_NAME = 256, 100_000, 1000, 256
#: What boxes that identify on board send in line with frames.
KINDS = ("corr", "modes")
#: What a box that was asked for samples says of them: boot and number of the last frame, how many, of which time.
_ANSWER = ("boot", "last", "frames", "from", "to")
#: Time between notes of when vehicles were heard of [ns]: each is a transaction of its own.
_NOTED_EVERY = 10**9
#: Refusals, and answers of boxes, that are remembered.
_MOST_REFUSALS, _MOST_ANSWERS = 100, 1000


@dataclass(slots=True)
class Intake:
    """Takes in messages of vehicles.

    Parameters
    ----------
    store
        Where frames are kept.
    publish
        Sends topic and payload.

    Attributes `parked` and `mixed` are the vehicles that said goodbye, and those that send more than samples; `health`
    is the room on the disk of each box [bytes]; `answers` is what boxes say they sent, by vehicle and number of the
    request.

    Notes
    -----
    A frame is acknowledged after the transaction that stored it, and again whenever it comes again: the highest
    sequence number up to which nothing is missing.
    """

    store: Store
    publish: Callable[[str, bytes], object]
    counts: dict[str, int] = field(default_factory=lambda: {"messages": 0, "refused": 0, "frames": 0, "lost": 0})
    refusals: dict[str, str] = field(default_factory=dict)
    parked: set[str] = field(default_factory=set)
    mixed: set[str] = field(default_factory=set)
    health: dict[str, float] = field(default_factory=dict)
    answers: dict[tuple[str, int], dict[str, Any]] = field(default_factory=dict)
    _heard: dict[str, int] = field(default_factory=dict)
    _noted: int = 0

    def take(self, messages: Iterable[tuple[str, bytes]], *, now: int) -> tuple[dict[tuple[str, int], int], set[str]]:
        """Store what messages hold.

        Parameters
        ----------
        messages
            Topics and payloads.
        now
            UTC ns.

        Returns
        -------
        tuple
            The contiguous sequence number of each vehicle and boot of which something came, and the vehicles whose
            description is new.

        Raises
        ------
        StoreError
            Where the store cannot write: nothing of it is acknowledged, and boxes will send it again.
        """
        frames: list[tuple[str, int, int, int, bytes]] = []
        arrived: dict[tuple[str, int], int] = {}
        described: set[str] = set()
        seen: dict[str, int] = {}
        for name, payload in messages:
            self.counts["messages"] += 1
            try:
                vehicle, what = parse_topic(name)
                if vehicle == MONITOR:
                    continue  # what monitors say of themselves
                if what in ("raw", *KINDS):
                    frames.append(self._in_line(vehicle, what, payload))
                elif what == "meta":
                    if self._described(vehicle, checked_map(payload), now):
                        described.add(vehicle)
                elif what in ("health", "event"):
                    self._told(vehicle, what, checked_map(payload))
                elif what == "state":
                    arrived.update(self._stated(vehicle, checked_map(payload), now))
                # Descriptions are kept by the broker and come again when the vehicle is long gone.
                seen |= {} if what == "meta" else {vehicle: now}
            except (FormatError, ParameterError) as error:
                self._refuse(name, error)
        if frames:
            stored = self.store.inbox.add_frames(frames, now=now)
            self.counts["frames"] += len(frames)
            arrived.update(stored)
        self._heard |= seen
        if self._heard and abs(now - self._noted) >= _NOTED_EVERY:
            self.store.inbox.seen(self._heard)
            self._heard, self._noted = {}, now
        for (vehicle, boot), contiguous in arrived.items():
            if contiguous >= 0:
                self.publish(topic(vehicle, "ack"), message({0: 1, 2: boot, 3: contiguous}))
        return arrived, described

    def _in_line(self, vehicle: str, what: str, payload: bytes) -> tuple[str, int, int, int, bytes]:
        """Return what stands in line to be worked up, as the store takes it."""
        if what == "raw":
            return _frame(vehicle, payload)
        self.mixed.add(vehicle)
        return _report(vehicle, what, payload)

    def _refuse(self, name: str, why: FormatError | ParameterError) -> None:
        """Remember why a message was refused: the last of each topic, and not too many; say which version is read."""
        self.counts["refused"] += 1
        if isinstance(why, VersionError) and name[:120] not in self.refusals:
            wish = message({0: VERSION, "do": "speak", "versions": [VERSION]})
            self.publish(topic(parse_topic(name)[0], "cmd"), wish)
        self.refusals[name[:120]] = str(why)
        if len(self.refusals) > _MOST_REFUSALS:
            self.refusals.pop(next(iter(self.refusals)))

    def _described(self, vehicle: str, document: dict[Any, Any], now: int) -> bool:
        """Keep a vehicle's description; tell whether it is new."""
        text, configuration, quantities = (document.get(key) for key in ("description", 14, "quantities"))
        if not isinstance(text, str) or not isinstance(configuration, str) or not isinstance(quantities, dict):
            raise FormatError("a description without text, configuration and quantities of the channels")
        if len(quantities) > _MOST_CHANNELS:
            raise FormatError(f"a description of {len(quantities)} channels: at most {_MOST_CHANNELS}")
        # A key of many dotted names is work with the square of its length.
        if len(text) > _MOST_TEXT or max(map(len, text.splitlines()), default=0) > _LONGEST_LINE:
            raise FormatError(f"a description of more than {_MOST_TEXT} characters, or {_LONGEST_LINE} in a line")
        if any(len(one) > _LONGEST_NAME or "\0" in one for one in map(str, (configuration, *quantities))):
            raise FormatError(f"names of more than {_LONGEST_NAME} characters in a description, or with a null in them")
        vehicle_from_text(text, source=f"the vehicle file of {vehicle}")
        channels = [[str(name), str(quantity)] for name, quantity in quantities.items()]
        known = self.store.inbox.vehicle(vehicle)
        if known is not None and (known.description, known.channels) == (text, channels):
            return False
        self.store.inbox.put_vehicle(vehicle, configuration=configuration, description=text, channels=channels, now=now)
        return True

    def _told(self, vehicle: str, what: str, document: dict[Any, Any]) -> None:
        """Remember how a box is, or what it says it sent when it was asked for samples."""
        if what == "health":
            self.health[vehicle] = _health(document)
        elif document.get("did") == "raw":
            number, answer = _answer(document)
            self.answers[vehicle, number] = answer
            if len(self.answers) > _MOST_ANSWERS:
                self.answers.pop(next(iter(self.answers)))

    def _stated(self, vehicle: str, document: dict[Any, Any], now: int) -> dict[tuple[str, int], int]:
        """Heed what a box no longer has, as such frames will never come, and whether it is switched off."""
        (self.parked.add if document.get("is_leaving") else self.parked.discard)(vehicle)
        arrived = {}
        boots = document.get("boots")
        if not isinstance(boots, list) or len(boots) > 10_000:
            raise FormatError("a state without boots")
        for entry in boots:
            if not (isinstance(entry, list) and len(entry) == 3 and all(isinstance(one, int) for one in entry)):
                raise FormatError(f"{str(entry)[:40]!r} stands where boot, first and end belong")
            boot, first, _ = entry
            if first > 0:
                known = self.store.inbox.cursor(vehicle, boot)
                if known.contiguous < first - 1:
                    arrived[vehicle, boot] = self.store.inbox.declare_lost(vehicle, boot, first, now=now)
                    self.counts["lost"] += self.store.inbox.cursor(vehicle, boot).lost - known.lost
        return arrived


def _frame(vehicle: str, payload: bytes) -> tuple[str, int, int, int, bytes]:
    """Return a frame as the store takes it, if it is one of the vehicle."""
    frame = decode(payload)
    if frame.vehicle != vehicle:
        raise FormatError(f"a frame of {frame.vehicle!r} on the topic of {vehicle!r}")
    return vehicle, frame.boot, frame.seq, frame.start, payload


def _report(vehicle: str, what: str, payload: bytes) -> tuple[str, int, int, int, bytes]:
    """Return correlations or modes as the store takes them, if they are those of the vehicle."""
    document = checked_map(payload)
    if document.get(0) != 1 or document.get(1) != vehicle or document.get(16) != what:
        raise FormatError(f"a message that is none of {vehicle!r}'s {what} in version 1")
    boot, seq, start, number = (document.get(key) for key in (2, 3, 4, "number"))
    for one in (boot, seq, start, number):
        if not isinstance(one, int) or not 0 <= one < 2**63:
            raise FormatError(f"{what} without boot, sequence number, time and number")
    return vehicle, int(boot or 0), int(seq or 0), int(start or 0), payload


def _answer(document: dict[Any, Any]) -> tuple[int, dict[str, Any]]:
    """Return the number of a request for samples, and what a box says it sent."""
    number, reason = document.get("number"), document.get("reason", "")
    answer = {key: document.get(key) for key in _ANSWER}
    for one in (number, *answer.values()):
        if not isinstance(one, int) or not -1 <= one < 2**63:
            raise FormatError(f"an answer without number, {', '.join(_ANSWER)}")
    return int(number or 0), {**answer, "reason": str(reason)[:200]}


def _health(document: dict[Any, Any]) -> float:
    """Return the room on the disk of a box."""
    free = document.get("free")
    if not isinstance(free, int | float) or not free >= 0:
        raise FormatError("a report of health without the room on the disk")
    return float(free)
