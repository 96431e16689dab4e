"""What a user sees as values that can be frozen: rounded, without markup and what differs from run to run; compared."""

import json
import math
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parent / "frozen"
#: Set by regenerate.py: what is seen is written instead of compared.
IS_WRITING = os.environ.get("SPRUNG_GOLDEN") == "write"
#: Relative noise on all recordings, to find cases in which a decision hangs by a thread.
NOISE = float(os.environ.get("SPRUNG_GOLDEN_NOISE", "0"))
#: Significant digits that are frozen.
DIGITS = 6
#: Difference of values that are 0 but for rounding.
_NOTHING = 1e-11
#: Values that depend on rounding: of searches that did not converge, and of what the data do not determine.
_UNDETERMINED = frozenset({"misfit", "misfit_excess", "payload_x_moment"})
#: Values that are compared with 0.01 where they are smaller.
_SHARES = frozenset({"change", "score", "explained"})
#: Longest list of numbers, of lists of numbers and of rows that are frozen one by one.
_MOST_NUMBERS = 64
_MOST_NESTED = 256
_MOST_ROWS = 12
_WIDTH = 118

_NUMBER = re.compile(r"\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
_VARYING = (
    (re.compile(r"\b([Ss]prung) \d+\.\d+(\.[\w+]+)*"), r"\1 VERSION"),
    (re.compile(r"(?<![\d.])\d+\.\d+\.\d+(?:[a-z]+\d+)?(?![\d.]*\d)"), "VERSION"),
    (re.compile(r"^(Linux|macOS|Windows)-.*"), "SYSTEM"),
    (re.compile(r"^[\d.,]+ [kMGT]B($|(?=; intake))"), "SIZE"),
    (re.compile(r"written \d{4}-\d\d-\d\d \d\d:\d\d UTC"), "written TIME"),
)


def check(name: str, seen: Any, *, digits: int = DIGITS) -> None:
    """Compare what is seen with what was frozen under a name; freeze it where regenerate.py asks for that."""
    path = FOLDER / f"{name}.json"
    seen = rounded(seen, digits=DIGITS)
    if IS_WRITING:
        path.write_text("\n".join(_lines(seen)) + "\n", encoding="utf-8")
        return
    frozen = json.loads(path.read_text(encoding="utf-8"))
    found = list(differences(frozen, seen, tolerance=1.5 * 10.0 ** (1 - digits)))
    more = f"\nand {len(found) - 40} more" if len(found) > 40 else ""
    assert not found, (
        "\n".join(found[:40]) + f"{more}\nif that is meant: python tests/golden/regenerate.py {name}, and read git diff"
    )


def rounded(value: Any, *, digits: int, scale: float = 0.0) -> Any:
    """Return a value with numbers rounded to digits, those of a list relative to the largest of them."""
    if isinstance(value, Mapping):
        if value.keys() == {"real", "imag"}:
            value = _oriented(value)
        return {str(key): rounded(each, digits=digits) for key, each in value.items() if key not in _UNDETERMINED}
    if isinstance(value, list | tuple):
        value = _shortened(value)
        if isinstance(value, dict):
            return rounded(value, digits=digits)
        scale = max(scale, _scale(value))
        return [rounded(each, digits=digits, scale=scale) for each in value]
    if isinstance(value, float) and math.isfinite(value):
        size = max(abs(value), scale)
        return 0.0 if abs(value) < _NOTHING else round(value, digits - 1 - math.floor(math.log10(size))) + 0.0
    if isinstance(value, str):
        for pattern, name in _VARYING:
            value = pattern.sub(name, value)
    return value


def _oriented(shape: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a mode shape whose first large entry is positive: where two are largest, rounding decides on the sign."""
    large = 0.1 * _scale(shape["real"])
    first = next((entry for entry in shape["real"] if abs(entry) > large), 1.0)
    return {part: [math.copysign(1.0, first) * entry for entry in shape[part]] for part in ("real", "imag")}


def _shortened(value: Sequence[Any]) -> Any:
    """Return a long list as its size and some of its entries; signs of eigenvectors are arbitrary."""
    is_nested = any(isinstance(each, list | tuple) for each in value)
    numbers = _numbers(value) or []
    if len(numbers) > (_MOST_NESTED if is_nested else _MOST_NUMBERS):
        rms = math.sqrt(sum(number**2 for number in numbers) / len(numbers))
        ends = {} if is_nested else {"first": value[:3], "last": value[-3:]}
        return {"n_numbers": len(numbers), "rms": rms, **ends}
    if len(value) > _MOST_ROWS and isinstance(value[0], Mapping):
        return [*value[: _MOST_ROWS - 4], f".. {len(value) - _MOST_ROWS + 2} more ..", *value[-2:]]
    return value


def _numbers(value: Any) -> list[float] | None:
    """Return the numbers of a list, or of lists of them; None for what holds something else than these and nulls."""
    if isinstance(value, list | tuple):
        parts = [_numbers(each) for each in value if each is not None]
        return None if None in parts else [number for part in parts if part for number in part]
    return [float(value)] if isinstance(value, float | int) and math.isfinite(value) else None


def _scale(value: Any) -> float:
    """Return the largest magnitude of a list of numbers, or of lists of them; 0 for others."""
    if isinstance(value, list | tuple):
        return max(map(_scale, value), default=0.0)
    return abs(value) if isinstance(value, float) and math.isfinite(value) else 0.0


def differences(frozen: Any, seen: Any, *, tolerance: float, place: str = "", scale: float = 0.0) -> Iterator[str]:
    """Yield where two values differ: words and integers exactly, other numbers by more than a relative tolerance."""
    if isinstance(frozen, dict) and isinstance(seen, dict):
        for key in sorted(frozen.keys() | seen.keys()):
            if key in frozen and key in seen:
                least = 0.01 if key in _SHARES else 0.0
                yield from differences(frozen[key], seen[key], tolerance=tolerance, place=f"{place}/{key}", scale=least)
            else:
                yield f"{place}/{key} is {'gone' if key in frozen else 'new'}"
    elif isinstance(frozen, list) and isinstance(seen, list):
        if len(frozen) != len(seen):
            yield f"{place} has {len(seen)} entries, not {len(frozen)}"
        scale = max(scale, _scale(frozen))
        for k, (old, new) in enumerate(zip(frozen, seen, strict=False)):
            yield from differences(old, new, tolerance=tolerance, place=f"{place}[{k}]", scale=scale)
    elif not _is_alike(frozen, seen, tolerance=tolerance, scale=scale):
        yield f"{place}\n  frozen: {frozen!r}\n  seen:   {seen!r}"


def _is_alike(frozen: Any, seen: Any, *, tolerance: float, scale: float) -> bool:
    if isinstance(frozen, str) and isinstance(seen, str):
        return frozen == seen or _texts_are_alike(frozen, seen, tolerance)
    if isinstance(frozen, float) and isinstance(seen, float | int) and not isinstance(seen, bool):
        return abs(frozen - seen) <= tolerance * max(abs(frozen), scale) + _NOTHING
    return type(frozen) is type(seen) and bool(frozen == seen)


def _texts_are_alike(frozen: str, seen: str, tolerance: float) -> bool:
    """Return whether texts differ in the last printed digit of decimals at most."""
    if _NUMBER.sub("0", frozen).split() != _NUMBER.sub("0", seen).split():
        return False
    for old, new in zip(_NUMBER.findall(frozen), _NUMBER.findall(seen), strict=True):
        mantissa, _, exponent = old.lower().partition("e")
        decimals = mantissa.partition(".")[2]
        if old != new and not (decimals or exponent):
            return False
        last = 10.0 ** (int(exponent or 0) - len(decimals))
        if abs(float(old) - float(new)) > max(tolerance * max(float(old), 0.01), 1.01 * last):
            return False
    return True


def _lines(value: Any, indent: int = 0, head: str = "", tail: str = "") -> Iterator[str]:
    """Yield the lines of a JSON text: what fits a line stands on one."""
    begin = " " * indent + head
    if isinstance(value, dict) and value:
        members = [(json.dumps(key, ensure_ascii=False) + ": ", value[key]) for key in sorted(value)]
    elif isinstance(value, list):
        members = [("", each) for each in value]
    else:
        members = []
    line = begin + json.dumps(value, ensure_ascii=False, sort_keys=True) + tail
    is_row = isinstance(value, list) and not any(isinstance(each, dict | list | str) for each in value)
    if not members or is_row or (len(line) <= _WIDTH and not any(isinstance(each, dict | str) for _, each in members)):
        yield line
        return
    yield begin + ("{" if isinstance(value, dict) else "[")
    for k, (name, each) in enumerate(members):
        yield from _lines(each, indent + 1, name, "," if k < len(members) - 1 else "")
    yield " " * indent + ("}" if isinstance(value, dict) else "]") + tail


class _Text(HTMLParser):
    """Text that a page shows, a line for each block."""

    _HIDDEN = frozenset({"script", "style", "template", "head"})
    _INLINE = frozenset(
        {"a", "abbr", "b", "code", "em", "i", "kbd", "mark", "small", "span", "strong", "sub", "sup", "time", "tspan"}
    )

    def __init__(self) -> None:
        super().__init__()
        self.parts: list[str] = []
        self._hidden = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._hidden += tag in self._HIDDEN
        self._break(tag)

    def handle_endtag(self, tag: str) -> None:
        self._hidden -= tag in self._HIDDEN
        self._break(tag)

    def handle_data(self, data: str) -> None:
        if not self._hidden:
            self.parts.append(" ".join(re.split(r"\s+", data)))

    def _break(self, tag: str) -> None:
        if tag not in self._INLINE:
            self.parts.append("\n" if tag not in {"td", "th"} else "  ")


def html_lines(page: str) -> list[str]:
    """Return the visible text of a page, without markup."""
    text = _Text()
    text.feed(page)
    return text_lines("".join(text.parts))


def text_lines(text: str) -> list[str]:
    """Return the lines of a text without blanks around them, and without empty ones."""
    lines = (" ".join(line.split()) for line in text.splitlines())
    return [line for line in lines if line]
