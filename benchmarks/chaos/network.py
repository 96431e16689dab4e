"""Connections that are cut, and a relay that loses, duplicates, delays and damages messages."""

import hashlib
import heapq
import queue
import random
import select
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from stores import VEHICLE, cursors

from results import Result
from sprung.link import Address, Header, Key, Link, checked_map, topic

#: 2026-11-21, UTC ns; and the pause between two drives [s].
BEGUN, PAUSE = 1_795_219_200_000_000_000, 600
#: Shares of the messages, and longest time that one is held back [s].
LOST, DOUBLED, DELAYED, DAMAGED, LONGEST_DELAY = 0.05, 0.20, 0.20, 0.05, 1.0


class Forwarder:
    """Hands bytes on between a port and a broker until the connection is cut."""

    def __init__(self, port: int, target: int) -> None:
        self._port, self._target = port, target
        self._pairs: list[tuple[socket.socket, socket.socket]] = []
        self._lock = threading.Lock()
        self._closed_until = 0.0
        self._is_over = threading.Event()
        self._listener = socket.create_server(("127.0.0.1", port))
        threading.Thread(target=self._listen, daemon=True).start()

    @property
    def url(self) -> str:
        return f"mqtt://127.0.0.1:{self._port}"

    def cut(self, seconds: float) -> None:
        """Let what is under way vanish, and nobody through for a time."""
        self._closed_until = time.monotonic() + seconds
        self._hang_up()

    def close(self) -> None:
        self._is_over.set()
        self._listener.close()
        self._hang_up()

    def _hang_up(self) -> None:
        with self._lock:
            pairs, self._pairs = self._pairs, []
        for one in (each for pair in pairs for each in pair):
            with suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)

    def _listen(self) -> None:
        while not self._is_over.is_set():
            try:
                near, _ = self._listener.accept()
            except OSError:
                return
            far = socket.socket()
            if time.monotonic() < self._closed_until or far.connect_ex(("127.0.0.1", self._target)) != 0:
                near.close()
                far.close()
                continue
            with self._lock:
                self._pairs.append((near, far))
            threading.Thread(target=self._forward, args=(near, far), daemon=True).start()

    def _forward(self, near: socket.socket, far: socket.socket) -> None:
        """Hand bytes on until one side hangs up."""
        other = {near: far, far: near}
        with near, far, suppress(OSError):
            while True:
                for one in select.select([near, far], [], [])[0]:
                    data = one.recv(1 << 16)
                    if not data:
                        return
                    other[one].sendall(data)


class Relay:
    """Carries messages from one broker to another, badly."""

    def __init__(self, upper: str, lower: str, *, generator: random.Random, store: Path, result: Result) -> None:
        self._random, self._store, self._result = generator, store, result
        self._arrived: queue.SimpleQueue[tuple[str, bytes]] = queue.SimpleQueue()
        self._held: list[tuple[float, int, str, bytes]] = []
        self._n_held = 0
        self._meta = b""
        self.ends: dict[int, int] = {}
        self.frames: dict[tuple[int, int], bytes] = {}
        self.position = BEGUN
        self.acknowledged: dict[int, int] = {}
        self.is_calm = False
        self._is_over = threading.Event()
        self._links = {
            "down": Link(
                Address.parse(upper),
                "chaos-box-side",
                topics=[topic(VEHICLE, what) for what in ("raw", "meta", "state")],
                on_message=self._from_box,
            ),
            "up": Link(
                Address.parse(lower),
                "chaos-monitor-side",
                topics=[topic(VEHICLE, "ack")],
                on_message=self._from_monitor,
                on_connected=self._describe,
            ),
        }
        for link in self._links.values():
            link.open()
        self._thread = threading.Thread(target=self._carry, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._is_over.set()
        self._thread.join()
        for link in self._links.values():
            link.close()

    def _from_box(self, name: str, payload: bytes) -> None:
        """Queue a message of the box."""
        if name.endswith("/meta"):
            self._meta = payload
        self._arrived.put((name, payload))

    def _from_monitor(self, name: str, payload: bytes) -> None:
        """Check that what is acknowledged is stored at this moment, before the box receives it."""
        document = checked_map(payload)
        boot, seq = document[Key.BOOT], document[Key.SEQ]
        self._result.acknowledgements += 1
        self.acknowledged[boot] = max(seq, self.acknowledged.get(boot, -1))
        if cursors(self._store).get(boot, (-1, -1, 0))[0] < seq:
            self._result.acknowledged_not_stored += 1
        self._arrived.put((name, payload))

    def _describe(self) -> None:
        """Repeat to a new broker the description that the old one kept for the monitor."""
        if self._meta:
            self._arrived.put((topic(VEHICLE, "meta"), self._meta))

    def _carry(self) -> None:
        """Send what is due."""
        while not self._is_over.is_set():
            with suppress(queue.Empty):
                name, payload = self._arrived.get(timeout=0.02)
                if name.endswith("/raw"):
                    self._record(payload)
                for delay, mangled in self._mangle(payload):
                    self._n_held += 1
                    heapq.heappush(self._held, (time.monotonic() + delay, self._n_held, name, mangled))
            while self._held and self._held[0][0] <= time.monotonic():
                _, _, name, payload = heapq.heappop(self._held)
                link = self._links["down" if name.endswith("/ack") else "up"]
                if link.publish(name, payload, is_retained=name.endswith("/meta")):
                    self._result.sent_to_monitor += name.endswith("/raw")
                else:
                    self._result.lost_on_the_way += 1

    def _record(self, payload: bytes) -> None:
        """Record a frame; the same number must always have the same bytes."""
        header = Header.of(checked_map(payload))
        self.position = max(self.position, header.end)
        digest = hashlib.sha256(payload).digest()
        if self.frames.setdefault((header.boot, header.seq), digest) != digest:
            self._result.failures.append(f"frame {header.boot}/{header.seq} came with different contents")

    def _mangle(self, payload: bytes) -> Iterator[tuple[float, bytes]]:
        """Yield delay and bytes of each copy of a message."""
        chance, result = self._random.random, self._result
        if self.is_calm:
            yield 0.0, payload
            return
        if chance() < DAMAGED:
            result.damaged += 1
            yield 0.0, damaged(payload, self._random)
            if chance() < 0.5:
                return
        if chance() < LOST:
            result.lost_on_the_way += 1
            return
        is_delayed = chance() < DELAYED
        result.delayed += is_delayed
        yield chance() * LONGEST_DELAY if is_delayed else 0.0, payload
        if chance() < DOUBLED:
            result.doubled_on_the_way += 1
            yield chance() * LONGEST_DELAY, payload


def damaged(payload: bytes, generator: random.Random) -> bytes:
    """Return a message that is cut short, has a wrong byte, or is something else altogether."""
    kind, place = generator.randrange(3), generator.randrange(len(payload))
    if kind == 0:
        return payload[:place]
    if kind == 1:
        return payload[:place] + bytes([payload[place] ^ generator.randrange(1, 256)]) + payload[place + 1 :]
    return generator.randbytes(generator.randrange(200))
