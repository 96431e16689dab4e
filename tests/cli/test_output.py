import pytest

from sprung.cli.options import names
from sprung.cli.output import printable
from sprung.errors import ParameterError


def test_lists_of_names():
    assert names(None) is None
    assert names("acc_fl") == ("acc_fl",)
    assert names("a, b ,c") == ("a", "b", "c")
    assert names('"x, y",z') == ("x, y", "z")
    for text in ("", "a,", "a,a"):
        with pytest.raises(ParameterError, match="commas"):
            names(text)


def test_text_is_one_printable_line():
    assert printable("a\n\tb\x1b[31mc\x07") == "a b [31mc"
