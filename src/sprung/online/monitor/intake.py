"""Intake of messages from vehicles: validated, stored once, and only then acknowledged."""

import logging
import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, TypeAlias, TypeVar

from sprung.errors import FormatError, ParameterError
from sprung.link import (
    VERSION,
    Header,
    Key,
    Loss,
    VersionError,
    check_frame,
    checked_map,
    losses_in,
    message,
    parse_topic,
    span_of,
    topic,
)
from sprung.link.messages import MAX_BOOTS, REPORTS, checksum, count, integer, text
from sprung.online.monitor.alert_book import Context
from sprung.online.monitor.message_queue import (
    BOOTS,
    INVALID,
    QUOTA,
    UNSTORABLE,
    VERSION_UNKNOWN,
    QuotaError,
    Quotas,
    Refusals,
    vehicle_of,
)
from sprung.online.store import Cursor, RefusedError, StoredFrame
from sprung.vehicles import vehicle_from_text

T = TypeVar("T")
#: Sequence number up to which nothing is missing, by vehicle and boot.
_Arrived: TypeAlias = dict[tuple[str, int], int]
#: What descriptions have to store, and their checksums, by vehicle.
_Descriptions: TypeAlias = dict[str, tuple[dict[str, Any], int]]

LOG = logging.getLogger("sprung.monitor")

#: The monitor's own name among the vehicles.
MONITOR = "monitor"
#: Largest number of channels that a vehicle may announce.
_MAX_CHANNELS = 256
#: Largest number of characters of a description.
_MAX_TEXT = 40_000
#: Largest number of characters of a line of a description.
_LONGEST_LINE = 1000
#: Largest number of boots of a vehicle with frames that are not analysed: each takes memory, and time at every step.
_MAX_OPEN_BOOTS = 1000
#: Largest number of frames of a vehicle in a second, and in a year before it was first seen.
_FRAME_RATE = 10
_MAX_FRAMES = _FRAME_RATE * 366 * 86400
#: Fields of a box's answer to a request for samples.
_ANSWER = ("boot", "last", "frames", "from", "to")
#: Time between updates of when vehicles were last seen [ns]: each is a transaction of its own.
_NOTED_EVERY = 10**9
#: Largest number of topics whose first refusal is remembered.
_MAX_REFUSALS = 100
#: Largest number of answers of boxes that are remembered.
_MAX_ANSWERS = 1000


@dataclass(slots=True)
class Taken:
    """Contents of a batch of messages.

    Parameters
    ----------
    arrived
        Sequence number up to which nothing is missing, by vehicle and boot of the messages.
    described
        Checksum of the last description, by vehicle.
    frames
        Frames that were stored, without repeats.
    n_messages
        Number of messages.
    held
        Boots of which a box still has or expects frames, by vehicle of the states that name all of them.
    """

    arrived: _Arrived = field(default_factory=dict)
    described: dict[str, int] = field(default_factory=dict)
    frames: list[StoredFrame] = field(default_factory=list)
    n_messages: int = 0
    held: dict[str, frozenset[int]] = field(default_factory=dict)


class _BootsError(FormatError):
    """A message of a box that counts more starts than are kept."""


