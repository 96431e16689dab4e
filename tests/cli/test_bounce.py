"""The command `sprung bounce`: how-to page, JSON, report, and files without a push."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import sprung
from sprung.cli import main

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "bounce-test.md"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The folder in which the example of the page has run."""
    path = tmp_path_factory.mktemp("bounce")
    (code,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    exec(
        code.replace('"before.csv"', repr(str(path / "before.csv"))).replace(
            '"after.csv"', repr(str(path / "after.csv"))
        ),
        {},
    )
    return path


@pytest.mark.slow
def test_the_page_prints_what_the_command_prints(folder, capsys, monkeypatch) -> None:
    monkeypatch.chdir(folder)
    (command, head) = re.findall(r"\$ sprung (.*)\n(.*)\n", PAGE.read_text())[0]
    assert main([*command.split(), "--json", "b.json", "--report", "b.html", "--figures", "."]) == 0
    shown = capsys.readouterr().out
    assert head in shown
    intervals = re.findall(r"(\S+) \.\. (\S+) +changed", shown)
    assert len(intervals) == 7  # all three modes, and the damper
    assert all(float(low) * float(high) > 0 for low, high in intervals)
    document = json.loads((folder / "b.json").read_text())
    assert document["schema"] == "sprung.bounce/1"
    assert [len(document[key]) for key in ("tests", "modes")] == [4, 3]
    changed = {each["part"] for each in document["changes"] if each["is_significant"] and each["quantity"] == "value"}
    assert changed == {"front_left.damper"}
    assert "Free motion after each push" in (folder / "b.html").read_text()
    assert (folder / "bounce.png").exists()
    assert sprung.read_document(folder / "b.json").as_json()["schema"] == "sprung.bounce/1"


def test_a_file_without_a_push_gives_no_answer(tmp_path, capsys) -> None:
    noise = np.random.default_rng(1).standard_normal((1, 2000))
    sprung.write(sprung.Recording(noise, 100.0, (sprung.Channel("acc", "acceleration"),)), tmp_path / "run.csv")
    assert main(["bounce", str(tmp_path / "run.csv")]) == 3
    assert "push and let go" in capsys.readouterr().err


@pytest.mark.slow
def test_results_show_themselves(folder) -> None:
    result = sprung.bounce(sprung.read(folder / "before.csv"))
    assert len(result.to_dataframe()) == len(result.modes)
    assert "tests" in repr(result)
    assert result.plot().axes
