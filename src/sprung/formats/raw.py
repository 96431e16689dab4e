"""Bytes of files: mapped, as text in one line, and what the printed digits of a number show."""

import mmap
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def mapped(path: Path) -> Iterator[mmap.mmap]:
    """Map a file, of which only the parts that are used are read."""
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        yield content


def decoded(raw: bytes) -> str:
    """Return text; bytes that are not UTF-8 are Latin-1."""
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def one_line(text: str) -> str:
    """Return a text as one line of printable characters."""
    return " ".join("".join(character if character.isprintable() else " " for character in text).split())


def half_digit(number: str) -> float:
    """Return half of the last digit of a printed number, such as 5e-11 for 1.52588E-05."""
    mantissa, _, exponent = number.lower().partition("e")
    return 0.5 * 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
