"""Change one expression of the source at a time, and count which of the changes the tests of its room find.

    python benchmarks/mutants.py run --mutants 160 --seed 1 --out mutants.json
    python benchmarks/mutants.py run --again mutants.json --out later.json
    python benchmarks/mutants.py compare mutants.json later.json

A mutant is a statement in a function of a room, and the operator, comparison, number or condition in it that is
changed. It is known by the text of its statement, so that it is found again where the function has moved; one whose
statement is gone is listed as `gone`. A mutant is `killed` when a test fails or does not end. It meets the files of
tests of its room that call its function (all of them where none does in the process of the tests), the fast tests
first, then the slow ones. The tests must pass without a change first.
"""

import argparse
import ast
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import threading
from collections import Counter, defaultdict
from collections.abc import Callable, Generator, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from types import FrameType

import pytest

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
#: Folders of the source and of the tests by room, at present and in the layout before it.
ROOMS = {
    "likelihood": (("likelihood",), ("likelihood",)),
    "diagnosis": (("diagnosis",), ("diagnosis",)),
    "link": (("link",), ("link",)),
    "store": (("online/store", "storage"), ("online/store", "storage")),
}
#: Longest time for the tests of a room [s]: a mutant that does not end is found.
PATIENCE = 900

COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}
OPERATORS: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.Pow: ast.Mult,
    ast.MatMult: ast.Mult,
    ast.FloorDiv: ast.Mult,
}


@dataclass(frozen=True)
class Mutant:
    """One change: the statement `text` in `function` of `room`, where the `place`-th node that can be changed is."""

    room: str
    function: str
    text: str
    place: int
    change: str
    outcome: str = ""


def changes(node: ast.AST) -> Callable[[], str] | None:
    """Return what changes a node in its tree and says how; None where there is nothing to change."""
    if isinstance(node, ast.Compare) and type(node.ops[0]) in COMPARISONS:
        return lambda: _compare(node)
    if isinstance(node, ast.BinOp) and type(node.op) in OPERATORS:
        return lambda: _operate(node)
    if isinstance(node, ast.BoolOp):
        return lambda: _connect(node)
    if isinstance(node, ast.Constant) and type(node.value) in {int, float, bool}:
        return lambda: _count(node)
    return None


def _compare(node: ast.Compare) -> str:
    old = type(node.ops[0])
    node.ops[0] = COMPARISONS[old]()
    return f"{old.__name__} -> {COMPARISONS[old].__name__}"


def _operate(node: ast.BinOp) -> str:
    old = type(node.op)
    node.op = OPERATORS[old]()
    return f"{old.__name__} -> {OPERATORS[old].__name__}"


def _connect(node: ast.BoolOp) -> str:
    node.op = ast.Or() if isinstance(node.op, ast.And) else ast.And()
    return "and <-> or"


def _count(node: ast.Constant) -> str:
    old = node.value
    node.value = (not old) if isinstance(old, bool) else old + 1 if isinstance(old, int) else 1.5 * old + 0.25
    return f"{old} -> {node.value}"


def statements(tree: ast.AST) -> Iterator[tuple[str, ast.stmt]]:
    """Yield the simple statements and conditions inside functions, with the name of the innermost function."""
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef):
            for node in ast.walk(function):
                if isinstance(node, ast.Assign | ast.AugAssign | ast.Return | ast.If | ast.While | ast.AnnAssign):
                    yield function.name, node


def parts(statement: ast.stmt) -> list[ast.AST]:
    """Return the nodes of a statement that can be changed; of an `if` or `while` those of its condition."""
    whole: ast.AST = statement.test if isinstance(statement, ast.If | ast.While) else statement
    return [node for node in ast.walk(whole) if changes(node) is not None]


def text_of(statement: ast.stmt) -> str:
    """Return the text by which a statement is found again."""
    return ast.unparse(statement.test if isinstance(statement, ast.If | ast.While) else statement)


def files_of(room: str, source: Path) -> list[Path]:
    """Return the modules of a room."""
    return sorted(path for folder in ROOMS[room][0] for path in (source / "sprung" / folder).rglob("*.py"))


def candidates(room: str, source: Path) -> list[Mutant]:
    """Return all mutants of a room, each once."""
    found: dict[Mutant, None] = {}
    for path in files_of(room, source):
        for function, statement in statements(ast.parse(path.read_text(encoding="utf-8"))):
            for place in range(len(parts(statement))):
                found[Mutant(room, function, text_of(statement), place, "")] = None
    return list(found)


def drawn(n_mutants: int, seed: int, source: Path) -> list[Mutant]:
    """Return mutants drawn by seed, from each room as many as its share of all."""
    chance = random.Random(seed)
    every = {room: candidates(room, source) for room in ROOMS}
    total = sum(map(len, every.values()))
    return [
        mutant
        for own in every.values()
        for mutant in chance.sample(own, min(len(own), -(-n_mutants * len(own) // total)))
    ]


def applied(mutant: Mutant, source: Path) -> str | None:
    """Write a mutant into a copy of the source and return what it changes; None if its statement is gone."""
    for path in files_of(mutant.room, source):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        matches = [each for name, each in statements(tree) if name == mutant.function and text_of(each) == mutant.text]
        if matches:
            change = changes(parts(matches[0])[mutant.place])
            said = change() if change is not None else ""
            path.write_text(ast.unparse(tree), encoding="utf-8")
            return said
    return None


def tests_of(room: str) -> list[str]:
    """Return the files of tests of a room."""
    folders = [ROOT / "tests" / folder for folder in ROOMS[room][1]]
    return [str(path) for folder in folders for path in sorted(folder.rglob("test_*.py"))]


def outcome_of(tests: list[str], source: Path, *plugins: str) -> str:
    """Return by which tests the source is found to be wrong, or that it is not."""
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(source), str(HERE)]),
        "OPENBLAS_NUM_THREADS": "1",
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    for kind in ("not slow", "slow"):
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *plugins, "-m", kind, *tests]
        try:
            done = subprocess.run(
                command, cwd=ROOT, env=environment, capture_output=True, timeout=PATIENCE, check=False
            )
        except subprocess.TimeoutExpired:
            return f"killed ({kind}, no end)"
        if done.returncode not in {0, 5}:
            return f"killed ({kind})"
    return "survived"


