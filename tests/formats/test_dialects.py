"""Dialects of text: without names, separated by blanks, cut off, with comments, in other encodings."""

import numpy as np
import pytest
from tests.formats.conftest import said

from sprung.errors import FormatError, ParameterError
from sprung.formats import read, read_blocks


def table(n, row):
    return "".join(row(index) for index in range(n))


@pytest.mark.parametrize("encoding", ["utf-16", "utf-8-sig"])
def test_byte_order_marks(text_file, encoding) -> None:
    text = "time,größe,b\n" + table(200_000, lambda index: f"{index / 100:.2f},{index % 7},{index % 5}.25\n")
    recording = read(text_file(text.encode(encoding)))
    assert recording.names == ("größe", "b")
    assert recording.samples.tolist() == [[k % 7 for k in range(200_000)], [k % 5 + 0.25 for k in range(200_000)]]


def test_table_without_names(text_file) -> None:
    path = text_file(table(50, lambda index: f"{index / 100:.2f},{index % 7},{index % 5}\n"))
    recording = read(path)
    assert recording.names == ("column_2", "column_3")
    assert recording.sampling_rate == 100
    assert said(recording, "time: column 'column_1', as the first column rises as a clock does")
    assert read(path, channels=["column_3"]).names == ("column_3",)


def test_numbers_of_rows_without_names_are_no_time(text_file) -> None:
    path = text_file(table(50, lambda index: f"{index},{index % 7},{index % 5}\n"))
    with pytest.raises(ParameterError, match="has no time column"):
        read(path)


def test_title_above_numbers_is_no_header(text_file) -> None:
    recording = read(text_file("Run 7, front axle\n" + table(50, lambda index: f"{index / 100};{index % 7};1\n")))
    assert recording.names == ("column_2", "column_3")
    assert recording.comment == "Run 7, front axle"


def test_first_column_with_an_empty_name(text_file) -> None:
    """As an index is written by programs of statistics."""
    recording = read(text_file(",a,b\n" + table(50, lambda index: f"{index / 100:.2f},{index % 7},{index % 5}\n")))
    assert recording.names == ("a", "b")
    assert recording.sampling_rate == 100


@pytest.mark.parametrize("end", ["3,1", "3,1,", "3,1,2.5e", "3,1,2.5e-", '3,"1'])
def test_last_line_that_was_cut_off(text_file, end) -> None:
    recording = read(text_file(f"time,a,b\n0,1,2\n1,1,2\n2,1,2\n{end}"))
    if end != "3,1,":  # a missing value
        assert recording.n_samples == 3
        assert said(recording, "last line left out: it was cut off")
    with pytest.raises(FormatError, match="line 5"):
        read(text_file(f"time,a,b\n0,1,2\n1,1,2\n2,1,2\n{end.rstrip(',')}\n4,1,2\n"))


def test_whole_last_line_without_an_end(text_file) -> None:
    recording = read(text_file("time,a,b\n0,1,2\n1,1,2\n2,1,2"))
    assert recording.n_samples == 3
    assert not said(recording, "cut off")


def test_long_preamble_is_the_comment(text_file) -> None:
    preamble = "".join(f"Setting {index}: {index}\n" for index in range(3000))
    recording = read(text_file(preamble + "time,a\n0,1\n0.5,2\n"))
    assert recording.sampling_rate == 2
    assert recording.comment.startswith("Setting 0: 0; Setting 1: 1;")
    assert len(recording.comment) <= 500


def test_lines_are_counted_past_comments(text_file) -> None:
    text = "# one\ntime,a\n0,1\n# two\n1,2\n2,x\n"
    with pytest.raises(FormatError, match="line 6, column 'a': 'x'"):
        read(text_file(text))
    blocks = list(read_blocks(text_file("time,a\n" + "# c\n".join(f"{k},1\n" for k in range(50)))))
    assert sum(block.n_samples for block in blocks) == 50


@pytest.mark.parametrize("missing", ["", "nan", "NaN", "NA", "null", "#N/A", "-", "#NV", "n/a", "--"])
def test_missing_numbers(text_file, missing) -> None:
    rows = [f"{index},{index % 7},{missing if index == 20 else 1}" for index in range(40)]
    recording = read(text_file("time;a;b\n".replace(";", ",") + "\n".join(rows)))
    assert recording.n_samples == 39
    assert [gap.index for gap in recording.gaps] == [20]


def test_fixed_width_from_a_printing_program(text_file) -> None:
    values = np.random.default_rng(5).standard_normal((3, 400))
    rows = (f"{index / 200:10.4f}{a:14.6f}{b:14.6f}{c:14.6f}" for index, (a, b, c) in enumerate(values.T))
    recording = read(text_file("      time        acc_fl        acc_fr        acc_rl\n" + "\r\n".join(rows) + "\r\n"))
    assert recording.names == ("acc_fl", "acc_fr", "acc_rl")
    assert recording.samples == pytest.approx(values, abs=1e-6)
    assert recording.sampling_rate == 200
