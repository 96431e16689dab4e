"""The same drives undisturbed and through a storm of kills, and the comparison of what is stored."""

import random
import signal
import time
import urllib.request
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from network import BEGUN, PAUSE, Forwarder, Relay
from processes import SPRUNG, Program, broker, free_port, is_alive, tail, until
from stores import VEHICLE, contents, cursors, rows

from results import LEAST_ACKNOWLEDGEMENTS, Result
from sprung.formats import write
from sprung.simulation import RoadDrive, simulate_drive
from sprung.vehicles import parse_fault, read_vehicle

#: Share of the time in which a box is not at its start, for its pace.
UPTIME = 0.6


@dataclass(frozen=True)
class Plan:
    """What a run is made of; times in minutes of driving, but `every` in seconds of the clock."""

    minutes: float
    drives: int
    window: float
    kills: int
    every: float
    patience: float
    seed: int

    @property
    def windows(self) -> int:
        return round(self.minutes / self.window)

    @property
    def duration(self) -> float:
        """Of a drive [s]."""
        return 60 * self.minutes / self.drives

    def ahead(self, position: int) -> float:
        """Return what is still to be driven at a time [s]."""
        passed, rest = divmod((position - BEGUN) / 1e9, self.duration + PAUSE)
        return 60 * self.minutes - passed * self.duration - min(rest, self.duration)

    def pace(self, position: int, n_kills: int, starting: float) -> float:
        """Return how fast a box must go from there on to come to the end with the last kill.

        `starting` is the time from the start of the programs to the first frame [s].
        """
        left = max(self.kills - n_kills, 1) * (self.every + starting) * UPTIME
        return max(self.ahead(position) / left, 0.1)

    def least_acknowledgements(self, n_kills: int) -> float:
        """Return how many acknowledgements there must be after a number of kills."""
        return LEAST_ACKNOWLEDGEMENTS * n_kills / self.kills


def drives(folder: Path, plan: Plan) -> list[Path]:
    """Write drives, the last of which has a soft spring, with pauses between them."""
    car, paths = read_vehicle("zafira"), []
    duration = plan.duration
    start = BEGUN
    for number in range(plan.drives):
        faults = (parse_fault("front_left.spring=-0.4"),) if number == plan.drives - 1 else ()
        settings = RoadDrive(duration=duration, snr=50.0, faults=faults)
        run = simulate_drive(car, settings, seed=number).recording
        paths.append(folder / f"drive-{number}.parquet")
        write(replace(run, start=start, history=()), paths[-1])
        start += round((duration + PAUSE) * 1e9)
    return paths


class Rig:
    """Box, brokers, monitor and all between them, in a folder."""

    def __init__(
        self, folder: Path, paths: list[Path], plan: Plan, result: Result, *, starting: float | None = None
    ) -> None:
        folder.mkdir()
        taken: set[int] = set()
        ports = [free_port(taken) for _ in range(5)]
        self.plan, self.result, self.store = plan, result, folder / "store.sqlite"
        self.pace = None if starting is None else plan.pace(BEGUN, 0, starting)
        self._http = ports[4]
        site = folder / "site.toml"
        site.write_text(
            f'schema = "sprung.site/1"\nstore = "sqlite:///{self.store}"\nhttp = "127.0.0.1:{self._http}"\n'
            f"[watch]\nwindow_minutes = {plan.window}\nidentify_every_minutes = 1\nlearning_windows = 2\n"
            f"[keep]\nraw_days = 0\nfree_megabytes = 0\n"
        )
        self.brokers = [broker("broker-a", ports[0], folder), broker("broker-b", ports[1], folder)]
        self.forwarders = [Forwarder(ports[2], ports[0]), Forwarder(ports[3], ports[1])]
        self.monitor = Program(
            "monitor",
            lambda: [*SPRUNG, "monitor", "--site", str(site), "--broker", self.forwarders[1].url],
            folder,
        )
        self.box = Program("box", lambda: self._box_command(paths, folder / "spool"), folder)
        for one in (*self.brokers, self.monitor, self.box):
            one.start()
        urls = [f"mqtt://127.0.0.1:{port}" for port in ports[:2]]
        self.relay = Relay(*urls, generator=random.Random(plan.seed), store=self.store, result=result)
        self.relay.is_calm = starting is None
        self.orphans: set[int] = set()

    def _box_command(self, paths: list[Path], spool: Path) -> list[str]:
        names = [str(path) for path in paths]
        pace = [] if self.pace is None else ["--pace", f"{self.pace:.3f}"]
        where = ["--broker", self.forwarders[0].url, "--spool", str(spool), "--frame-seconds", "0"]
        return [*SPRUNG, "box", *names, "--vehicle", "zafira", "--vehicle-id", VEHICLE, *where, *pace]

    def kill(self, kind: str, generator: random.Random) -> None:
        """End a program without a word, and start it again."""
        one = {"box": self.box, "monitor": self.monitor}.get(kind) or generator.choice(self.brokers)
        self.check()
        if one is self.monitor:
            self.orphans.update(one.children)
        one.end()
        one.start()
        self.result.kills[kind] = self.result.kills.get(kind, 0) + 1

    def check(self) -> None:
        """Record programs that have ended by themselves, other than a box that is done, and restart them."""
        for one in (*self.brokers, self.monitor, self.box):
            code = one.exit_code
            if code is not None and not (one is self.box and code == 0):
                self.result.failures.append(f"{one.name} ended by itself with {code}: {tail(one.log)}")
                one.start()

    def figures(self) -> dict[str, float]:
        """Return the figures of the monitor; none where it does not answer."""
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{self._http}/metrics", timeout=5.0) as answer:
                lines = answer.read().decode().splitlines()
        except OSError:
            return {}
        figures = (line.rpartition(" ") for line in lines if not line.startswith("#"))
        return {name: float(value) for name, _, value in figures}

    def is_finished(self) -> bool:
        """Return whether the box is done and the monitor idle."""
        self.check()
        if self.box.exit_code != 0:
            return False
        figures = self.figures()
        return figures.get("sprung_backlog_frames") == 0 and len(contents(self.store)["observations"]) >= (
            self.plan.windows
        )

    def close(self) -> None:
        self.relay.close()
        for one in (self.box, self.monitor, *self.brokers):
            one.end(signal.SIGTERM)
        for forwarder in self.forwarders:
            forwarder.close()


