"""Answers to requests for samples are remembered; windows become modes."""

from pathlib import Path

import pytest

from sprung.online.box.onboard import Answers


@pytest.mark.parametrize("text", ["", "[[1]]", "7", '{"a": 1}', "[[[1, 2, 3], {}"])
def test_answers_whose_file_is_damaged_begin_anew(tmp_path: Path, text) -> None:
    path = tmp_path / "answers.json"
    path.write_text(text, encoding="ascii")
    answers = Answers(path)
    assert answers.get((1, 2, 3)) is None
    answers.keep((1, 2, 3), {"frames": 5})
    assert Answers(path).get((1, 2, 3)) == {"frames": 5}


def test_answers_are_bounded(tmp_path: Path) -> None:
    path = tmp_path / "answers.json"
    answers = Answers(path)
    for number in range(150):
        answers.keep((number, 0, 1), {"frames": number})
    again = Answers(path)
    assert again.get((49, 0, 1)) is None
    assert again.get((50, 0, 1)) == {"frames": 50}
