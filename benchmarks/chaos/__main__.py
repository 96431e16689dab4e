"""Whether the online system keeps its promises while processes are killed and messages lost, duplicated and damaged.

    box -> forwarder -> broker A -> relay -> broker B -> forwarder -> monitor -> store

Box, brokers and monitor are real processes, which are killed (SIGKILL) at random times and started again. The
forwarders cut connections. The relay loses, duplicates, delays and damages messages in both directions. In the end the
store must hold what it holds when the same drives are sent undisturbed.

Run as `python benchmarks/chaos`.
"""

import argparse
import json
import os
import signal
import sys
import tempfile
from dataclasses import asdict
from pathlib import Path

from processes import MOSQUITTO
from runs import Plan, run

from results import Result


def table(result: Result) -> str:
    """Return the result as lines."""
    fields = asdict(result) | {"is_kept": result.is_kept}
    return "\n".join(f"{name.replace('_', ' '):26} {value}" for name, value in fields.items())


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=12)
    parser.add_argument("--every", type=float, default=2.0, help="mean time between kills [s]")
    parser.add_argument("--minutes", type=float, default=12.0, help="of driving: a multiple of the window")
    parser.add_argument("--drives", type=int, default=4)
    parser.add_argument("--window", type=float, default=2.0, help="[min]")
    parser.add_argument("--patience", type=float, default=300.0, help="for the end after the last kill [s]")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path, help="folder for logs, spool and store; default: one that is removed")
    parser.add_argument("--json", action="store_true", help="one JSON object instead of a table")
    given = parser.parse_args()
    if MOSQUITTO is None:
        parser.error("there is no mosquitto: install Debian's package (scripts/system-packages)")
    if (60 * given.minutes / given.drives) % 1 or (given.minutes / given.window) % 1:
        parser.error("--minutes must be a multiple of --window, and --drives of whole seconds: the last window ends it")
    plan = Plan(given.minutes, given.drives, given.window, given.kills, given.every, given.patience, given.seed)
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("stopped"))
    with tempfile.TemporaryDirectory() as temporary:
        folder = given.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        result = run(plan, folder, lambda text: print(text, file=sys.stderr, flush=True))
    print(json.dumps(asdict(result) | {"is_kept": result.is_kept}) if given.json else table(result))
    return 0 if result.is_kept else 1


if __name__ == "__main__":
    sys.exit(main())
