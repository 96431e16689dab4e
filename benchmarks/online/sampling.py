"""CPU time of the parts of this process, by where it is every few milliseconds of CPU time."""

import signal
import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from types import FrameType
from typing import Any

#: A part, and the modules or functions (`module.py:function`) that belong to it.
Place = tuple[str, tuple[str, ...]]

ANALYSIS, STATION, BENCHMARK = "analysis: ", "station: ", "benchmark"
#: The modules in which a worker, and the station, begins.
OF_WORKER, OF_MONITOR = "monitor/jobs.py", "monitor/station.py"
#: Parts of the analysis by the innermost place on the stack.
OF_ANALYSIS: tuple[Place, ...] = (
    ("lines", ("signals/harmonics.py", "signals/narrow_lines.py", "identification/planning.py:search_harmonics")),
    (
        "ladders, SVD, selection",
        (
            "identification/subspace.py",
            "identification/stabilisation.py",
            "identification/correlation.py",
            "identification/ladders.py",
        ),
    ),
    (
        "sensor checks",
        ("diagnosis/sensors.py", "vehicles/sensor_checks.py", "vehicles/channel_faults.py", "vehicles/rigid_body.py"),
    ),
    (
        "decimation, preparation",
        (
            "signals/conditioning.py",
            "identification/planning.py",
            "identification/ladders.py",
            "vehicles/window.py",
            "link/frame.py:joined",
        ),
    ),
    (
        "correlations",
        (
            "identification/correlation.py",
            "identification/records.py",
            "identification/band_fits.py",
            "identification/levels.py",
            "diagnosis/residuals.py",
        ),
    ),
    ("corner fit", ("sprung/likelihood/", "signals/spectrum.py")),
    ("frames decoded", ("link/frame.py", "link/messages.py")),
    ("state", ("monitor/engine.py:state", "monitor/engine.py:write_state", "monitor/assessment.py:state")),
    ("learning", ("diagnosis/learning.py", "sprung/calibration/")),
    ("diagnosis", ("sprung/diagnosis/",)),
)
#: Parts of the station: the first one of which any place is on the stack.
OF_STATION: tuple[Place, ...] = (
    ("archive", ("link/archive.py",)),
    ("alerts", ("monitor/alert_book.py",)),
    ("insert", ("store/inbox.py:add_frames",)),
    ("read back", ("store/inbox.py:pending",)),
    ("settle, commit", ("monitor/dispatch.py:settle", "monitor/dispatch.py:flush")),
    ("housekeeping", ("monitor/housekeeping.py",)),
    ("receive, decode, acknowledge", ("monitor/intake.py",)),
    ("give", ("monitor/dispatch.py:give",)),
    ("leases, follow", ("monitor/station.py:_follow",)),
)


@dataclass
class Sampler:
    """CPU seconds by part, of the main thread and what runs meanwhile."""

    seconds: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    _since: float = 0.0

    @contextmanager
    def running(self, *, every: float = 0.004) -> Iterator[None]:
        """Sample within the context, after each interval `every` of CPU time [s]."""
        before = signal.signal(signal.SIGPROF, self._count)
        self._since = time.process_time()
        signal.setitimer(signal.ITIMER_PROF, every, every)
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0.0)
            signal.signal(signal.SIGPROF, before)

    def per_hour(self, kind: str, hours: float) -> dict[str, float]:
        """Return CPU seconds per hour of each part of a kind."""
        parts = OF_ANALYSIS if kind == ANALYSIS else OF_STATION
        return {name: self.seconds.get(kind + name, 0.0) / hours for name in (*(name for name, _ in parts), "rest")}

    def _count(self, _number: int, frame: FrameType | None) -> Any:
        now = time.process_time()
        self.seconds[_part(_stack(frame))] += now - self._since
        self._since = now


def _stack(frame: FrameType | None) -> list[str]:
    """Return file and function of each frame of the program, the innermost first."""
    stack = []
    while frame is not None:
        if "sprung" in frame.f_code.co_filename or "benchmarks" in frame.f_code.co_filename:
            stack.append(f"{frame.f_code.co_filename}:{frame.f_code.co_name}")
        frame = frame.f_back
    return stack


def _part(stack: Sequence[str]) -> str:
    """Return the part that a stack belongs to: that of a worker, or of the station."""
    if any("cpu_time.py:echoed" in place for place in stack):
        return BENCHMARK
    if any(OF_WORKER in place for place in stack):
        return ANALYSIS + _first(stack, OF_ANALYSIS)
    if any(OF_MONITOR in place for place in stack):
        parts = (name for name, belonging in OF_STATION if _first(stack, [(name, belonging)]) == name)
        return STATION + next(parts, "rest")
    return BENCHMARK


def _first(stack: Sequence[str], parts: Sequence[Place]) -> str:
    """Return the part of the first place on a stack that belongs to one."""
    for place in stack:
        for name, belonging in parts:
            if any(one in place for one in belonging):
                return name
    return "rest"


def reference() -> float:
    """Return the CPU seconds of ten million additions, by which figures of busy machines can be compared."""
    begin, total = time.process_time(), 0
    for number in range(10**7):
        total += number
    return time.process_time() - begin
