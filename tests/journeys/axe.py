"""The program axe-core, which checks pages for people who read, steer or see them differently: for tests only."""

import base64
import hashlib
import shutil
import subprocess
import tarfile
import tempfile
from pathlib import Path

import pytest

_VERSION = "4.14.1"
#: SHA-512 of the package in the registry of npm.
_INTEGRITY = "FHfa+lmNjQZfJz1q8wKqIDwC6DExcHt/pkjNQb09a3NPjCKg2rhu5qb2S4r76ASyFNNtuFooJpZe37OgudVGtQ=="
#: Where the package stays, which git ignores.
_CACHE = Path(__file__).parents[2] / "build" / "npm" / f"axe-core-{_VERSION}.tgz"


def axe_source() -> str:
    """Return the script; without npm, or without its registry, the test is skipped."""
    if not _CACHE.exists():
        _download()
    content = _CACHE.read_bytes()
    assert base64.b64encode(hashlib.sha512(content).digest()).decode() == _INTEGRITY, f"{_CACHE} is not axe-core"
    with tarfile.open(_CACHE) as package:
        member = package.extractfile("package/axe.min.js")
        assert member is not None
        return member.read().decode()


def _download() -> None:
    """Get the package from the registry of npm; other processes may do so at the same time."""
    npm = shutil.which("npm")
    if npm is None:
        pytest.skip("npm is missing: run scripts/system-packages")
    _CACHE.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=_CACHE.parent) as folder:
        words = [npm, "pack", f"axe-core@{_VERSION}", "--ignore-scripts", "--silent", "--pack-destination", folder]
        outcome = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=300, check=False)
        package = Path(folder) / _CACHE.name
        if outcome.returncode or not package.exists():
            pytest.skip(f"npm pack axe-core failed: {(outcome.stderr or outcome.stdout).strip()[-200:]}")
        package.replace(_CACHE)
