import numpy as np
import pytest
from matplotlib.figure import Figure

from sprung.errors import ParameterError
from sprung.reproduce import CHAPTERS, reproduce
from sprung.reproduce.report import Paragraph, Report, Section, Table, deviation, found_in, picture, render, spread
from sprung.reproduce.thesis import number, of_runs, worst_error


@pytest.fixture
def report():
    figure = Figure(figsize=(2, 1))
    figure.subplots().plot([0, 1], [1, 0])
    table = Table("Table 1: a < b", ("", "f [Hz]"), (("one", "1.0"),), "A remark.")
    blocks = (Paragraph("Text with <b>."), table, picture(figure, "Figure 1: a line."))
    return Report("A title", "What is & what is not.", (Section("A section", blocks),), ("Run once.",))


def test_page_holds_everything_and_needs_no_network(report) -> None:
    page = render(report, others=(("other.html", "Another"),))
    for text in (
        "A title",
        "What is &amp; what is not.",
        "A section",
        "Table 1: a &lt; b",
        "f [Hz]",
        "A remark.",
        "Figure 1: a line.",
        "Run once.",
        'href="other.html"',
        "Text with &lt;b&gt;.",
    ):
        assert text in page
    assert "http:" not in page
    assert "https:" not in page
    assert "<script" not in page
    assert page.count("data:image/png;base64,iVBOR") == 1


def test_a_row_of_another_length_is_refused() -> None:
    with pytest.raises(ParameterError, match="has 1 cells, but must have 2"):
        Table("t", ("a", "b"), (("x",),))


def test_words_for_numbers() -> None:
    assert deviation(101.0, 100.0) == "+1.00 %"
    assert deviation(float("nan"), 100.0) == "–"
    assert spread([np.nan]) == "–"
    assert found_in([1.0, np.nan]) == "1 of 2"
    assert of_runs([2.0, 2.0, np.nan]) == "2 of 3: 2.00 (2.00 to 2.00)"
    assert number(float("nan")) == "–"
    assert worst_error([[1.1, np.nan], [1.1, np.nan]], [1.0, 2.0]) == pytest.approx(0.1)


def test_unknown_chapter_is_refused(tmp_path) -> None:
    with pytest.raises(ParameterError, match="chapter '9' is not one of 4, 5"):
        reproduce(["9"], directory=tmp_path / "out")
    assert not (tmp_path / "out").exists()
    assert list(CHAPTERS) == ["4", "5", "6", "7", "8", "comparison"]
