"""Public names of a package with their docstrings: the directive `public-names`.

The argument is a package whose `__all__` is shown, without names that `sprung` itself exports; or `sprung` with the
option `homes`, the modules that its stub takes names from. A public name that no page shows fails the build.
"""

import importlib
import inspect
import pkgutil
import re
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any, ClassVar

from docutils import nodes
from docutils.parsers.rst import directives
from numpy.typing import ArrayLike
from pydantic import BaseModel
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.directives import ObjectDescription
from sphinx.domains.python import PythonDomain
from sphinx.environment import BuildEnvironment
from sphinx.errors import ExtensionError
from sphinx.pycode import ModuleAnalyzer
from sphinx.util.docutils import SphinxDirective
from sphinx.util.nodes import make_refnode
from sphinx.util.typing import stringify_annotation

import sprung

#: Public names of `sprung` by the module that they come from, of its stub.
NAMES: dict[str, list[str]] = {}
for _home, _name in re.findall(
    r"^from sprung\.(\S+) import \w+ as (\w+)",
    Path(sprung.__file__).with_suffix(".pyi").read_text("utf-8"),
    re.MULTILINE,
):
    NAMES.setdefault(_home, []).append(_name)

#: Types of arrays by the type of their entries, and how a signature spells them out.
_ARRAYS = {"float64": "Real", "complex128": "Complex", "int64": "Indices", "bool": "Booleans"}
_BARE = r"~?numpy\.ndarray\[tuple\[~?typing\.Any, \.\.\.\], ~?numpy\.dtype\[~?(?:numpy\.)?(\w+)\]\]"
_ARRAY = re.compile(rf"~?(?:\w+\.)?Annotated\[{_BARE}, <[^>]*>\]|{_BARE}")
_ARRAY_LIKE = stringify_annotation(ArrayLike, "smart")


def packages() -> list[str]:
    """Return the packages and modules with public names, `sprung` aside."""
    places = ("sprung", "sprung.results", "sprung.online", "sprung.fleet")
    found = [
        f"{place}.{module.name}"
        for place in places
        for module in pkgutil.iter_modules(importlib.import_module(place).__path__)
        if not module.name.startswith("_")
    ]
    return [name for name in found if getattr(importlib.import_module(name), "__all__", ())]


def public_names(package: str, homes: list[str] | None = None) -> list[str]:
    """Return the names that the page of a package shows."""
    if package == "sprung":
        return [name for home in homes or NAMES for name in NAMES[home]]
    module = importlib.import_module(package)
    taken = {id(getattr(sprung, name)) for name in sprung.__all__}
    return [name for name in module.__all__ if id(getattr(module, name)) not in taken]


def _comment(package: str, name: str, value: object) -> str:
    """Return the comment `#:` above a value, in whatever module of the package assigns it."""
    homes = [home for home, names in NAMES.items() if name in names]
    pending = [importlib.import_module(where) for where in (package, *(f"sprung.{home}" for home in homes))]
    while pending:
        module = pending.pop(0)
        documented = ModuleAnalyzer.for_module(module.__name__).find_attr_docs().get(("", name))
        if documented and vars(module).get(name) is value:
            return " ".join(line.strip() for line in documented).strip()
        pending += _submodules(module)
    return ""


def _submodules(module: ModuleType) -> list[ModuleType]:
    """Return the modules of a package, private ones aside."""
    names = [found.name for found in pkgutil.iter_modules(getattr(module, "__path__", ())) if found.name[0] != "_"]
    return [importlib.import_module(f"{module.__name__}.{name}") for name in names]


def _entry(package: str, name: str) -> tuple[str, str]:
    """Return the first sentence about a name, and the directive that describes it."""
    where = f"{package}.{name}"
    value = _value(where)
    if inspect.isclass(value):
        options = "   :members:\n   :show-inheritance:\n" if issubclass(value, Exception) else "   :members:\n"
        return _first_line(value), f".. autoclass:: {where}\n{options}"
    if inspect.isroutine(value):
        return _first_line(value), f".. autofunction:: {where}\n"
    comment = _comment(package, name, value)
    return comment.split(". ")[0].rstrip("."), f".. py:data:: {name}\n\n   {comment}\n"


def _first_line(value: object) -> str:
    return (inspect.getdoc(value) or "").split("\n\n")[0].replace("\n", " ").rstrip(".")


