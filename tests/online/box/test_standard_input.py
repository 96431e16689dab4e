"""Lines from standard input."""

import io
from collections.abc import Iterable

import numpy as np
import pytest

from sprung.errors import FormatError
from sprung.online.box import from_lines
from sprung.recording import Recording
from sprung.units import STANDARD_GRAVITY

START = 1_700_000_000_000_000_000


def taken(text, *, rate=10.0, start=lambda: START):
    return list(from_lines(io.StringIO(text), sampling_rate=rate, start=start))


def test_lines_become_blocks_of_a_second_in_si_units() -> None:
    lines = ["acc_fl [g], speed [km/h] ,raw", *[f"{k},{3.6 * k}, {k * k} " for k in range(25)]]
    blocks = taken("\n".join(lines))
    assert [block.n_samples for block in blocks] == [10, 10, 5]
    assert [block.start - START for block in blocks] == [0, 10**9, 2 * 10**9]
    assert [channel.quantity for channel in blocks[0].channels] == ["acceleration", "speed", "unknown"]
    found = np.concatenate([block.samples for block in blocks], axis=1)
    k = np.arange(25)
    assert np.allclose(found, [STANDARD_GRAVITY * k, k, k * k])


def test_missing_values_blank_lines_marks_and_quotes() -> None:
    (block,) = taken('\ufeff"a","b"\r\n1,\r\n\r\nNaN,"2"\r\n  \r\n,null')
    assert block.names == ("a", "b")
    assert np.array_equal(block.samples, [[1, np.nan, np.nan], [np.nan, 2, np.nan]], equal_nan=True)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "standard input is empty: the first line must name the channels"),
        ("\n \n", "standard input is empty"),
        ("1.0,2.0\n", "line 1 of standard input is '1.0,2.0': it must name the channels"),
        ("a,,b\n", "line 1 of standard input is 'a,,b'"),
        ("a,b,a\n", "standard input: column name 'a' occurs more than once"),
        ("a [furlong]\n", "standard input: column 'a .furlong.'"),
        ("time,a\n", "has a time column 'time': leave it out"),
        ("a" * 70_000, "line 1 of standard input is longer than 65536 characters"),
    ],
)
def test_first_lines_that_name_no_channels(text, said) -> None:
    with pytest.raises(FormatError, match=said):
        taken(text)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("x,2", "line 13 of standard input, channel 'a': 'x' is not a measured value: send a number, or nothing"),
        ("1,inf", "line 13 of standard input, channel 'b': 'inf' is not a measured value"),
        ("1,1e300", "channel 'b': '1e300' is no"),
        ("1,2,3", r"line 13 of standard input has 3 values for 2 channels \('1,2,3'\): send one for each"),
        ("1", "line 13 of standard input has 1 value for 2 channels"),
        ("1;2", r"line 13 of standard input has 1 value for 2 channels \('1;2'"),
        ('"1,2', "channel 'a': '.1' is not a measured value"),
        ("\0,1", "channel 'a'"),
        ("1," * 40_000, "line 13 of standard input is longer"),
    ],
)
def test_bad_lines_are_named_after_the_samples_before_them(line, said) -> None:
    blocks: list[Recording] = []
    stream = io.StringIO("a,b\n" + "1,2\n" * 11 + line + "\n1,2\n")
    with pytest.raises(FormatError, match=said):
        collect(from_lines(stream, sampling_rate=10.0, start=lambda: START), blocks)
    assert [block.n_samples for block in blocks] == [10, 1]


def collect(source: Iterable[Recording], blocks: list[Recording]) -> None:
    """Append blocks as they come, so that those before an error are kept."""
    for block in source:
        blocks.append(block)


def test_bytes_that_are_no_text() -> None:
    stream = io.TextIOWrapper(io.BytesIO(b"a\n1\n" + b"\xff\xfe\n" * 3), encoding="utf-8")
    with pytest.raises(FormatError, match="of standard input is not text in UTF-8"):
        list(from_lines(stream, sampling_rate=10.0, start=lambda: START))


class Sender:
    """A stream whose lines come at times [s after the start]; reading waits until then."""

    def __init__(self, times: Iterable[float]) -> None:
        self.times = list(times)
        self.lines = iter(["a\n", *[f"{k}\n" for k in range(len(self.times))]])
        self.now = 0.0
        self.n_read = 0

    def readline(self, limit: int, /) -> str:
        if 0 < self.n_read <= len(self.times):
            came = self.times[self.n_read - 1]
            # The clock may be set while a line is waited for.
            self.now = came if abs(came - self.now) > 1000 else max(self.now, came)
        self.n_read += 1
        return next(self.lines, "")

    def clock(self) -> int:
        return START + round(self.now * 1e9)


def seconds(block: Recording) -> float:
    """Return the time of a block after START [s]."""
    assert block.start is not None
    return (block.start - START) / 1e9


def spans(times: Iterable[float], rate: float = 10.0) -> list[tuple[float, int]]:
    """Return beginning [s] and samples of the stretches that follow each other."""
    sender = Sender(times)
    blocks = list(from_lines(sender, sampling_rate=rate, start=sender.clock))
    stretches: list[tuple[float, int]] = []
    for block in blocks:
        begin, n_samples = stretches[-1] if stretches else (0.0, 0)
        if n_samples and seconds(block) == pytest.approx(begin + n_samples / rate):
            stretches[-1] = (begin, n_samples + block.n_samples)
        else:
            stretches.append((seconds(block), block.n_samples))
    assert np.array_equal(np.concatenate([block.samples[0] for block in blocks]), np.arange(len(sender.times)))
    return [(round(begin, 6), n_samples) for begin, n_samples in stretches]


def test_times_are_those_at_which_lines_come() -> None:
    steady = np.arange(40) / 10
    assert spans(steady) == [(0, 40)]
    assert spans(0.5 + steady * 1.001) == [(0.5, 40)]
    assert spans(np.zeros(40)) == [(0, 40)]
    assert spans([*steady[:25], *(steady[25:] + 60)]) == [(0, 25), (62.5, 15)]
    assert spans([*steady[:20], *(steady[20:] + 60)]) == [(0, 20), (62, 20)]
    # A sender that writes 30 lines at a time.
    assert spans(np.repeat([2.9, 5.9, 8.9], 30)) == [(2.9, 90)]
    # A clock that is set, forward and back.
    assert spans([*steady[:25], *(steady[25:] + 1e9)]) == [(0, 25), (1e9 + 2.5, 15)]
    assert spans([*steady[:25], *(steady[25:] - 3600)]) == [(0, 25), (-3597.5, 15)]


def test_a_slow_consumer_is_no_pause() -> None:
    sender = Sender(np.arange(40) / 10)
    begins = []
    for block in from_lines(sender, sampling_rate=10.0, start=sender.clock):
        begins.append(seconds(block))
        sender.now += 30.0
    assert begins == [0, 1, 2, 3]
