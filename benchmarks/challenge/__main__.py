"""The challenge: `python -m benchmarks.challenge make|enter|check|score|table`, see `README.md` beside this file."""

import argparse
import json
import os
import sys
import time
import zipfile
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("TQDM_DISABLE", "1")

from benchmarks.challenge.entrants import ENTRANTS
from benchmarks.challenge.entry import Entry, EntryError, read_entry
from benchmarks.challenge.make import Source, make_set, read_truth, truth_archive
from benchmarks.challenge.score import score_entry
from benchmarks.challenge.tables import tables

TASKS = ("modes", "corners", "lives", "order")
#: Published SHA-256 of the archives of the truth.
HASHES = Path(__file__).parent / "hashes.json"


def _make(given: argparse.Namespace) -> None:
    source = Source(given.salt_file.read_text(encoding="utf-8").strip() if given.salt_file else "", given.seed)
    digest = truth_archive(given.truth or given.out.with_name(f"{given.out.name}-truth.zip"), source)
    print(f"SHA-256 of the truth: {digest}")
    begin, made = time.monotonic(), []

    def report(case: str) -> None:
        made.append(case)
        print(f"{time.monotonic() - begin:6.0f} s  {case}", flush=True)

    make_set(given.out, source, only=given.only, report=report)
    if not made:
        raise EntryError(f"{given.only} is the name of no case, such as chain-snr10, corners-01, road-01 or rail-01.")


def _enter(given: argparse.Namespace) -> None:
    manifest, tasks = _manifest(given.data), given.tasks.split(",")
    for task in tasks:
        if task not in TASKS:
            raise EntryError(f"--tasks: {task!r} is none of {', '.join(TASKS)}.")
    document: dict[str, Any] = {"schema": "sprung.challenge-entry/1", "entrant": given.entrant}
    if given.out.exists():
        document = json.loads(given.out.read_text(encoding="utf-8"))
    asked = {
        task: {
            name: case
            for name, case in manifest[task].items()
            if fnmatch(name, given.only) and name not in document.get(task, {})
        }
        for task in tasks
    }
    for task, said in ENTRANTS[given.entrant](given.data, asked).items():
        document[task] = document.get(task, {}) | said
    given.out.parent.mkdir(parents=True, exist_ok=True)
    given.out.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    read_entry(given.out, manifest)


def _manifest(folder: Path) -> dict[str, Any]:
    path = folder / "manifest.json"
    if not path.exists():
        raise EntryError(f"{folder} has no manifest.json: name a folder that `make --out FOLDER` wrote.")
    document: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return document


def _truth(path: Path) -> dict[str, Any]:
    try:
        return read_truth(path)
    except (OSError, KeyError, ValueError, zipfile.BadZipFile) as error:
        raise EntryError(f"{path} is no archive of a truth: {error}.") from error


def _counted(entry: Entry, cases: dict[str, Any]) -> str:
    stated = [(len(getattr(entry, task)), len(cases[task]), task) for task in TASKS]
    return f"{entry.entrant}: " + ", ".join(f"{some} of {all_} {task}" for some, all_, task in stated if some)


def _scored(path: Path) -> dict[str, Any]:
    try:
        document: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        if document["schema"] == "sprung.challenge-score/1":
            return document
    except (OSError, KeyError, TypeError, ValueError):
        pass
    raise EntryError(f"{path} is no file that `score --json` wrote.")


def _check(given: argparse.Namespace) -> None:
    entry = read_entry(given.entry, _manifest(given.data))
    print(f"{entry.entrant}: " + ", ".join(f"{len(getattr(entry, task))} of {task}" for task in TASKS))


def _score(given: argparse.Namespace) -> None:
    truth = _truth(given.truth)
    entry = read_entry(given.entry, truth)
    if not given.data and any(0 < len(getattr(entry, task)) < len(truth[task]) for task in TASKS):
        said = _counted(entry, truth)
        print(f"{said}; what is left out is scored as silence (--data FOLDER: only its cases).", file=sys.stderr)
    if given.data:
        manifest = _manifest(given.data)
        truth |= {task: {name: truth[task][name] for name in manifest[task]} for task in TASKS}
    document = score_entry(entry, truth)
    if given.json:
        given.json.parent.mkdir(parents=True, exist_ok=True)
        given.json.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    print(tables([_silent(truth), document]), end="")


def _table(given: argparse.Namespace) -> None:
    scored = [_scored(path) for path in given.scores]
    print(tables([*([_silent(_truth(given.truth))] if given.truth else []), *scored]), end="")


def _silent(truth: dict[str, Any]) -> dict[str, Any]:
    """Return the scores of an entry that says nothing of any case."""
    nothing: dict[str, Any] = {"modes": [], "corners": {}, "lives": {}, "order": []}
    said = {task: dict.fromkeys(truth[task], empty) for task, empty in nothing.items()}
    entry = Entry.model_validate({"schema": "sprung.challenge-entry/1", "entrant": "(silence)"} | said)
    return score_entry(entry, truth)


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.challenge", description=__doc__)
    commands = parser.add_subparsers(required=True)
    make = commands.add_parser("make", help="write the recordings of a set, and its truth to an archive of its own")
    make.add_argument("--out", type=Path, required=True, help="folder of the recordings")
    make.add_argument("--truth", type=Path, help="archive of the truth; default: beside the folder")
    make.add_argument("--seed", type=int, default=1)
    make.add_argument("--salt-file", type=Path, help="secret of an organiser; default: none, the open practice set")
    make.add_argument("--only", default="*", metavar="PATTERN", help="cases to write, such as 'road-*'")
    make.set_defaults(run=_make)
    enter = commands.add_parser("enter", help="make an entry of one of the entrants of this repository")
    enter.add_argument("entrant", choices=sorted(ENTRANTS))
    enter.add_argument("--data", type=Path, required=True, help="folder of the recordings")
    enter.add_argument("--out", type=Path, required=True, help="entry to write, or to complete if it is there already")
    enter.add_argument("--tasks", default=",".join(TASKS), help="separated by commas")
    enter.add_argument("--only", default="*", metavar="PATTERN", help="cases to enter, such as 'road-*'")
    enter.set_defaults(run=_enter)
    check = commands.add_parser("check", help="say whether an entry can be scored; needs no truth")
    check.add_argument("entry", type=Path)
    check.add_argument("--data", type=Path, required=True, help="folder of the recordings")
    check.set_defaults(run=_check)
    score = commands.add_parser("score", help="score an entry")
    score.add_argument("entry", type=Path)
    score.add_argument("--truth", type=Path, required=True, help="archive of the truth")
    score.add_argument("--data", type=Path, help="folder of the recordings, to score the cases in it alone")
    score.add_argument("--json", type=Path, help="file for the scores of every case")
    score.set_defaults(run=_score)
    table = commands.add_parser("table", help="print the table of entries that have been scored with --json")
    table.add_argument("scores", type=Path, nargs="+")
    table.add_argument("--truth", type=Path, help="archive of the truth, for the row of an entry that says nothing")
    table.set_defaults(run=_table)
    return parser


def main(arguments: list[str] | None = None) -> int:
    """Run a command; return 2 with one sentence if it cannot be done."""
    given = _arguments().parse_args(arguments)
    try:
        given.run(given)
    except EntryError as error:
        print(error, file=sys.stderr)
        return 2
    except ModuleNotFoundError as error:
        what = getattr(given, "entrant", "this")
        print(f"{what} needs the package {error.name}: install benchmarks/requirements.lock.", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