@contextmanager
def rig(folder: Path, paths: list[Path], plan: Plan, result: Result, *, starting: float | None = None) -> Iterator[Rig]:
    """Return a rig that is taken down in the end: undisturbed, or at a pace for the time of a start [s]."""
    made = Rig(folder, paths, plan, result, starting=starting)
    try:
        yield made
    finally:
        made.close()


def storm(one: Rig, generator: random.Random, starting: float, say: Callable[[str], None]) -> None:
    """Kill and cut at random, as often as planned.

    After every third kill the storm waits for its share of the acknowledgements, so that frames come
    and are stored between them on a busy machine, too; programs are killed while they start all the same.
    """
    plan, result = one.plan, one.result
    until(lambda: one.relay.frames, timeout=60.0, what="the first frame")
    kinds = ["box", "broker", "monitor"]
    for number in range(plan.kills):
        time.sleep(generator.uniform(0.2, 2 * plan.every - 0.2))
        if generator.random() < 0.5:
            generator.choice(one.forwarders).cut(generator.uniform(0.0, 1.5))
            result.cuts += 1
            time.sleep(generator.uniform(0.0, 0.3))
        one.pace = plan.pace(one.relay.position, number, starting)
        # The first of each kind come in turn, so that few kills, too, are of every kind.
        kind = kinds[number] if number < len(kinds) else generator.choice(kinds)
        one.kill(kind, generator)
        if number % 3 == 2:
            least = plan.least_acknowledgements(number + 1)
            until(
                lambda least=least: result.acknowledgements >= least or one.box.exit_code == 0,
                timeout=plan.patience,
                what=f"{least:.0f} acknowledgements after {number + 1} kills",
            )
        if number % 25 == 24:
            ahead = plan.ahead(one.relay.position)
            say(f"{number + 1} kills, {len(one.relay.frames)} frames, {ahead:.0f} s to drive, kept: {result.is_sound}")
    result.acknowledgements_in_storm = result.acknowledgements


def run(plan: Plan, folder: Path, say: Callable[[str], None]) -> Result:
    """Run the drives undisturbed and through the storm, and compare."""
    paths = drives(folder, plan)
    begun = time.monotonic()
    result = Result(plan.seed)
    generator = random.Random(plan.seed + 1)
    with ExitStack() as stack:
        calm = stack.enter_context(rig(folder / "calm", paths, plan, Result(plan.seed)))
        until(lambda: calm.relay.frames, timeout=120.0, what="the first frame")
        starting = time.monotonic() - begun
        one = stack.enter_context(rig(folder / "storm", paths, plan, result, starting=starting))
        try:
            storm(one, generator, starting, say)
            # What is left goes at once, and unharmed: every frame that is lost costs the box its patience.
            one.pace, one.relay.is_calm = None, True
            if one.box.exit_code is None:
                one.kill("box", generator)
            until(one.is_finished, timeout=plan.patience, what="the end of the run after the storm")
            until(calm.is_finished, timeout=plan.patience, what="the end of the undisturbed run")
        except TimeoutError as error:
            result.failures.append(f"{error}: {one.figures()}, cursors {cursors(one.store)}")
        one.monitor.end(signal.SIGTERM)
        if one.monitor.exit_code != 0:
            result.failures.append(f"the monitor stopped with {one.monitor.exit_code}: {tail(one.monitor.log)}")
        with suppress(TimeoutError):
            until(lambda: not any(map(is_alive, one.orphans)), timeout=5.0, what="the end of orphans")
        result.orphans = sum(map(is_alive, one.orphans))
        compare(one, contents(calm.store), result)
    result.seconds = round(time.monotonic() - begun, 1)
    return result


def compare(one: Rig, expected: dict[str, list[tuple[Any, ...]]], result: Result) -> None:
    """Compare the store with that of the undisturbed run, and with what boxes and acknowledgements said."""
    found = contents(one.store)
    result.differs = [name for name in found if found[name] != expected.get(name)]
    result.is_equal = not result.differs and len(found["observations"]) == one.plan.windows
    result.windows, result.findings = len(found["observations"]), len(found["findings"])
    times = Counter(row[1] for row in found["observations"])
    result.windows_doubled = sum(count - 1 for count in times.values())
    result.frames = len(one.relay.frames)
    result.boots = len({boot for boot, _ in one.relay.frames})
    reached = cursors(one.store)
    ends: dict[int, int] = {}
    for boot, seq in one.relay.frames:
        ends[boot] = max(seq, ends.get(boot, -1))
    short = (max(0, last - reached.get(boot, (-1, -1, 0))[0]) for boot, last in ends.items())
    result.frames_lost = sum(short) + sum(lost for _, _, lost in reached.values())
    result.frames_left = rows(one.store, "SELECT count(*) FROM frames")[0][0]
