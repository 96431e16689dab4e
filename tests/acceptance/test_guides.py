"""The commands of guides print what the guides show."""

import re
import shlex
from pathlib import Path

import pytest

from sprung.cli import main

GUIDES = Path(__file__).parents[2] / "docs" / "how-to"


@pytest.mark.slow
@pytest.mark.parametrize("guide", ["plan-a-kit", "road", "ride", "fmu"])
def test_a_guide_shows_what_its_commands_print(guide, tmp_path, monkeypatch, capsys) -> None:
    if guide == "fmu":
        pytest.importorskip("fmpy")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "120")
    blocks = re.findall(r"```console\n(.*?)```", (GUIDES / f"{guide}.md").read_text(encoding="utf-8"), re.DOTALL)
    assert blocks
    printed: list[str] = []
    for line in "".join(blocks).splitlines():
        if line.startswith("$ "):
            assert main(shlex.split(line.removeprefix("$ sprung "))) == 0
            printed = [each.rstrip() for each in capsys.readouterr().out.splitlines()]
        elif line != "...":
            assert line.rstrip() in printed
