"""The commands of guides print what the guides show."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from sprung.cli import main

DOCS = Path(__file__).parents[2] / "docs"
GUIDES = DOCS / "how-to"


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


@pytest.mark.slow
def test_the_example_of_the_page_on_fleets_runs_word_for_word(tmp_path) -> None:
    pytest.importorskip("pyspark")
    if shutil.which("java") is None:
        pytest.skip("Java is not installed")
    page = (DOCS / "fleet.md").read_text(encoding="utf-8")
    (commands,) = re.findall(r"```console\n(.*?)```", page, re.DOTALL)
    command = tmp_path / "bin" / "sprung"
    command.parent.mkdir()
    command.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -m sprung "$@"\n', encoding="utf-8")
    command.chmod(0o755)
    variables = {**os.environ, "PATH": f"{command.parent}:{os.environ['PATH']}", "COLUMNS": "120"}
    work = tmp_path / "work"
    work.mkdir()
    words = ["sh", "-e", "-c", commands]
    outcome = subprocess.run(words, cwd=work, env=variables, capture_output=True, text=True, check=False)
    assert outcome.returncode == 0, outcome.stderr
    (shown,) = re.findall(r"^    (car-2 .*)$", page, re.MULTILINE)
    assert shown in [line.rstrip() for line in outcome.stdout.splitlines()]
