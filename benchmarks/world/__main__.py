"""Many seeds of the simulated world, or the trace of one: python benchmarks/world --help."""

import argparse
import logging
import sys
import time
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

from mutants import MUTANTS, RARE, broken

from world import Report, run

#: A folder in memory, where there is one: the durability of SQLite is not what is tested.
_MEMORY = "/dev/shm" if Path("/dev/shm").is_dir() else None


def main() -> int:
    """Run seeds, and return 1 if one of them breaks a promise."""
    parser = argparse.ArgumentParser(prog="python benchmarks/world", description="The protocol in a simulated world.")
    parser.add_argument("--seed", type=int, help="run this seed alone, and print what happens")
    parser.add_argument("--steps", type=int, default=1500, help="steps with faults of each seed")
    parser.add_argument("--first", type=int, default=1, help="first of many seeds")
    parser.add_argument("--faults", type=int, default=20_000, help="faults after which to stop")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="minutes after which to stop")
    parser.add_argument("--mutant", default="", help="break the protocol on purpose: see --mutants")
    parser.add_argument("--mutants", type=int, metavar="N", help="break it in every way, with up to N seeds each")
    parser.add_argument("--known", action="store_true", help="with --mutants: begin at seeds that found the rare ones")
    given = parser.parse_args()
    with TemporaryDirectory(dir=_MEMORY) as folder:
        if given.seed is not None:
            with broken(given.mutant):
                report = run(given.seed, given.steps, Path(folder), on_line=print)
            print(f"digest {report.digest}: {report.failure or 'every promise was kept'}")
            return int(bool(report.failure))
        logging.disable()
        if given.mutants is not None:
            return try_mutants(given, Path(folder))
        return many(given, Path(folder))


def try_mutants(given: argparse.Namespace, folder: Path) -> int:
    """Break the protocol in every way, print how soon the checker finds each, and return 1 if it misses one."""
    n_missed = 0
    print("| broken: the protocol ... | seeds | faults | found as |")
    print("|---|---:|---:|---|")
    for name in MUTANTS if not given.mutant else [given.mutant]:
        first = RARE.get(name, given.first) if given.known else given.first
        n_faults, failure, seed = 0, "", first - 1
        while not failure and seed < first + given.mutants - 1:
            seed += 1
            with broken(name):
                report = run(seed, given.steps, folder)
            n_faults += sum(report.faults.values())
            failure = report.failure
        n_missed += not failure
        seeds = str(seed - first + 1) if failure else "none"
        print(f"| {name} | {seeds} | {n_faults:,d} | {failure[:110] or 'not found'} |", flush=True)
    return int(n_missed > 0)


def many(given: argparse.Namespace, folder: Path) -> int:
    """Run seeds until there were enough faults, print a table, and return 1 if one breaks a promise."""
    begin, seed = time.monotonic(), given.first
    faults: Counter[str] = Counter()
    totals: Counter[str] = Counter()
    failures: list[Report] = []
    while faults.total() < given.faults and time.monotonic() - begin < 60 * given.minutes:
        report = run(seed, given.steps, folder)
        faults.update(report.faults)
        for name in ("frames", "acknowledgements", "windows", "messages", "steps"):
            totals[name] += getattr(report, name)
        if report.failure:
            failures.append(report)
            print(f"seed {seed}: {report.failure}", flush=True)
        seed += 1
    seconds = time.monotonic() - begin
    for name, count in sorted(faults.items(), key=lambda item: -item[1]):
        print(f"{count:9,d}  {name}")
    print(
        f"{faults.total():9,d}  faults in {seed - given.first} seeds, {seconds:.0f} s: "
        f"{60 * faults.total() / seconds:,.0f} a minute, {totals['steps'] / seconds:,.0f} steps/s"
    )
    print(", ".join(f"{totals[name]:,d} {name}" for name in ("frames", "acknowledgements", "windows", "messages")))
    print(f"{len(failures)} seeds broke a promise: {', '.join(str(report.seed) for report in failures[:50])}")
    for report in failures[:1]:
        print(f"replay: python benchmarks/world --seed {report.seed} --steps {report.steps}")
    return int(bool(failures))


if __name__ == "__main__":
    sys.exit(main())
