import json
import re
from dataclasses import replace

import pytest
from matplotlib.figure import Figure

from sprung.errors import ParameterError
from sprung.results.page.page import Paragraph, Report, Section, Sentences, picture, render
from sprung.results.tables import Table


@pytest.fixture
def report():
    figure = Figure(figsize=(2, 1))
    figure.subplots().plot([0, 1], [1, 0])
    table = Table("Table 1: a < b", ("", "f [Hz]"), (("one", "1.0"),), ends_in_words=False, caption="A remark.")
    blocks = (Paragraph("Text with <b>."), Sentences(("One & two.",)), table, picture(figure, "Figure 1: a line."))
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
        "<li>One &amp; two.</li>",
        "<td>1.0</td>",
        '<td class="words">one</td>',
    ):
        assert text in page
    assert "http:" not in page
    assert "https:" not in page
    assert "<script" not in page
    assert page.count("data:image/png;base64,iVBOR") == 1


def test_a_row_of_another_length_is_refused() -> None:
    with pytest.raises(ParameterError, match="has 1 cells, but must have 2"):
        Table("t", ("a", "b"), (("x",),))


def test_columns_without_any_cell_are_left_out(report) -> None:
    table = Table("", ("a", "b", "c"), (("1", "", "│█"), ("2", " ", "x")), n_words=0)
    page = render(replace(report, sections=(Section("s", (table,)),)))
    assert '<td>1</td><td class="bar">│█</td>' in page
    assert ">b</th>" not in page


def test_tall_pictures_are_marked() -> None:
    tall = Figure(figsize=(1, 2))
    assert picture(tall, "c").is_tall
    assert not picture(Figure(figsize=(2, 1)), "c").is_tall


def test_document_is_embedded_and_cannot_break_out(report) -> None:
    document = {"schema": "x", "channels": ["</script><script>alert(1)</script>", "a&b"]}
    page = render(replace(report, document=document))
    assert page.count("<script") == 1
    (text,) = re.findall(r'<script type="application/json" id="result">(.*?)</script>', page, flags=re.DOTALL)
    assert json.loads(text) == document
