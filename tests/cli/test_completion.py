"""Completion of the command line by the shell."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from sprung.vehicles.models import VEHICLES


def offered(words: str, folder: Path) -> list[str]:
    """Return what bash offers after the words."""
    environment = os.environ | {
        "_SPRUNG_COMPLETE": "complete_bash",
        "COMP_WORDS": words,
        "COMP_CWORD": str(len(words.split(" ")) - 1),
    }
    code = "import sys; from sprung.cli import main; sys.exit(main())"
    process = subprocess.run(
        [sys.executable, "-c", code], env=environment, cwd=folder, capture_output=True, text=True, check=True
    )
    return process.stdout.split()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("run.csv", "run.parquet", "notes.txt", "car.toml", "modes.json", ".hidden.csv"):
        (tmp_path / name).touch()
    (tmp_path / "records").mkdir()
    (tmp_path / "records" / "a.npz").touch()
    return tmp_path


@pytest.mark.slow
def test_commands_and_options_are_offered(folder) -> None:
    assert "identify" in offered("sprung id", folder)
    assert offered("sprung identify --form", folder) == ["--format"]
    assert offered("sprung identify --format s", folder) == ["svg"]


@pytest.mark.slow
def test_vehicles_are_offered_by_name_and_as_files(folder) -> None:
    assert offered("sprung corners --vehicle ", folder) == [*VEHICLES, "car.toml", "records/"]
    assert offered("sprung identify --vehicle za", folder) == ["zafira", "zafira-printed"]


@pytest.mark.slow
def test_files_are_offered_by_what_a_command_reads(folder) -> None:
    assert offered("sprung info r", folder) == ["records/", "run.csv", "run.parquet"]
    assert offered("sprung info records/", folder) == ["records/a.npz"]
    assert offered("sprung info .", folder) == [".hidden.csv"]
    assert offered("sprung track mo", folder) == ["modes.json"]
    assert offered("sprung info missing/", folder) == []


def test_the_shell_script_is_shown(sprung) -> None:
    text = sprung("--help").out
    assert "--install-completion" in text
    assert "--show-completion" in text