class Calls:
    """Plug-in of pytest that notes which functions of Sprung the tests of each file call in their own process."""

    def __init__(self) -> None:
        self.files: dict[str, set[str]] = defaultdict(set)
        self._functions: set[str] = set()

    def _note(self, frame: FrameType, event: str, _: object) -> None:
        if event == "call" and "/sprung/" in frame.f_code.co_filename:
            self._functions.add(frame.f_code.co_name)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, object, object]:
        """Watch the calls of one test, with its fixtures."""
        self._functions = self.files[str(item.path)]
        threading.setprofile(self._note)
        sys.setprofile(self._note)
        try:
            return (yield)
        finally:
            sys.setprofile(None)
            threading.setprofile(None)

    def pytest_sessionfinish(self) -> None:
        """Add what was called to the file named in the environment."""
        path = Path(os.environ["SPRUNG_CALLS"])
        for name, functions in json.loads(path.read_text(encoding="utf-8")).items() if path.exists() else ():
            self.files[name].update(functions)
        path.write_text(json.dumps({name: sorted(each) for name, each in self.files.items()}), encoding="utf-8")


def pytest_configure(config: pytest.Config) -> None:
    """Register the plug-in where this module is given to pytest as one."""
    config.pluginmanager.register(Calls())


def callers(room: str) -> dict[str, set[str]]:
    """Return the functions that each file of tests of a room calls; the tests must pass."""
    with tempfile.TemporaryDirectory() as folder:
        os.environ["SPRUNG_CALLS"] = str(Path(folder) / "calls.json")
        if (outcome := outcome_of(tests_of(room), ROOT / "src", "-p", Path(__file__).stem)) != "survived":
            raise SystemExit(f"the tests of {room} fail without a change: {outcome}")
        read: dict[str, list[str]] = json.loads(Path(os.environ["SPRUNG_CALLS"]).read_text(encoding="utf-8"))
    return {name: set(functions) for name, functions in read.items()}


def run(arguments: argparse.Namespace) -> int:
    """Try all mutants and write the list with the outcome of each after every one."""
    out, source = Path(arguments.out), ROOT / "src"
    if arguments.again:
        waiting = [Mutant(**each) for each in json.loads(Path(arguments.again).read_text(encoding="utf-8"))]
    else:
        waiting = drawn(arguments.mutants, arguments.seed, source)
    called = {room: callers(room) for room in ROOMS}
    done = [Mutant(**each) for each in json.loads(out.read_text(encoding="utf-8"))] if out.exists() else []
    for mutant in waiting[len(done) :]:
        with tempfile.TemporaryDirectory() as folder:
            copy = Path(folder) / "src"
            shutil.copytree(source, copy, ignore=shutil.ignore_patterns("__pycache__"))
            change = applied(mutant, copy)
            tests = [name for name, functions in called[mutant.room].items() if mutant.function in functions]
            outcome = "gone" if change is None else outcome_of(tests or tests_of(mutant.room), copy)
        done.append(replace(mutant, change=change or mutant.change, outcome=outcome))
        out.write_text(json.dumps([asdict(each) for each in done], indent=1), encoding="utf-8")
        print(
            f"{len(done)}/{len(waiting)} {outcome:22}{mutant.room:12}{mutant.function}: {mutant.text[:60]!r} {change}"
        )
    _print_counts(done)
    return 0


def _print_counts(mutants: list[Mutant]) -> None:
    counts = Counter((each.room, each.outcome.partition(" ")[0]) for each in mutants)
    print(f"{'room':12}{'killed':>8}{'survived':>10}{'gone':>6}")
    for room in ROOMS:
        print(f"{room:12}{counts[room, 'killed']:8}{counts[room, 'survived']:10}{counts[room, 'gone']:6}")


def compare(arguments: argparse.Namespace) -> int:
    """Print the mutants that were killed before and survive; return 1 if there are any."""
    before, after = (json.loads(Path(path).read_text(encoding="utf-8")) for path in (arguments.before, arguments.after))
    escaped = [
        (old, new)
        for old, new in zip(before, after, strict=True)
        if old["outcome"].startswith("killed") and new["outcome"] == "survived"
    ]
    for mutants in (before, after):
        _print_counts([Mutant(**each) for each in mutants])
    for old, _ in escaped:
        print(f"killed before, survives now: {old['room']} {old['function']}: {old['text']} ({old['change']})")
    return int(bool(escaped))


def main() -> int:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    one = commands.add_parser("run")
    one.add_argument("--mutants", type=int, default=160)
    one.add_argument("--seed", type=int, default=1)
    one.add_argument("--again", help="list of an earlier run, whose mutants are tried")
    one.add_argument("--out", required=True)
    one.set_defaults(call=run)
    two = commands.add_parser("compare")
    two.add_argument("before")
    two.add_argument("after")
    two.set_defaults(call=compare)
    arguments = parser.parse_args()
    result: int = arguments.call(arguments)
    return result


if __name__ == "__main__":
    sys.exit(main())
