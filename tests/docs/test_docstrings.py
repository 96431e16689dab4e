"""Docstrings of public functions and classes are complete, in numpydoc's order."""

import ast
import importlib
import inspect
import pkgutil
import re
import textwrap
from collections.abc import Iterator
from dataclasses import fields, is_dataclass

import pytest
from numpydoc.validate import validate

from sprung.errors import SprungError

#: Checks of numpydoc that are off, and why.
OFF = {
    "ES01": "a summary line is enough where it says all",
    "EX01": "examples stand on the functions that people begin with",
    "SA01": "related names are linked where the text needs them",
    "PR04": "types are in the signatures, which mypy checks",
    "PR08": "descriptions may begin with ln, a symbol",
    "RT03": "the name of a type may say what is returned",
    "RT04": "as PR08",
}
#: A summary that names the result, or another function with the same parameters, needs no section for them.
_NAMES_RESULT = re.compile(r"^(Return|Yield|Iterate|Whether|Read|Draw|Open)\b|\breturn\b|\b(as|as for) `|\bas `")
_SEE = re.compile(r"\bsee `|\bas `|\bas for `")


def packages() -> list[str]:
    """Return the packages and modules with public names."""
    found = [
        f"{place}.{module.name}"
        for place in ("sprung", "sprung.results", "sprung.online", "sprung.fleet")
        for module in pkgutil.iter_modules(importlib.import_module(place).__path__)
        if not module.name.startswith("_")
    ]
    return ["sprung", *(name for name in found if hasattr(importlib.import_module(name), "__all__"))]


def public_objects(package: str) -> Iterator[tuple[str, object]]:
    """Yield the public functions, classes and methods of a package with their places."""
    module = importlib.import_module(package)
    for value in (getattr(module, name) for name in module.__all__):
        if not (inspect.isclass(value) or inspect.isfunction(value)) or not value.__module__.startswith("sprung"):
            continue
        place = f"{value.__module__}.{value.__qualname__}"
        yield place, value
        for name, member in list(vars(value).items()) if inspect.isclass(value) else ():
            method = getattr(member, "__func__", member)
            if name[0] != "_" and inspect.isfunction(method):
                yield f"{place}.{name}", method


def is_meant(code: str, value: object, message: str) -> bool:
    """Return whether the style allows what a check objects to."""
    text = inspect.getdoc(value) or ""
    summary = text.split("\n\n")[0]
    if code in {"RT01", "YD01"}:
        return bool(_NAMES_RESULT.search(summary))
    if code == "PR01":  # a summary is enough for few parameters, a list of only some of them is not
        names = re.findall(r"'(\w+)'", message)
        return "Parameters\n---" not in text or bool(_SEE.search(summary)) or all(name[0] == "_" for name in names)
    if code == "PR02":  # fields that are computed
        names = re.findall(r"'(\w+)'", message)
        return is_dataclass(value) and {field.name for field in fields(value)} >= set(names)
    return code == "PR03" and inspect.isclass(value)  # fields of a value are grouped by meaning


@pytest.mark.slow
@pytest.mark.parametrize("package", packages())
def test_docstrings_are_complete(package) -> None:
    seen: dict[str, object] = dict(public_objects(package))
    wrong = [
        (place, code, message)
        for place, value in seen.items()
        for code, message in validate(place)["errors"]
        if code not in OFF and not is_meant(code, value, message)
    ]
    assert not wrong


def raised(function: object) -> set[str]:
    """Return the errors of sprung that the body of a function raises itself, and does not catch."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))  # type: ignore[arg-type]
    attempts = [node for node in ast.walk(tree) if isinstance(node, ast.Try)]
    caught = {id(node) for attempt in attempts for part in attempt.body for node in ast.walk(part)}
    errors = [node.exc for node in ast.walk(tree) if isinstance(node, ast.Raise) and id(node) not in caught]
    names = {error.func.id for error in errors if isinstance(error, ast.Call) and isinstance(error.func, ast.Name)}
    return names & {kind.__name__ for kind in kinds(SprungError)}


def kinds(error: type[Exception]) -> list[type[Exception]]:
    """Return an error and all that derive from it."""
    return [error, *(kind for below in error.__subclasses__() for kind in kinds(below))]


@pytest.mark.parametrize("package", packages())
def test_docstrings_state_what_is_raised(package) -> None:
    functions = {place: value for place, value in public_objects(package) if inspect.isfunction(value)}
    silent = {
        place: missing
        for place, value in functions.items()
        if (missing := {name for name in raised(value) if name not in (inspect.getdoc(value) or "")})
    }
    assert not silent
