"""The commands of guides print what the guides show, but for the last digit of a number, which processors round."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from sprung.cli import main

NUMBER = r"(\d+(?:\.\d+)?)"
DOCS = Path(__file__).parents[2] / "docs"
GUIDES = DOCS / "how-to"


@pytest.mark.slow
@pytest.mark.parametrize("guide", ["plan-a-kit", "road", "ride", "inspection", "fmu", "wheels"])
def test_a_guide_shows_what_its_commands_print(guide, tmp_path, monkeypatch, capsys) -> None:
    if guide == "fmu":
        pytest.importorskip("fmpy")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "120")
    page = (GUIDES / f"{guide}.md").read_text(encoding="utf-8")
    for name, text in re.findall(r"^`(\w+\.toml)`:\n\n```toml\n(.*?)```", page, re.DOTALL | re.MULTILINE):
        Path(name).write_text(text, encoding="utf-8")
    blocks = re.findall(r"```console\n(.*?)```", page, re.DOTALL)
    assert blocks
    printed: list[str] = []
    for line in "".join(blocks).splitlines():
        if line.startswith("$ "):
            assert main(shlex.split(line.removeprefix("$ sprung "))) == 0
            printed = [each.rstrip() for each in capsys.readouterr().out.splitlines()]
        elif line != "...":
            assert any(is_alike(line.rstrip(), each) for each in printed), line


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


def is_alike(shown: str, printed: str) -> bool:
    """Whether two lines differ by one unit of the last digits of their numbers at most."""
    parts, others = re.split(NUMBER, shown), re.split(NUMBER, printed)
    if parts[::2] != others[::2]:
        return False
    units = [10.0 ** -len(number.partition(".")[2]) for number in parts[1::2]]
    pairs = zip(parts[1::2], others[1::2], units, strict=True)
    return all(abs(float(one) - float(other)) < 1.01 * unit for one, other, unit in pairs)


@pytest.mark.parametrize(
    ("printed", "is_like"), [("spring 3.5 %", True), ("spring 3.4 %", False), ("tyre 3.6 %", False)]
)
def test_lines_are_alike_to_the_last_digit(printed, is_like) -> None:
    assert is_alike("spring 3.6 %", printed) == is_like