class Intake:
    """Takes in messages of vehicles.

    Parameters
    ----------
    context
        Store of the frames, and alerts about lost ones.
    publish
        Function that sends a payload to a topic.
    refusals
        Counts of refused messages; None: its own.

    Notes
    -----
    A frame is acknowledged after the transaction that stored it, and again whenever it is repeated; the acknowledgement
    states the highest sequence number up to which nothing is missing. Every number is checked before the store sees it.
    If the store refuses values all the same, messages are stored vehicle by vehicle, and those of the vehicle singly.
    """

    def __init__(
        self,
        context: Context,
        publish: Callable[[str, bytes], object],
        *,
        refusals: Refusals | None = None,
    ) -> None:
        self._store = context.store
        self._alerts = context.alerts
        self._publish = publish
        self._tally = refusals or Refusals()
        self.quotas = Quotas(context.store.inbox, 60 * context.site.watch.window_minutes)
        self._lost: Counter[str] = Counter()
        self._counts = {"messages": 0, "frames": 0, "lost": 0}
        self._refusals: dict[str, str] = {}
        self._parked: set[str] = set()
        self._free: dict[str, float] = {}
        self._answers: dict[tuple[str, int], Mapping[str, Any]] = {}
        self._seen: dict[str, int] = {}
        self._noted = 0
        self._boots: dict[str, set[int]] = {}
        self._crowded: set[str] = set()

    @property
    def figures(self) -> dict[str, float]:
        """Figures of `station.FIGURES` that count messages, and the least free disk space of a box."""
        counts, free = self._counts, list(self._free.values())
        return {
            "sprung_messages_total": counts["messages"],
            "sprung_messages_refused_total": self._tally.total,
            "sprung_frames_total": counts["frames"],
            "sprung_frames_lost_total": counts["lost"],
            **{
                f'sprung_vehicle_frames_lost_total{{vehicle="{vehicle}"}}': lost
                for vehicle, lost in dict(self._lost).items()
            },
            **({"sprung_boxes_free_bytes": min(free)} if free else {}),
        }

    def is_parked(self, vehicle: str) -> bool:
        """Return whether a vehicle was shut down properly."""
        return vehicle in self._parked

    def recall_parked(self) -> None:
        """Read which vehicles are parked, at the start."""
        self._parked = self._store.inbox.parked()

    def answer(self, vehicle: str, number: int) -> Mapping[str, Any] | None:
        """Return the answer of a box to the request of a number; None before it answered."""
        return self._answers.get((vehicle, number))

    def confirm(self, vehicle: str, checksum: int) -> None:
        """Confirm to a box that the description of a checksum is known: until then it repeats it."""
        document = {Key.VERSION: VERSION, "do": "described", "checksum": checksum}
        self._publish(topic(vehicle, "cmd"), message(document))

    def take(self, messages: Iterable[tuple[str, bytes]], *, now: int) -> Taken:
        """Store the contents of messages, and acknowledge them.

        Parameters
        ----------
        messages
            Topics and payloads.
        now
            Present time, UTC ns.

        Returns
        -------
        Taken
            Frames that are stored, and what else the messages announce.

        Raises
        ------
        StoreError
            If the store cannot write: nothing is acknowledged, and boxes will send the messages again.
        """
        frames: list[StoredFrame] = []
        below: dict[tuple[str, int], int] = {}
        dropped: dict[str, _Dropped] = {}
        taken = Taken()
        new: _Descriptions = {}
        while self._crowded:
            self._boots.pop(self._crowded.pop(), None)  # counted again: many may be analysed by now
        for name, payload in messages:
            self._counts["messages"] += 1
            taken.n_messages += 1
            try:
                vehicle, what = parse_topic(name)
                if vehicle == MONITOR:
                    continue  # messages of monitors about themselves
                if vehicle in new and what != "meta":  # its limits depend on its description
                    self._add_descriptions(new, taken, now)
                if what == "raw" or what in REPORTS:
                    header = check_frame(payload, vehicle) if what == "raw" else _check_report(vehicle, what, payload)
                    self._check_boot(vehicle, header.boot)
                    self.quotas.take(vehicle, header, len(payload), now=now)
                    frames.append(StoredFrame(vehicle, header.boot, header.seq, header.start, payload, what))
                elif what == "state":
                    first, dropped[vehicle] = self._stated(vehicle, checked_map(payload), now)
                    below |= {(vehicle, boot): seq for boot, seq in first.items() if seq > 0}
                    taken.held[vehicle] = frozenset(first if len(first) < MAX_BOOTS else ())
                elif what == "meta":
                    new[vehicle] = self._description(vehicle, checked_map(payload)), checksum(payload)
                else:
                    self._handle(vehicle, what, checked_map(payload))
                # The broker retains descriptions, and sends them even if the vehicle is long gone.
                self._seen |= {} if what == "meta" else {vehicle: now}
            except (FormatError, ParameterError, RefusedError) as error:
                self._refuse(name, error)
        self._add_descriptions(new, taken, now)
        # Frames first: what arrived is not lost.
        taken.arrived |= self._add_frames(frames, taken.frames, now)
        taken.arrived |= self._declare_lost(below, dropped, now)
        if self._seen and abs(now - self._noted) >= _NOTED_EVERY:
            self._store.inbox.seen(self._seen)
            self._seen = {}
            self._noted = now
        for (vehicle, boot), contiguous in taken.arrived.items():
            if contiguous >= 0:
                document = {Key.VERSION: VERSION, Key.BOOT: boot, Key.SEQ: contiguous}
                self._publish(topic(vehicle, "ack"), message(document))
        return taken

    def declare_lost(self, vehicle: str, ends: Mapping[int, int], *, now: int) -> _Arrived:
        """Declare missing frames of boots lost, which their box has no longer, and return up to where none is missing.

        Parameters
        ----------
        vehicle
            Name of the vehicle.
        ends
            Number of frames of each boot.
        now
            Present time, UTC ns.

        Raises
        ------
        StoreError
            If the store cannot write.
        """
        below = {(vehicle, boot): end for boot, end in ends.items()}
        return self._declare_lost(below, {vehicle: _Dropped((), 0)}, now)

    def _stored(
        self, things: Sequence[T], place: Callable[[T], tuple[str, str]], store: Callable[[Sequence[T]], _Arrived]
    ) -> _Arrived:
        """Return up to where nothing is missing after storing things of a vehicle and kind.

        Those that the store refuses are left out: all are tried together, then vehicle by vehicle, then one by one.
        """
        try:
            return store(things)
        except RefusedError as error:
            if len(things) == 1:
                self._refuse(topic(*place(things[0])), error)
                return {}
        by_vehicle: dict[str, list[T]] = {}
        for thing in things:
            by_vehicle.setdefault(place(thing)[0], []).append(thing)
        arrived: _Arrived = {}
        for part in by_vehicle.values() if len(by_vehicle) > 1 else [[thing] for thing in things]:
            arrived |= self._stored(part, place, store)
        return arrived

    def _add_frames(self, frames: Sequence[StoredFrame], new: list[StoredFrame], now: int) -> _Arrived:
        """Store frames, add new ones to `new`, and return up to where none is missing."""

        def add(some: Sequence[StoredFrame]) -> _Arrived:
            arrived = self._store.inbox.add_frames(some, new=new, now=now)
            self._counts["frames"] += len(some)
            return arrived

        return self._stored(frames, lambda frame: (frame.vehicle, frame.kind), add)

    def _declare_lost(
        self, below: Mapping[tuple[str, int], int], dropped: Mapping[str, "_Dropped"], now: int
    ) -> _Arrived:
        """Declare frames lost that boxes no longer have, and return up to where nothing is missing.

        Alerts are part of the transaction: the next frame that arrives is acknowledged beyond what is declared lost,
        and its box then no longer reports it.
        """

        def declare(lost: Sequence[tuple[tuple[str, int], int]]) -> _Arrived:
            with self._store.together():
                progress = self._store.inbox.declare_lost(dict(lost), now=now)
                arrived = self._report_lost(progress, dropped, now)
            for (vehicle, _), (before, after) in progress.items():
                self._counts["lost"] += after.lost - before.lost
                self._lost[vehicle] += after.lost - before.lost
            return arrived

        return self._stored(list(below.items()), lambda loss: (loss[0][0], "state"), declare)

    def _report_lost(
        self, progress: Mapping[tuple[str, int], tuple[Cursor, Cursor]], dropped: Mapping[str, "_Dropped"], now: int
    ) -> _Arrived:
        """Report frames that were declared lost, and return up to where nothing is missing."""
        arrived: _Arrived = {}
        counts: dict[str, dict[int, int]] = {}
        for (vehicle, boot), (before, after) in progress.items():
            stated = dropped[vehicle]
            # Until a box knows that its loss is known here, it states it again.
            if after.contiguous > before.contiguous or boot in stated.n_frames:
                arrived[vehicle, boot] = after.contiguous
                # Frames that neither arrived nor were dropped may be at another monitor, with another store.
                counts.setdefault(vehicle, {})[boot] = min(after.lost, stated.n_frames.get(boot, stated.unstated))
        for vehicle, by_boot in counts.items():
            if any(by_boot.values()):
                # Before the loss is acknowledged, and again if that was interrupted.
                begin, end = span_of(dropped[vehicle].losses)
                self._alerts.report_lost(vehicle, by_boot, begin=begin, end=end, now=now)
        return arrived

    def _check_boot(self, vehicle: str, boot: int) -> None:
        """Refuse a boot if too many of the vehicle wait to be analysed."""
        if vehicle not in self._boots:
            self._boots[vehicle] = set(self._store.inbox.open_boots(vehicle, limit=_MAX_OPEN_BOOTS))
        known = self._boots[vehicle]
        if boot in known:
            return
        if len(known) > _MAX_OPEN_BOOTS // 2:
            self._crowded.add(vehicle)
        if len(known) >= _MAX_OPEN_BOOTS:
            raise _BootsError(
                f"boot {boot} of {vehicle}, while {_MAX_OPEN_BOOTS} of its boots wait to be analysed: a box must "
                "count its starts one by one, and send the oldest first"
            )
        known.add(boot)

    def _handle(self, vehicle: str, what: str, document: dict[Any, Any]) -> None:
        """Handle a message about a box; those of unknown kinds are ignored."""
        if what == "health":
            self._free[vehicle] = _free_bytes(document)
        elif what == "event" and document.get("did") == "raw":
            number, answer = _answer(document)
            self._answers[vehicle, number] = answer
            if len(self._answers) > _MAX_ANSWERS:
                self._answers.pop(next(iter(self._answers)))
        elif what == "event" and document.get("did") == "misnamed":
            raise FormatError(_misnamed(vehicle, document))

    def _refuse(self, name: str, reason: FormatError | ParameterError | RefusedError) -> None:
        """Count a refused message, log the first reason of each topic, and announce the supported version."""
        self._tally.add(vehicle_of(name), _reason(reason))
        if name[:120] not in self._refusals:
            LOG.warning(f"messages on {name[:120]} are refused: {reason}")
        if isinstance(reason, VersionError) and name[:120] not in self._refusals:
            request = message({Key.VERSION: VERSION, "do": "speak", "versions": [VERSION]})
            self._publish(topic(parse_topic(name)[0], "cmd"), request)
        self._refusals[name[:120]] = str(reason)
        if len(self._refusals) > _MAX_REFUSALS:
            self._refusals.pop(next(iter(self._refusals)))

    def _add_descriptions(self, new: _Descriptions, taken: Taken, now: int) -> None:
        """Store descriptions in one transaction, as each alone would wait for the disk, and empty `new`."""

        def add(some: Sequence[tuple[str, tuple[dict[str, Any], int]]]) -> _Arrived:
            with self._store.together():
                for vehicle, (values, _) in some:
                    if values:
                        self._store.inbox.put_vehicle(vehicle, **values, now=now)
            for vehicle, (values, number) in some:
                if values:
                    self.quotas.forget(vehicle)
                taken.described[vehicle] = number
            return {}

        self._stored(list(new.items()), lambda described: (described[0], "meta"), add)
        new.clear()

    def _description(self, vehicle: str, document: dict[Any, Any]) -> dict[str, Any]:
        """Return what a vehicle's description has to store; empty if it is stored."""
        description, quantities = document.get("description"), document.get("quantities")
        configuration = text(document.get(Key.CONFIGURATION))
        if not isinstance(description, str) or not isinstance(quantities, dict):
            raise FormatError("a description without text and quantities of the channels")
        if len(quantities) > _MAX_CHANNELS:
            raise FormatError(f"a description of {len(quantities)} channels: at most {_MAX_CHANNELS}")
        channels = [[text(name), text(quantity)] for name, quantity in quantities.items()]
        # The time to parse a key of many dotted names grows with the square of its length.
        if len(description) > _MAX_TEXT or max(map(len, description.splitlines()), default=0) > _LONGEST_LINE:
            raise FormatError(f"a description of more than {_MAX_TEXT} characters, or {_LONGEST_LINE} in a line")
        known = self._store.inbox.vehicle(vehicle)
        if known is not None and (known.description, known.channels) == (description, channels):
            return {}
        vehicle_from_text(description, source=f"the vehicle file of {vehicle}")
        return {"configuration": configuration, "description": description, "channels": channels}

    def _check_number(self, vehicle: str, n_frames: int, now: int) -> None:
        """Refuse more frames than a box can have made: up to ten a second in a year, and since it was first seen."""
        if n_frames > _MAX_FRAMES:
            known = self._store.inbox.vehicle(vehicle)
            most = _MAX_FRAMES + (0 if known is None else _FRAME_RATE * max(0, now - known.first_seen) // 10**9)
            if n_frames > most:
                raise FormatError(f"a state with {n_frames} frames of {vehicle}: it can have made {most} at most")

    def _stated(self, vehicle: str, document: dict[Any, Any], now: int) -> tuple[dict[int, int], "_Dropped"]:
        """Note whether a box was switched off, and return the first frames of its first boots, and what it dropped."""
        boots, dropped = document.get("boots"), _Dropped.of(document)
        if not isinstance(boots, list):
            raise FormatError("a state without boots")
        first = dict(map(_first_frame, boots[:MAX_BOOTS]))
        self._check_number(vehicle, max(sum(first.values()), sum(dropped.n_frames.values()), dropped.unstated), now)
        if len(first) < MAX_BOOTS:  # otherwise frames of other boots may be left
            for loss in dropped.losses:
                first.setdefault(loss.boot, loss.last + 1)
        for boot in sorted(boot for boot, seq in first.items() if seq > 0):
            self._check_boot(vehicle, boot)
        is_leaving = bool(document.get("is_leaving"))
        if is_leaving != (vehicle in self._parked):
            self._store.inbox.park(vehicle, is_parked=is_leaving)
            (self._parked.add if is_leaving else self._parked.discard)(vehicle)
        return first, dropped


@dataclass(frozen=True, slots=True)
class _Dropped:
    """Frames that a box reports as dropped: with boot and time, or, from older boxes, only their number."""

    losses: tuple[Loss, ...]
    unstated: int

    @classmethod
    def of(cls, document: Mapping[Any, Any]) -> "_Dropped":
        """Return the dropped frames that a state message reports."""
        return cls(tuple(losses_in(document)), 0 if "lost" in document else count(document, "dropped", 0))

    @property
    def n_frames(self) -> dict[int, int]:
        """Number of frames by boot."""
        return {loss.boot: loss.n_frames for loss in self.losses}


def _reason(error: Exception) -> str:
    """Return the reason of a refusal for the figures."""
    kinds = ((VersionError, VERSION_UNKNOWN), (_BootsError, BOOTS), (QuotaError, QUOTA), (RefusedError, UNSTORABLE))
    return next((reason for kind, reason in kinds if isinstance(error, kind)), INVALID)


def _first_frame(entry: Any) -> tuple[int, int]:
    """Return a boot and the first frame of it that a box still has, from an entry of its state."""
    if not isinstance(entry, list) or len(entry) != 3:
        raise FormatError(f"{str(entry)[:40]!r} found where boot, first and end are expected")
    boot, first, _ = map(integer, entry)
    if boot < 0:
        raise FormatError(f"boot={boot} must be at least 0")
    return boot, first


def _check_report(vehicle: str, what: str, payload: bytes) -> Header:
    """Return the header of correlations or modes, if they belong to the vehicle."""
    document = checked_map(payload)
    if (document.get(Key.VERSION), document.get(Key.VEHICLE), document.get(Key.KIND)) != (VERSION, vehicle, what):
        raise FormatError(f"a message other than {what} of {vehicle!r} in version {VERSION}")
    header = Header.of(document)
    count(document, "number")
    return header


def _answer(document: dict[Any, Any]) -> tuple[int, Mapping[str, Any]]:
    """Return the number of a request for samples, and the answer of a box."""
    number, *values = (integer(document.get(key)) for key in ("number", *_ANSWER))
    reason = document.get("reason", "")
    if min(number, *values) < -1 or not isinstance(reason, str):
        raise FormatError(f"an answer without number, {', '.join(_ANSWER)} or with a reason that is not text")
    return number, MappingProxyType({**dict(zip(_ANSWER, values, strict=True)), "reason": reason[:200]})


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
    if isinstance(free, bool) or not isinstance(free, int | float) or not 0 <= free < math.inf:
        raise FormatError("a health report without free disk space")
    return float(free)
