"""Public names of a package, imported when one is first used, so that what needs few of them starts at once."""

import re
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path


def lazily(package: str, file: str) -> tuple[Callable[[str], object], Callable[[], list[str]], list[str]]:
    """Return `__getattr__`, `__dir__` and `__all__` of a package whose stub lists its names and their modules.

    Parameters
    ----------
    package
        Name of the package.
    file
        Its `__init__.py`; the stub beside it has one line `from module import name as name` for each public name.
    """
    stub = Path(file).with_suffix(".pyi").read_text(encoding="utf-8")
    homes = {name: home for home, name in re.findall(r"^from (\S+) import \w+ as (\w+)", stub, re.MULTILINE)}

    def public(name: str) -> object:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        is_module = homes[name] == package
        value: object = import_module(f"{package}.{name}") if is_module else getattr(import_module(homes[name]), name)
        setattr(sys.modules[package], name, value)
        return value

    modules = {path.stem for path in Path(file).parent.glob("*.py")}
    for name in homes.keys() & modules:
        if homes[name] != package:  # the module of this name, once imported, would hide it
            import_module(f"{package}.{name}")
            public(name)
    return public, lambda: sorted({*vars(sys.modules[package]), *homes}), list(homes)
