"""Imports go down the stairs only: a module imports from lower floors, never from its own or a higher one."""

import ast
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[2] / "src" / "sprung"

#: From the ground up; the same picture as in docs/architecture.md.
FLOORS = (
    ("errors", "_arrays", "_display"),
    ("_checks",),
    ("recording", "modal", "units", "toml"),
    ("channel_names",),
    ("formats", "signals"),
    ("vehicles",),
    ("excitation", "likelihood"),
    ("identification",),
    ("simulation", "diagnosis", "calibration"),
    ("documents", "tables"),
    ("plotting", "storage", "link", "alerting", "lake"),
    ("reports",),
    ("reproduce", "monitor", "box"),
    ("service", "fleet"),
    ("demo",),
    ("cli",),
)
FLOOR_OF = {name: floor for floor, names in enumerate(FLOORS) for name in names}
#: Libraries that only one floor may use.
ONLY_IN = {
    "matplotlib": {"plotting"},
    "typer": {"cli"},
    "rich": {"cli"},
    "click": {"cli"},
    **{key: {"storage"} for key in ("sqlalchemy", "alembic", "psycopg", "sqlite3")},
    "paho": {"link"},
    "deltalake": {"lake"},
    "pyspark": {"fleet"},
    **{key: {"service"} for key in ("fastapi", "starlette", "uvicorn", "prometheus_client", "pwdlib")},
    "can": {"box"},
    **{key: {"formats"} for key in ("cantools", "asammdf", "nptdms", "idelib", "dwdatareader", "pymseed")},
}


def modules():
    """Yield the name of the floor and the file of every module, but the package itself, which shows all floors."""
    for path in sorted(set(SOURCE.rglob("*.py")) - {SOURCE / "__init__.py"}):
        yield path.relative_to(SOURCE).parts[0].removesuffix(".py"), path


def imported(path):
    """Return the dotted names that a module imports, everywhere in it but for type checking."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for_types = {
        id(node)
        for branch in ast.walk(tree)
        if isinstance(branch, ast.If) and "TYPE_CHECKING" in ast.unparse(branch.test)
        for node in ast.walk(branch)
    }
    names = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import) and id(node) not in for_types:
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and id(node) not in for_types:
            assert node.level == 0, f"{path}: relative import"
            base = node.module or ""
            names += [f"{base}.{alias.name}" if base == "sprung" else base for alias in node.names]
    return names


def test_every_module_has_a_floor() -> None:
    unknown = {name for name, _ in modules()} - FLOOR_OF.keys()
    assert not unknown, f"put {unknown} on a floor here and in docs/architecture.md"


def test_every_floor_has_its_modules() -> None:
    assert FLOOR_OF.keys() <= {name for name, _ in modules()}


@pytest.mark.parametrize(("name", "path"), list(modules()), ids=lambda value: str(value).removeprefix(str(SOURCE)))
def test_imports_go_down(name, path) -> None:
    for target in imported(path):
        parts = target.split(".")
        if parts[0] == "sprung" and len(parts) > 1 and parts[1] in FLOOR_OF and parts[1] != name:
            assert FLOOR_OF[parts[1]] < FLOOR_OF[name], f"{path.name} imports {target}, which is not below {name}"
        assert name in ONLY_IN.get(parts[0], {name}), f"{path.name} imports {parts[0]}, which belongs elsewhere"


def test_picture_in_the_documentation_is_this_one() -> None:
    text = (SOURCE.parents[1] / "docs" / "architecture.md").read_text(encoding="utf-8")
    drawn = [line.split("|")[0].split() for line in text.split("```floors\n")[1].split("```")[0].splitlines()]
    assert [set(names) for names in drawn] == [set(names) for names in reversed(FLOORS)]


def test_no_module_has_an_empty_name() -> None:
    banned = {"utils", "helpers", "core", "base", "misc", "manager"}
    assert not banned & {path.stem for _, path in modules()}
