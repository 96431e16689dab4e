"""Time and memory of named cases, each in a process of its own, and tables of them."""

import json
import os
import platform
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from statistics import median

ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS"), "1")
_BARS_OFF = {"TQDM_DISABLE": "1", "MPLBACKEND": "Agg"}
_MIB = 2.0**20


@dataclass
class Stopwatch:
    """Seconds of each part of a run."""

    parts: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def __call__(self, part: str) -> Iterator[None]:
        start = time.perf_counter()
        yield
        self.parts[part] = self.parts.get(part, 0.0) + time.perf_counter() - start

    @property
    def seconds(self) -> float:
        return sum(self.parts.values())


@dataclass(frozen=True)
class Measured:
    """Medians over the repeats of one case."""

    seconds: float
    parts: Mapping[str, float]
    memory: float
    memory_above_imports: float
    n_repeats: int


def peak_memory() -> float:
    """Return the largest resident memory of this process so far [MiB].

    VmHWM, not ru_maxrss: that one starts at what the parent held when it forked.
    """
    status = Path("/proc/self/status")
    if status.exists():
        line = next(line for line in status.read_text(encoding="utf-8").splitlines() if line.startswith("VmHWM"))
        return float(line.split()[1]) / 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1024 if platform.system() == "Linux" else 1) / _MIB


def run_case(case: Callable[[Stopwatch], None]) -> None:
    """Run a case in this process, after its imports, and print what it took as JSON."""
    imported = peak_memory()
    watch = Stopwatch()
    case(watch)
    peak = peak_memory()
    print(json.dumps({"seconds": watch.seconds, "parts": watch.parts, "memory": peak, "imported": imported}))


def measure(script: str, arguments: Sequence[str], *, n_repeats: int) -> Measured:
    """Run `script` with `arguments` in fresh processes with one thread each and return the medians."""
    runs = []
    for _ in range(n_repeats):
        done = subprocess.run(
            [sys.executable, script, *arguments],
            env={**os.environ, **ONE_THREAD, **_BARS_OFF},
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode:
            raise SystemExit(f"{' '.join(arguments)} failed:\n{done.stderr[-2000:]}")
        runs.append(json.loads(done.stdout.splitlines()[-1]))
    return Measured(
        seconds=median(run["seconds"] for run in runs),
        parts={part: median(run["parts"][part] for run in runs) for part in runs[0]["parts"]},
        memory=median(run["memory"] for run in runs),
        memory_above_imports=median(run["memory"] - run["imported"] for run in runs),
        n_repeats=n_repeats,
    )


def print_table(title: str, header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a Markdown table."""
    print(f"\n### {title}\n")
    print("| " + " | ".join(header) + " |")
    print("|" + "---|" * len(header))
    for row in rows:
        print("| " + " | ".join(row) + " |", flush=True)


def print_circumstances(*, peers: Sequence[str] = ("pyoma-2", "koma-python")) -> None:
    """Print the command and what it ran on."""
    cpu = platform.processor() or platform.machine()
    information = Path("/proc/cpuinfo")
    if information.exists():
        names = [line for line in information.read_text(encoding="utf-8").splitlines() if line.startswith("model name")]
        cpu = names[0].split(":")[1].strip() if names else cpu
    packages = ", ".join(f"{name} {version(name)}" for name in ("sprung", *peers, "numpy", "scipy"))
    print(f"`{Path(sys.executable).name} {' '.join(sys.argv)}`\n")
    print(f"Python {platform.python_version()}, {packages}; {cpu}, one thread.")
