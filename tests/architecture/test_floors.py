"""Imports go down the stairs only: a module imports from lower floors, never from its own or a higher one."""

import ast
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[2] / "src" / "sprung"

#: From the ground up; the same picture as in docs/architecture.md. Packages that are wings have floors of their own.
FLOORS = (
    ("errors", "_arrays", "_display", "_lazy", "_threads"),
    ("_checks",),
    ("recording", "modal", "units", "toml"),
    ("channel_names",),
    ("formats", "signals"),
    ("vehicles",),
    ("excitation", "likelihood", "ride"),
    ("identification",),
    ("simulation", "diagnosis", "calibration", "bounce_tests", "road"),
    ("kits", "baseline_progress"),
    ("results.renderings",),
    ("results.documents", "results.tables"),
    ("results.figures", "state"),
    ("results.page", "plotting"),
    ("reproduce",),
    ("cli",),
    ("link",),
    ("online.store", "online.alerts", "fleet.lake"),
    ("online.monitor", "online.box"),
    ("online.site", "fleet.jobs"),
    ("online.demo", "fleet.streams"),
    ("online.commands", "fleet.commands", "__main__"),
)
FLOOR_OF = {name: floor for floor, names in enumerate(FLOORS) for name in names}
WINGS = {name.partition(".")[0] for name in FLOOR_OF if "." in name}
#: Libraries that only one place may use.
ONLY_IN = {
    "matplotlib": {"results.figures"},
    **{key: {"cli", "online.commands", "fleet.commands"} for key in ("typer", "rich", "click")},
    **{key: {"online.store"} for key in ("sqlalchemy", "psycopg", "sqlite3")},
    "paho": {"link"},
    "deltalake": {"fleet.lake"},
    "pyspark": {"fleet.jobs", "fleet.streams", "fleet.commands"},
    **{key: {"online.site"} for key in ("fastapi", "starlette", "uvicorn", "prometheus_client", "pwdlib")},
    "can": {"online.box"},
    "pyopencrg": {"excitation"},
    **{key: {"simulation"} for key in ("fmpy", "pythonfmu3")},
    **{key: {"formats"} for key in ("cantools", "asammdf", "nptdms", "idelib", "dwdatareader", "pymseed")},
}


@cache
def modules() -> dict[str, Path]:
    """Return the file of every module by its dotted name in the package, without the packages that only hold others."""
    paths = {
        ".".join(path.relative_to(SOURCE).with_suffix("").parts).removesuffix(".__init__"): path
        for path in sorted(SOURCE.rglob("*.py"))
    }
    return {name: path for name, path in paths.items() if name not in {"__init__", *WINGS}}


def place_of(name: str) -> str:
    """Return the name of the floor on which a module stands."""
    first, *rest = name.split(".")
    return ".".join((first, *rest[:1])) if first in WINGS else first


def imported(path: Path, *, with_types: bool = False) -> list[str]:
    """Return the dotted names that a module imports, everywhere in it; those for type checking on request."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for_types = {
        id(node)
        for branch in ast.walk(tree)
        if isinstance(branch, ast.If) and "TYPE_CHECKING" in ast.unparse(branch.test) and not with_types
        for node in ast.walk(branch)
    }
    names = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import) and id(node) not in for_types:
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and id(node) not in for_types:
            assert node.level == 0, f"{path}: relative import"
            own = [f"{node.module}.{alias.name}" for alias in node.names]
            names += [name if _own(name) in modules() else node.module or "" for name in own]
    return names


def _own(name: str) -> str:
    return name.removeprefix("sprung.")


def test_every_module_has_a_floor() -> None:
    unknown = {place_of(name) for name in modules()} - FLOOR_OF.keys()
    assert not unknown, f"put {unknown} on a floor here and in docs/architecture.md"


def test_every_floor_has_its_modules() -> None:
    assert FLOOR_OF.keys() <= {place_of(name) for name in modules()}


@pytest.mark.parametrize("name", modules())
def test_imports_go_down(name) -> None:
    place = place_of(name)
    for target in imported(modules()[name]):
        top = place_of(_own(target))
        if target.startswith("sprung.") and top in FLOOR_OF and top != place:
            assert FLOOR_OF[top] < FLOOR_OF[place], f"{name} imports {target}, which is not below {place}"
        library = target.partition(".")[0]
        assert place in ONLY_IN.get(library, {place}), f"{name} imports {library}, which belongs elsewhere"


def test_fleets_need_nothing_of_online() -> None:
    of_fleet = {name: path for name, path in modules().items() if name.startswith("fleet.")}
    for name, path in of_fleet.items():
        above = [target for target in imported(path, with_types=True) if target.startswith("sprung.online")]
        assert not above, f"{name} imports {above}: what both wings need stands below them"


@pytest.mark.slow
def test_no_circle_inside_packages() -> None:
    """Not for the types of a signature either; a package may offer what its modules define."""
    inside = {
        name: {
            _own(target)
            for target in imported(path, with_types=True)
            if _own(target) in modules() and _own(target) != name and not name.startswith(f"{_own(target)}.")
        }
        for name, path in modules().items()
    }
    try:
        TopologicalSorter(inside).prepare()
    except CycleError as error:
        pytest.fail(f"import in a circle: {' <- '.join(error.args[1])}")


def test_picture_in_the_documentation_is_this_one() -> None:
    text = (SOURCE.parents[1] / "docs" / "architecture.md").read_text(encoding="utf-8")
    drawn = [line.split("|")[0].split() for line in text.split("```floors\n")[1].split("```")[0].splitlines()]
    assert [set(names) for names in drawn] == [set(names) for names in reversed(FLOORS)]


def test_no_module_has_an_empty_name() -> None:
    banned = {"utils", "helpers", "core", "base", "misc", "manager"}
    assert not banned & {path.stem for path in modules().values()}
