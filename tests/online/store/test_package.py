"""The store without its packages."""

import subprocess
import sys

import pytest

WITHOUT = "import sys; sys.modules['sqlalchemy'] = None; from sprung.cli import main; raise SystemExit(main({words}))"


@pytest.mark.slow
@pytest.mark.parametrize("words", [["alerts"], ["vehicles", "list"], ["monitor"]], ids=" ".join)
def test_missing_package_is_one_sentence(words: list[str]) -> None:
    command = [sys.executable, "-c", WITHOUT.format(words=words)]
    outcome = subprocess.run(command, capture_output=True, text=True, check=False)
    assert outcome.returncode == 2
    assert outcome.stderr == (
        "sprung: the store needs the package sqlalchemy: install it with pip install 'sprung[online]'\n"
    )
