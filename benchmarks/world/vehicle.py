"""A vehicle: a source of numbered samples, and the real box and spool on a simulated disk."""

from collections.abc import Callable
from functools import cache, partial
from pathlib import Path

import numpy as np
from chance import Chance, Crash
from checker import Checker
from disk import SimulatedDisk
from network import Broker, SimulatedLink

from sprung.link import Address, Spool, SpoolError
from sprung.online.box import Box, BoxSettings
from sprung.recording import Channel, Recording
from sprung.vehicles import read_vehicle, vehicle_text

#: 2026-11-21, UTC ns.
BEGUN = 1_795_219_200_000_000_000
CHANNEL, RATE = "acc_fl", 10.0


class LoggedSpool(Spool):
    """A spool whose frames the checker knows, with what the spool says of each."""

    checker: Checker
    vehicle: str

    def append(self, encoded: Callable[[int, int], bytes]) -> bool:
        def logged(boot: int, seq: int) -> bytes:
            payload = encoded(boot, seq)
            self.checker.record(self.vehicle, payload)
            self.checker.room(self.vehicle, lambda: self.n_bytes, len(payload) + 26, self._most)
            return payload

        is_kept = super().append(logged)
        self.checker.recorded(self.vehicle, is_kept=is_kept)
        self.checker.stated(self.vehicle, self.losses)
        return is_kept

    def acknowledge(self, boot: int, seq: int) -> None:
        self.checker.confirm(self.vehicle, boot, seq)
        super().acknowledge(boot, seq)


class Vehicle:
    """One vehicle with its box, which is killed, loses power, is switched off, and starts again.

    Parameters
    ----------
    name
        Name of the vehicle.
    broker
        Broker of its link.
    chance
        Decides what fails.
    checker
        Knows all samples.
    """

    def __init__(self, name: str, broker: Broker, chance: Chance, checker: Checker) -> None:
        self.name, self._broker, self._chance, self._checker = name, broker, chance, checker
        self.disk = SimulatedDisk(chance, name, on_remove=partial(checker.removed, name))
        random = chance.random
        self._max_bytes = random.choice((4096, 8192, 1 << 16))
        self._is_synced = random.random() < 0.8
        self._is_dated = random.random() < 0.5
        self._channel = random.choice((CHANNEL, CHANNEL + 250 * "x"))  # of large frames few fill a spool
        self._n_samples = 0
        self._box: Box | None = None
        self.spool: LoggedSpool | None = None
        checker.add(name, self.disk, is_synced=self._is_synced)

    @property
    def is_on(self) -> bool:
        """Whether the box runs."""
        return self._box is not None

    @property
    def is_drained(self) -> bool:
        """Whether the box runs, and all its frames and losses are acknowledged."""
        is_on = self._box is not None and self.spool is not None
        return is_on and self._box.n_waiting == 0 and not self.spool.unreported_losses

    @property
    def now(self) -> int:
        """Present time, UTC ns."""
        return BEGUN + round(1e9 * self._chance.clock(self.name))

    def start(self) -> None:
        """Start the box."""
        self._guarded("start", self._start)

    def produce(self) -> None:
        """Let the source hand over some samples, which nobody records while the box is off."""
        n_samples = self._chance.random.randint(1, 5)
        first = self._n_samples + 1
        self._n_samples += n_samples
        if self._box is not None:
            values = np.arange(first, first + n_samples, dtype=np.float64)[None, :]
            block = Recording(values, RATE, (Channel(self._channel, "acceleration"),), self.now)
            self._guarded("append", partial(self._box.take, block))

    def step(self) -> None:
        """Let the box send and handle what arrived."""
        if self._box is not None:
            self._guarded("step", self._box.step)

    def stop(self) -> None:
        """Switch the vehicle off in good order."""
        if self._box is not None:
            self._guarded("stop", self._box.close)
            self._end()

    def kill(self, how: str) -> None:
        """End the box at once: "kill" or "power"."""
        if how == "power":
            self.disk.cut_power()
            self._checker.power_cut(self.name)
        self._end()

    def _start(self) -> None:
        self._checker.starting(self.name)
        boot_from = self.now // 10**6 if self._is_dated else 0
        try:
            spool = LoggedSpool(
                Path("/spool"),
                max_bytes=self._max_bytes,
                is_synced=self._is_synced,
                boot_from=boot_from,
                disk=self.disk,
            )
        except SpoolError as error:
            self._chance.note(str(error), self.name)
            self.disk.kill()
            return
        spool.checker, spool.vehicle = self._checker, self.name
        self._box = Box(
            BoxSettings(self.name, description(), width=4, patience=3.0),
            spool,
            Address("broker", 1883),
            quantities=lambda block: {self._channel: "acceleration"},
            clock=lambda: self._chance.now,
            now=lambda: self.now,
            connect=self._connected,
        )
        self.spool = spool
        self._checker.started(self.name, spool.losses)
        self._chance.note(f"boot {spool.boot} after {spool.previous}", self.name)
        self._box.open()

    def _connected(self, _address: Address, _name: str, **handlers: object) -> SimulatedLink:
        return SimulatedLink(self._broker, self.name, **handlers)

    def _guarded(self, phase: str, act: Callable[[], object]) -> None:
        """Do something that may end the box."""
        self._checker.phase = phase
        try:
            act()
        except Crash as crash:
            self.kill(str(crash))
        finally:
            self._checker.phase = ""

    def _end(self) -> None:
        """Forget the process."""
        self._box = self.spool = None
        self.disk.kill()
        for link in list(self._broker.links):
            if link.name == self.name:
                link.close()


@cache
def description() -> str:
    """Return the text of a vehicle file."""
    return vehicle_text(read_vehicle("zafira"))
