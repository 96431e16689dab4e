"""Every benchmark loads with the packages of the set-up and the names of the present code."""

import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "benchmarks"
MODULES = sorted(path.relative_to(FOLDER) for path in FOLDER.rglob("*.py") if ".venv" not in path.parts)
#: Packages of others that benchmarks compare with, which the set-up lacks.
FOREIGN = {"koma", "mujoco", "phonometry", "pyoma2"}


@pytest.fixture
def alone(monkeypatch) -> Iterator[None]:
    """Load modules of benchmarks anew, as folders have modules of equal names, and forget them."""

    def own() -> list[str]:
        files = {name: getattr(module, "__file__", None) for name, module in list(sys.modules.items())}
        return [name for name, file in files.items() if file and Path(file).is_relative_to(FOLDER)]

    for name in own():
        monkeypatch.delitem(sys.modules, name)
    yield
    for name in own():
        del sys.modules[name]


@pytest.mark.skipif(not MODULES, reason="the benchmarks are not in this tree")
@pytest.mark.parametrize("module", MODULES, ids=str)
def test_a_benchmark_loads(module: Path, alone, monkeypatch) -> None:
    """As a script of its folder or, where it says so, as a module of the package."""
    monkeypatch.setattr(sys, "path", [str(FOLDER / module.parent), str(FOLDER), str(ROOT), *sys.path])
    try:
        import_module(".".join(("benchmarks", *module.with_suffix("").parts)))
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] not in FOREIGN:
            raise
        pytest.skip(f"needs {error.name}")
