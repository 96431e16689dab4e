"""The commands that the documentation shows exist, with their options."""

import re
import shlex
from pathlib import Path

import pytest
from typer.main import get_command

from sprung.cli import _application

REPOSITORY = Path(__file__).parents[2]
PAGES = sorted([REPOSITORY / "README.md", REPOSITORY / "CONTRIBUTING.md", *(REPOSITORY / "docs").rglob("*.md")])
_BLOCK = re.compile(r"^ *```console\n(.*?)^ *```", flags=re.MULTILINE | re.DOTALL)
_COMMAND = re.compile(r"(?:^|[\s/])sprung ([^|;&#>]*)")


def commands() -> list[tuple[str, str]]:
    """Return page and words of every command after a prompt."""
    found = []
    for page in PAGES:
        for block in _BLOCK.findall(page.read_text(encoding="utf-8")):
            lines = [line.strip()[2:] for line in block.splitlines() if line.strip().startswith("$ ")]
            found += [(page.name, match[1].strip()) for line in lines for match in _COMMAND.finditer(line)]
    return found


@pytest.fixture(scope="module")
def application():
    return get_command(_application())


def test_there_are_commands() -> None:
    assert len(commands()) > 60


def test_commands_have_their_options(application) -> None:
    wrong = []
    for page, text in commands():
        command, words = application, shlex.split(text)
        while words and words[0] in getattr(command, "commands", {}):
            command = command.commands[words.pop(0)]
        known = {name for parameter in command.params for name in (*parameter.opts, *parameter.secondary_opts)}
        unknown = {word.split("=")[0] for word in words if word.startswith("--")} - known - {"--help"}
        is_command = command is not application or not words or words[0].startswith("-")
        if unknown or not is_command:
            wrong.append((page, text))
    assert not wrong