class PublicNames(SphinxDirective):
    """Table of public names, and their docstrings below it."""

    required_arguments = 1
    option_spec: ClassVar = {"homes": directives.unchanged}

    def run(self) -> list[nodes.Node]:
        """Return the table and the descriptions."""
        package = self.arguments[0]
        names = public_names(package, self.options["homes"].split() if "homes" in self.options else None)
        entries = {name: _entry(package, name) for name in names if not inspect.ismodule(_value(f"{package}.{name}"))}
        rows = [f"   * - :py:obj:`{name} <{package}.{name}>`\n     - {line}" for name, (line, _) in entries.items()]
        table = ".. list-table::\n   :widths: 30 70\n   :class: names\n\n" + "\n".join(rows)
        shown = " ".join(f"{package}.{name}" for name in entries)
        gallery = f".. minigallery:: {shown}\n   :add-heading: Tutorials with these names\n   :heading-level: ^"
        text = "\n\n".join([f".. currentmodule:: {package}", table, *(text for _, text in entries.values()), gallery])
        return self.parse_text_to_nodes(text, allow_section_headings=True)


@cache
def _modules() -> set[str]:
    """Return the names of all modules, by which docstrings refer to what is in them."""
    return {name.rpartition(".")[2] for _, name, _ in pkgutil.walk_packages(sprung.__path__, "sprung.")}


def with_named_arrays(text: str) -> str:
    """Return a signature in which arrays have the short names of `sprung._arrays`."""
    text = text.replace(_ARRAY_LIKE, "ArrayLike")
    return _ARRAY.sub(lambda match: _ARRAYS.get(match[1] or match[2], f"NDArray[{match[1] or match[2]}]"), text)


def _described(directive: type[ObjectDescription[Any]]) -> type[ObjectDescription[Any]]:
    """Return a directive of the Python domain that writes arrays by their short names."""

    class WithNamedArrays(directive):  # type: ignore[misc, valid-type]
        arguments: list[str]

        def run(self) -> list[nodes.Node]:
            self.arguments = [with_named_arrays(argument) for argument in self.arguments]
            if "type" in self.options:
                self.options["type"] = with_named_arrays(self.options["type"])
            return super().run()

    return WithNamedArrays


def _without_fields(_app: Sphinx, _kind: str, _name: str, value: object, *_: object) -> tuple[str, str] | None:
    """Leave out the signatures of documents and files, whose fields have pages of their own."""
    return ("", "") if inspect.isclass(value) and issubclass(value, BaseModel) else None


def _resolve(app: Sphinx, env: BuildEnvironment, node: pending_xref, content: nodes.Node) -> nodes.Node | None:
    """Link a name to the only public object of that name, wherever it is exported."""
    target = node.get("reftarget", "")
    first, _, rest = target.partition(".")
    is_foreign = bool(rest) and first != "sprung" and first not in _modules() and not first[:1].isupper()
    if node.get("refdomain") != "py" or is_foreign:
        return None
    objects = env.get_domain("py").objects  # type: ignore[attr-defined]
    last = target if first[:1].isupper() else target.rpartition(".")[2]
    found = [name for name in objects if name.endswith(f".{last}")]
    if last[:1].islower():
        found = [name for name in found if objects[name].objtype in {"function", "data"}]
    if len(found) != 1:
        return None
    entry = objects[found[0]]
    return make_refnode(app.builder, node["refdoc"], entry.docname, entry.node_id, [content], found[0])


def _check(app: Sphinx, env: BuildEnvironment) -> None:
    """Fail if a public name is on no page."""
    if app.tags.has("quick"):
        return
    objects = env.get_domain("py").objects  # type: ignore[attr-defined]
    wanted = {f"{package}.{name}" for package in ("sprung", *packages()) for name in public_names(package)}
    missing = sorted(name for name in wanted - set(objects) if not inspect.ismodule(_value(name)))
    if missing:
        raise ExtensionError(f"no page of docs/reference/python shows {', '.join(missing)}")


def _value(name: str) -> object:
    package, _, last = name.rpartition(".")
    return getattr(importlib.import_module(package), last)


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    app.add_directive("public-names", PublicNames)
    for kind in ("function", "class", "method", "property", "attribute"):
        directive = PythonDomain.directives[kind]
        app.add_directive_to_domain("py", kind, _described(directive), override=True)
    app.connect("autodoc-process-signature", _without_fields)
    app.connect("missing-reference", _resolve)
    app.connect("env-check-consistency", _check)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
