"""What must hold: the checker knows every sample, every acknowledgement and every message to people."""

import json
import sqlite3
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import cbor2
import numpy as np
from chance import Chance
from disk import SimulatedDisk

from sprung.link import Key, Loss, checked_map, decode
from sprung.link.spool import _intact
from sprung.online.alerts import Message
from sprung.online.store.schema import Packed

#: Kept: the spool said so. Refused: it said that it dropped the frame. Unsure: the box ended before it said anything.
#: Dropped: it kept the frame, and removed it for want of space. Cut: a power cut took it from a spool without sync.
KEPT, REFUSED, UNSURE, DROPPED, CUT = "kept", "refused", "unsure", "dropped", "cut"
Place = tuple[int, int]


class ViolationError(AssertionError):
    """A promise that was broken."""


@dataclass(slots=True)
class Box:
    """What the checker knows of a vehicle."""

    disk: SimulatedDisk
    is_synced: bool
    samples: dict[Place, tuple[int, ...]] = field(default_factory=dict)
    fates: dict[Place, str] = field(default_factory=dict)
    acknowledged: dict[int, int] = field(default_factory=dict)
    appended: Place | None = None
    n_bytes: Callable[[], int] = lambda: 0
    record: int = 0
    most: int = 0
    #: Errors of its disk before the present append, and before the attempts to start; None: it has started.
    n_errors: int = 0
    n_errors_at_start: int | None = None
    #: Dropped frames that it remembers on its disk: the append that dropped the last of them met no error.
    recorded: set[Place] = field(default_factory=set)
    is_dropping: bool = False
    #: Since the present start of the box: acknowledgements that it got, losses that it remembered, frames it dropped.
    confirmed: dict[int, int] = field(default_factory=dict)
    remembered: dict[int, int] = field(default_factory=dict)
    dropped: dict[int, set[int]] = field(default_factory=dict)

    @property
    def is_sound(self) -> bool:
        """Whether its disk never failed, and keeps what was written."""
        return self.is_synced and not self.disk.n_errors


