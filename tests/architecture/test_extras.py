"""Each extra has the packages that its part of sprung imports; the lock of the tests would hide a missing one."""

import subprocess
import sys
from importlib.metadata import distribution, packages_distributions
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[2]
#: Parts of the package by the extra that they need; none need the extras of single formats.
PARTS = {
    "": ["calibration", "diagnosis", "formats", "identification", "likelihood", "results", "vehicles", "cli"],
    "simulate": ["simulation", "reproduce"],
    "online": ["link", "online"],
    "fleet": ["fleet"],
}
#: Modules that have an extra of their own.
OTHERS = {"sprung.online.store.postgresql"}
IMPORT = """
import importlib, pkgutil, sys

class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {absent!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name.partition(".")[0])

sys.meta_path.insert(0, Absent())
for part in {parts!r}:
    package = importlib.import_module(f"sprung.{{part}}")
    for module in pkgutil.walk_packages(package.__path__, f"sprung.{{part}}."):
        if module.name not in {others!r}:
            importlib.import_module(module.name)
"""


def required(extra: str) -> set[str]:
    """Return the distributions that sprung with an extra asks for, directly or not."""
    found: set[tuple[str, frozenset[str]]] = set()
    waiting = [("sprung", frozenset({extra}))]
    while waiting:
        name, extras = waiting.pop()
        found.add((name, extras))
        for requirement in map(Requirement, distribution(name).requires or ()):
            marker = requirement.marker
            if marker is None or any(marker.evaluate({"extra": each}) for each in extras | {""}):
                asked = (canonicalize_name(requirement.name), frozenset(requirement.extras))
                waiting += [asked] if asked not in found else []
    return {name for name, _ in found}


@pytest.mark.slow
@pytest.mark.parametrize("extra", PARTS)
def test_an_extra_has_what_its_part_imports(extra: str) -> None:
    present = required(extra)
    absent = {
        module
        for module, owners in packages_distributions().items()
        if not present & {canonicalize_name(owner) for owner in owners}
    }
    assert "pytest" in absent, "the packages of the tests are hidden"
    code = IMPORT.format(absent=absent - {"_virtualenv", "_distutils_hack"}, parts=PARTS[extra], others=OTHERS)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]


def pinned(lock: str) -> dict[str, set[str]]:
    """Return the hashes of each pinned version of a lock file."""
    hashes: dict[str, set[str]] = {}
    for line in (ROOT / lock).read_text(encoding="utf-8").splitlines():
        if "==" in line:
            version = line.removesuffix("\\").strip()
            hashes[version] = set()
        elif "--hash=" in line:
            hashes[version].add(line.removesuffix("\\").strip())
    return hashes


def test_the_lock_of_the_demonstration_is_part_of_the_whole_lock() -> None:
    part, whole = pinned("requirements-demo.lock"), pinned("requirements.lock")
    assert part
    assert all(hashes & whole.get(version, set()) for version, hashes in part.items())
    names = {canonicalize_name(version.partition("==")[0]) for version in part}
    assert required("demo") - {"sprung"} <= names