class Checker:
    """Compares what the processes do with what they promise.

    Parameters
    ----------
    path
        File of the monitor's store.
    chance
        Source of the time, for the messages.
    """

    def __init__(self, path: Path, chance: Chance) -> None:
        self._chance = chance
        self._reader = sqlite3.connect(path, isolation_level=None)
        self._boxes: dict[str, Box] = {}
        self._last_row = 0
        self._windows: dict[str, list[tuple[int, ...]]] = defaultdict(list)
        #: Vehicles whose disks failed and whose boots changed places, which no undisturbed monitor would repeat.
        self.reordered: set[str] = set()
        self._delivered: Counter[tuple[str, str]] = Counter()
        self._excused: Counter[tuple[str, str]] = Counter()
        #: How often a monitor failed on a frame since it started, by monitor, vehicle and place; quarantined frames.
        self._failures: dict[str, Counter[tuple[str, Place]]] = defaultdict(Counter)
        self._quarantined: dict[str, set[Place]] = defaultdict(set)
        #: Payload of each frame, by vehicle and by boot and sequence number.
        self.payloads: dict[tuple[str, Place], bytes] = {}
        #: What the boxes do at present: "append", "step", "start", "stop".
        self.phase = ""
        self.n_acknowledgements = self.n_messages = 0

    def close(self) -> None:
        """Close the store."""
        self._reader.close()

    def add(self, vehicle: str, disk: SimulatedDisk, *, is_synced: bool) -> None:
        """Watch a vehicle."""
        self._boxes[vehicle] = Box(disk, is_synced)

    # The box.

    def record(self, vehicle: str, payload: bytes) -> None:
        """A box is about to put a frame into its spool."""
        box, frame = self._boxes[vehicle], decode(payload)
        place = (frame.boot, frame.seq)
        if place in box.samples:
            self._fail(f"{vehicle} numbers a second frame {place}: the monitor would drop it as a duplicate")
        box.samples[place] = tuple(np.rint(frame.samples[0]).astype(int).tolist())
        box.fates[place] = UNSURE
        self.payloads[vehicle, place] = payload
        box.appended = place

    def room(self, vehicle: str, n_bytes: Callable[[], int], record: int, most: int) -> None:
        """A box is about to write a record of some bytes to a spool that holds `n_bytes`, and at most `most`."""
        box = self._boxes[vehicle]
        box.n_bytes, box.record, box.most, box.n_errors = n_bytes, record, most, box.disk.n_errors
        box.is_dropping = False

    def recorded(self, vehicle: str, *, is_kept: bool) -> None:
        """A box has put a frame into its spool, or refused it."""
        box = self._boxes[vehicle]
        assert box.appended is not None
        box.fates[box.appended] = KEPT if is_kept else REFUSED
        if not is_kept:
            box.dropped.setdefault(box.appended[0], set()).add(box.appended[1])
        if box.is_dropping and box.disk.n_errors == box.n_errors:
            box.recorded |= {(boot, seq) for boot, numbers in box.dropped.items() for seq in numbers}
        if box.n_bytes() > box.most:
            self._fail(f"the spool of {vehicle} says that it has {box.n_bytes()} bytes, more than {box.most}")

    def removed(self, vehicle: str, content: bytes) -> None:
        """A box removes a file of records."""
        box = self._boxes[vehicle]
        # A record that could neither be synced nor cut off is in the next file once more.
        others = [each for each in box.disk.contents() if each != content]
        elsewhere = {(boot, seq) for each in others for boot, seq, _ in _intact(each)}
        for boot, seq, _ in _intact(content):
            # One that the box said is lost may be there all the same: its disk neither synced it nor cut it off.
            if (boot, seq) in elsewhere or box.fates.get((boot, seq)) == REFUSED:
                continue
            if (boot, seq) != box.appended and seq > box.confirmed.get(boot, -1):
                box.dropped.setdefault(boot, set()).add(seq)
            if seq <= box.acknowledged.get(boot, -1):
                continue
            is_short = box.disk.n_errors > box.n_errors or box.n_bytes() + len(content) + box.record > box.most
            if self.phase != "append" or not is_short:
                self._fail(f"{vehicle} removes frame {boot, seq}, which nobody has acknowledged, without need")
            box.fates[boot, seq] = DROPPED
            box.is_dropping = True

    def starting(self, vehicle: str) -> None:
        """A box is about to try to start."""
        box = self._boxes[vehicle]
        if box.n_errors_at_start is None:
            box.n_errors_at_start = box.disk.n_errors

    def started(self, vehicle: str, losses: tuple[Loss, ...]) -> None:
        """A box has started: it remembers the losses that the monitor may not have heard of."""
        box = self._boxes[vehicle]
        box.appended, box.confirmed, box.dropped = None, {}, {}
        for content in box.disk.contents():  # a power cut brings back what was removed just before
            back = {(boot, seq) for boot, seq, _ in _intact(content)}
            box.fates |= {place: UNSURE for place in back if box.fates.get(place) == DROPPED}
            box.recorded -= back
        box.remembered = {loss.boot: loss.n_frames for loss in losses}
        if box.disk.n_errors != box.n_errors_at_start:
            box.recorded.clear()  # it may not have been able to read them
        box.n_errors_at_start = None
        if not box.is_synced:
            return
        expected = {place for place, fate in box.fates.items() if fate == DROPPED} if box.is_sound else box.recorded
        dropped: dict[int, list[int]] = defaultdict(list)
        for boot, seq in sorted(expected):
            if box.fates[boot, seq] == DROPPED:
                dropped[boot].append(seq)
        for boot, numbers in dropped.items():
            n_unheard = sum(seq > box.acknowledged.get(boot, -1) for seq in numbers)
            if box.remembered.get(boot, 0) < n_unheard:  # more, where it did not get an acknowledgement
                self._fail(f"{vehicle} dropped {len(numbers)} frames of {boot}, and remembers {box.remembered}")

    def confirm(self, vehicle: str, boot: int, seq: int) -> None:
        """A box got an acknowledgement."""
        box = self._boxes[vehicle]
        box.confirmed[boot] = max(seq, box.confirmed.get(boot, -1))

    def stated(self, vehicle: str, losses: tuple[Loss, ...]) -> None:
        """A box states which frames it has dropped: all of them, and no other."""
        box = self._boxes[vehicle]
        known = {loss.boot: loss for loss in losses}
        for boot in known.keys() | box.dropped.keys():
            numbers = box.dropped.get(boot, set())
            loss, expected = known.get(boot), len(numbers) + box.remembered.get(boot, 0)
            if loss is None or loss.n_frames != expected:
                self._fail(f"{vehicle} states the loss {loss} of {boot}, and not that of {expected} frames")
            if numbers and not (loss.first <= min(numbers) and max(numbers) <= loss.last):
                self._fail(f"{vehicle} states {loss}, and dropped {sorted(numbers)[:9]}")

    def power_cut(self, vehicle: str) -> None:
        """The power of a box failed: without sync its spool may have lost anything."""
        box = self._boxes[vehicle]
        if not box.is_synced:
            left = {(boot, seq) for content in box.disk.contents() for boot, seq, _ in _intact(content)}
            box.fates |= {place: CUT for place, fate in box.fates.items() if fate == KEPT and place not in left}

    # The monitor.

    def acknowledge(self, vehicle: str, payload: bytes) -> None:
        """The monitor acknowledges: all that it says it has must be in the store, whatever happens next."""
        self.n_acknowledgements += 1
        document, box = checked_map(payload), self._boxes[vehicle]
        boot, last = document[Key.BOOT], document[Key.SEQ]
        first = box.acknowledged.get(boot, -1) + 1
        if last < first:
            return
        row = self._one("SELECT contiguous, done, lost FROM cursors WHERE vehicle = ? AND boot = ?", vehicle, boot)
        contiguous, done, n_lost = row or (-1, -1, 0)
        if last > contiguous:
            self._fail(f"{vehicle} {boot} is acknowledged up to {last}, but the store has it up to {contiguous}")
        query = "SELECT seq FROM frames WHERE vehicle = ? AND boot = ? AND seq BETWEEN ? AND ?"
        quarantined = query.replace("frames", "quarantine")
        places = (vehicle, boot, first, last)
        stored = {seq for each in (query, quarantined) for (seq,) in self._reader.execute(each, places)}
        missing = [seq for seq in range(max(first, done + 1), last + 1) if seq not in stored]
        wrong = [seq for seq in missing if box.fates.get((boot, seq)) == KEPT]
        if wrong or len(missing) > n_lost:
            self._fail(f"{vehicle} {boot} is acknowledged up to {last}, but the store has no frames {wrong or missing}")
        concealed = [seq for seq in missing if seq in box.dropped.get(boot, ())]
        counted = self._counted(vehicle).get(str(boot), 0)
        if counted < len(concealed):
            self._fail(f"{vehicle} {boot}: loss of frames {concealed} is acknowledged, and the alert counts {counted}")
        box.acknowledged[boot] = last

    def failed(self, monitor: str, vehicle: str, boot: int, seq: int) -> None:
        """A job of a monitor failed on a frame."""
        self._failures[monitor][vehicle, (boot, seq)] += 1

    def look(self) -> None:
        """Check what the monitor has stored since the last call."""
        self._look_at_windows()
        self._look_at_quarantined_frames()

    def _look_at_windows(self) -> None:
        """Compare new windows with the samples that there were."""
        query = "SELECT rowid, vehicle, number, document FROM observations WHERE rowid > ? ORDER BY rowid"
        for row, vehicle, number, packed in self._reader.execute(query, (self._last_row,)):
            self._last_row = row
            conditions: dict[str, float] = _unpacked(packed)["conditions"]
            samples = tuple(int(value) for value in conditions.values())
            windows = self._windows[vehicle]
            if number != len(windows):
                self._fail(f"window {number} of {vehicle} comes after {len(windows)} windows")
            self._in_order(vehicle, (windows[-1][-1:] if windows else ()) + samples)
            windows.append(samples)

    def _look_at_quarantined_frames(self) -> None:
        """Check that new frames in quarantine failed twice, or are of a window of which one was quarantined before."""
        query = "SELECT vehicle, boot, seq FROM quarantine ORDER BY vehicle, boot, seq"
        new: dict[tuple[str, int], list[int]] = defaultdict(list)
        for vehicle, boot, seq in self._reader.execute(query):
            if (boot, seq) not in self._quarantined[vehicle]:
                new[vehicle, boot].append(seq)
        for (vehicle, boot), numbers in new.items():
            last, before = numbers[-1], self._quarantined[vehicle]
            state = self._one("SELECT boot, seq FROM snapshots WHERE vehicle = ?", vehicle) or (-1, -1)
            is_of_window = any(state < place < (boot, last) for place in before)
            n_needed = 1 if is_of_window else 2
            n_failures = max((each[vehicle, (boot, last)] for each in self._failures.values()), default=0)
            if n_failures < n_needed or (len(numbers) > 1 and not is_of_window):
                self._fail(f"{vehicle}: frames {numbers[:9]} of {boot} are quarantined, which nothing failed on")
            before.update((boot, seq) for seq in numbers)

    def delivered(self, sender: str, message: Message) -> None:
        """People got a message."""
        self.n_messages += 1
        key = sender, _identity(message.document)
        if self._delivered[key] > self._excused[key]:
            self._fail(f"{sender} passes on {key[1]} again, though nothing went wrong")
        self._delivered[key] += 1

    def excuse(self, sender: str, message: Message) -> None:
        """A sender says that it failed with a message that people got: it may come once more."""
        self._excused[sender, _identity(message.document)] += 1

    def monitor_ended(self, monitor: str) -> None:
        """A monitor was killed: messages that it had not yet recorded as sent may come once more by that sender."""
        self.look()
        self._failures.pop(monitor, None)
        recorded = set(self._settled())
        for key, count in self._delivered.items():
            if key not in recorded:
                self._excused[key] = count

    # The end.

    def finish(self, senders: tuple[str, ...]) -> dict[str, list[Place]]:
        """Check what must hold when all faults are over and everything is delivered, and return the frames analysed."""
        self.look()
        analysed = {vehicle: self._finish(vehicle, box) for vehicle, box in self._boxes.items()}
        settled = set(self._settled())
        for (document,) in self._reader.execute("SELECT document FROM notifications"):
            identity = _identity(json.loads(document)["document"])
            for sender in senders:
                if not self._delivered[sender, identity]:
                    is_recorded = (sender, identity) in settled
                    self._fail(f"{sender} never passed on {identity} (recorded as sent: {is_recorded})")
        return analysed

    @property
    def counts(self) -> dict[str, int]:
        """Numbers of frames, acknowledgements, windows and messages to people."""
        return {
            "frames": len(self.payloads),
            "acknowledgements": self.n_acknowledgements,
            "windows": sum(map(len, self._windows.values())),
            "messages": self.n_messages,
        }

    def ends(self, vehicle: str) -> dict[int, int]:
        """Return for each boot how many of its frames arrived or are lost."""
        query = "SELECT boot, contiguous FROM cursors WHERE vehicle = ? ORDER BY boot"
        return {boot: last + 1 for boot, last in self._reader.execute(query, (vehicle,)) if last >= 0}

    def _finish(self, vehicle: str, box: Box) -> list[Place]:
        """Check one vehicle, and return its frames that were analysed."""
        sequence = [number for window in self._windows[vehicle] for number in window]
        row = self._one("SELECT document FROM snapshots WHERE vehicle = ?", vehicle)
        sequence += cbor2.loads(row[0])["samples"] if row else []
        query = "SELECT boot, contiguous, lost, done FROM cursors WHERE vehicle = ?"
        cursors = {boot: (last, lost, done) for boot, last, lost, done in self._reader.execute(query, (vehicle,))}
        query = "SELECT boot, seq FROM frames WHERE vehicle = ? ORDER BY boot, seq"
        waiting = [(boot, seq) for boot, seq in self._reader.execute(query, (vehicle,))]
        behind = [(boot, seq) for boot, seq in waiting if seq <= cursors[boot][2]]
        if behind:
            self._fail(f"{vehicle}: frames {behind[:9]} are analysed, and still in the inbox")
        beyond = [(boot, seq) for boot, seq in waiting if seq > cursors[boot][0]]
        # A box whose disk failed, or that does not sync, may forget a boot of which it has nothing left.
        if beyond and box.is_sound:
            self._fail(f"{vehicle}: frames {beyond[:9]} wait for others that never come")
        sequence += [number for place in waiting if place not in beyond for number in box.samples.get(place, ())]
        self._in_order(vehicle, sequence)
        have, known = set(sequence), {number for samples in box.samples.values() for number in samples}
        if not have <= known:
            self._fail(f"{vehicle}: samples {sorted(have - known)[:9]} are analysed, but no frame had them")
        analysed = [place for place, samples in sorted(box.samples.items()) if have.issuperset(samples)]
        if sum(len(box.samples[place]) for place in analysed) != len(have):
            self._fail(f"{vehicle}: only a part of a frame is analysed")
        quarantined = self._quarantined[vehicle]
        arrived = quarantined.union(analysed)
        missing = [place for place, fate in sorted(box.fates.items()) if fate == KEPT and place not in arrived]
        if missing:
            self._fail(f"{vehicle}: frames {missing[:9]} were kept by its box, and are not analysed")
        for boot, (last, lost, _) in cursors.items():
            count = sum(place[0] == boot for place in analysed)
            n_quarantined = sum(place[0] == boot for place in quarantined)
            if count + n_quarantined + lost != last + 1:
                counts = f"{count} frames analysed, {n_quarantined} quarantined and {lost} lost"
                self._fail(f"{vehicle} {boot}: {counts} of {last + 1}")
            self._compare_losses(vehicle, box, boot, lost)
        return analysed

    def _compare_losses(self, vehicle: str, box: Box, boot: int, lost: int) -> None:
        """Check that the alert about lost frames counts those that the box dropped, and that are lost."""
        number = self._counted(vehicle).get(str(boot), 0)
        if number > lost or (box.is_sound and number != lost):
            self._fail(f"{vehicle} {boot}: {lost} frames are lost, and the alert counts {number}")

    def _counted(self, vehicle: str) -> dict[str, int]:
        """Return the number of frames of each boot that the alert about lost frames counts."""
        row = self._one("SELECT evidence FROM alerts WHERE vehicle = ? AND cause = 'lost'", vehicle)
        counted: dict[str, int] = json.loads(row[0])["boots"] if row else {}
        return counted

    def _settled(self) -> Iterator[tuple[str, str]]:
        """Yield sender and identity of the messages that are recorded as sent."""
        query = (
            "SELECT deliveries.sender, document FROM notifications JOIN deliveries ON notification = notifications.id"
            " WHERE deliveries.sent IS NOT NULL"
        )
        for sender, document in self._reader.execute(query):
            yield sender, _identity(json.loads(document)["document"])

    def _in_order(self, vehicle: str, sequence: Iterable[int]) -> None:
        """Check that samples are analysed in order, each once.

        A box whose disk failed may forget which boot came before, so that the samples of boots may change places.
        """
        box, numbers = self._boxes[vehicle], list(sequence)
        parts = [numbers]
        if not box.is_sound:
            boot_of = {number: boot for (boot, _), samples in box.samples.items() for number in samples}
            parts = [[n for n in numbers if boot_of.get(n) == boot] for boot in sorted({*boot_of.values()})]
            if any(after <= before for before, after in pairwise(numbers)):
                self.reordered.add(vehicle)
        for part in parts:
            for before, after in pairwise(part):
                if after <= before:
                    self._fail(f"{vehicle}: sample {after} is analysed after {before}")

    def _one(self, query: str, *values: object) -> Any:
        return self._reader.execute(query, values).fetchone()

    def _fail(self, sentence: str) -> None:
        raise ViolationError(f"{sentence} (at {self._chance.now:.2f} s)")


def _unpacked(packed: bytes) -> dict[str, Any]:
    """Return a packed document."""
    document: dict[str, Any] = Packed().process_result_value(packed, None)
    return document


def _identity(document: dict[str, Any]) -> str:
    """Return what distinguishes a message to people from others."""
    return f"{document['vehicle']} {document['cause']} {document['what']} {document['updated']}"
