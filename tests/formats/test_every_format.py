"""What holds for every format: write then read, and hostile files."""

import json
import random
import struct
import subprocess
import sys
import warnings
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, example, given, settings
from hypothesis import strategies as st
from tests.formats import (
    test_ide,
    test_lvm,
    test_mdf,
    test_phone,
    test_seismic,
    test_sst,
    test_tdms,
    test_universal,
    test_wav,
)

from sprung.errors import FormatError, MissingPackageError, ParameterError, SprungError
from sprung.formats import (
    ENDINGS,
    FORMATS,
    WRITERS,
    ReadSettings,
    dewesoft,
    groups,
    ide,
    mdf,
    parquet,
    read,
    read_blocks,
    seismic,
    stated,
    table,
    tdms,
    write,
)
from sprung.formats.registry import format_of
from sprung.formats.table import join
from sprung.recording import QUANTITIES, Channel, Gap, Recording


def by_sprung(ending, folder):
    samples = np.random.default_rng(7).standard_normal((3, 400))
    write(Recording(samples, 100.0, tuple(map(Channel, "abc")), start=10**18), folder / f"run{ending}")
    return folder / f"run{ending}"


def of_bytes(content, name, folder):
    (folder / name).write_bytes(content)
    return folder / name


def phyphox(folder):
    rows = np.column_stack([np.arange(400) / 100, VALUES]).tolist()
    times = "event,a,b\nSTART,0,1e9\n"
    return test_phone.archive(
        folder / "run.zip", a_csv=test_phone.table(["t", "x", "y", "z"], rows), meta__time_csv=times
    )


VALUES = np.random.default_rng(8).standard_normal((400, 3)).round(6)
RECORDS = test_phone.records("Accelerometer", 400, values=VALUES.T)
TIMES = [f"{0.01 * k:.2f}" for k in range(400)]
FIELDS = VALUES.astype(str).tolist()
HISTORIES = b"".join(
    test_universal.dataset(row, ids=(name, *["NONE"] * 4)) for name, row in zip("ab", VALUES.T, strict=False)
)
BINARY = {"binary": test_universal.binary_header(), "body": VALUES[:, 0].tobytes()}
NOTES = test_wav.broadcast() + test_wav.chunk(b"LIST", b"INFO" + test_wav.chunk(b"ICMT", b"wet road\0"))
SOUND = test_wav.wav((VALUES * 5000).astype("<i2").tobytes(), extra=test_wav.chunk(b"ds64", bytes(28)) + NOTES)
PIECES = [(f"HN{axis}", 1e6 * VALUES[:, k], 200.0, test_seismic.START) for k, axis in enumerate("ENZ")]


def labview(x_columns, rows):
    text = test_lvm.segment(["a", "b"], rows, x_columns=x_columns)
    return partial(of_bytes, test_lvm.lvm(text, x_columns=x_columns), "run.lvm")


#: Function from a folder to a small file of each kind in it.
EXAMPLES: dict[str, Callable[[Path], Path]] = {
    **{ending: partial(by_sprung, ending) for ending in WRITERS},
    "MDF 3": lambda folder: test_mdf.written(folder / "run.mf4", "3.30"),
    "MDF 4": lambda folder: test_mdf.written(folder / "run.mf4", "4.10"),
    "TDMS": lambda folder: test_tdms.written(folder / "run.tdms"),
    "IDE": lambda folder: test_ide.written(folder / "run.ide")[0],
    "LVM": labview("No", [["", *row[:2]] for row in FIELDS]),
    "LVM, times": labview("One", [[time, *row[:2]] for time, row in zip(TIMES, FIELDS, strict=True)]),
    "LVM, own times": labview("Multi", [[t, row[0], t, row[1]] for t, row in zip(TIMES, FIELDS, strict=True)]),
    "WAV": partial(of_bytes, SOUND, "run.wav"),
    "SST": partial(of_bytes, test_sst.sst(), "run.sst"),
    "miniSEED 2": lambda folder: test_seismic.write_file(folder / "run.mseed", *PIECES),
    "miniSEED 3": lambda folder: test_seismic.write_file(folder / "run.mseed", *PIECES, version=3),
    "UFF, text": partial(of_bytes, test_universal.units() + HISTORIES, "run.unv"),
    "UFF, binary": partial(of_bytes, test_universal.dataset(VALUES[:, 0], **BINARY), "run.unv"),
    "JSON": partial(of_bytes, json.dumps([test_phone.METADATA, *RECORDS]).encode(), "run.json"),
    "archive": phyphox,
}
#: Kinds of files of which a beginning may be a whole file.
READ_IN_PART = (".csv", "SST", "miniSEED 2", "miniSEED 3", "LVM", "LVM, times", "LVM, own times")
every_example = pytest.mark.parametrize("example", EXAMPLES)


@every_example
def test_any_rows_are_those_of_all_rows(tmp_path: Path, monkeypatch, example) -> None:
    monkeypatch.setattr(table, "PIECE_ROWS", 64)
    monkeypatch.setattr(stated, "_PIECE_BYTES", 1000)
    monkeypatch.setattr(parquet, "PIECE_ROWS", 64)
    monkeypatch.setattr(mdf, "_PIECE_BYTES", 1000)
    monkeypatch.setattr(tdms, "_PIECE_ROWS", 64)
    path = EXAMPLES[example](tmp_path)
    for group in format_of(path).groups(path, ReadSettings()):
        names = [item.name for item in group.open(None).columns][::-1]
        opened = group.open(names[:2])
        assert [item.name for item in opened.columns] == names[:2]
        whole = join(list(opened.blocks()))
        assert whole.first_row == 1 or opened.row_word == "line"
        n = whole.n_rows
        assert group.n_rows in {None, n}
        for first, last in ((0, 1), (n // 3, n // 2), (n - 1, None), (n // 2, 5 * n)):
            part = join(list(opened.blocks(first, last)))
            np.testing.assert_array_equal(part.values, whole.values[:, first:last])
            np.testing.assert_array_equal(part.stamps, None if whole.stamps is None else whole.stamps[first:last])
            assert part.first_row == whole.first_row + first
        assert list(opened.blocks(n)) == []


@every_example
def test_an_unknown_channel_gives_a_sentence(tmp_path: Path, example) -> None:
    path = EXAMPLES[example](tmp_path)
    with pytest.raises(SprungError, match=rf"{path.name}.* has no channel 'missing': choose from|holds no arrays"):
        read(path, channels=["missing"])


@every_example
def test_a_beginning_with_other_bytes_gives_a_sentence(tmp_path: Path, example) -> None:
    path = EXAMPLES[example](tmp_path)
    content = path.read_bytes()
    for part in (
        bytes(300),
        content[:12] + bytes(300),
        content[:40],
        content[:300] + bytes(300),
        content[: len(content) // 2],
        content[:-30],
    ):
        path.write_bytes(part)
        assert is_refused(path) or example in READ_IN_PART


def mutation(content: bytes, generator: random.Random) -> bytes:
    """Return a file with flipped bits, extreme numbers, moved, lost or added bytes, or without its end."""
    changed = bytearray(content)
    for _ in range(generator.choice((1, 1, 2, 8))):
        place = max(8, int(generator.random() ** generator.choice((1, 3)) * (len(changed) - 16)))
        width = generator.choice((2, 4, 8))
        numbers = (-1, 0, (1 << 63) - 1, 1 << generator.randrange(64), generator.randrange(len(changed)))
        word = struct.pack("<q", generator.choice(numbers) % (1 << 63))[:width]
        kind = generator.randrange(6)
        if kind == 0:
            changed[place] ^= 1 << generator.randrange(8)
        elif kind == 1:
            changed[place : place + width] = word
        elif kind == 2:
            del changed[max(64, generator.randrange(len(changed))) :]
        elif kind == 3:
            changed[place : place + 100] = changed[generator.randrange(len(changed)) :][:100]
        elif kind == 4:
            del changed[place : place + generator.randrange(1, 64)]
        else:
            changed[place:place] = generator.randbytes(generator.randrange(1, 32))
        changed.extend(bytes(max(0, 64 - len(changed))))
    return bytes(changed)


@pytest.mark.slow
@every_example
def test_mutations_are_read_or_refused(tmp_path: Path, example) -> None:
    path, generator = EXAMPLES[example](tmp_path), random.Random(example)
    content = path.read_bytes()
    assert not is_refused(path)
    outcomes = []
    for _ in range(300):
        path.write_bytes(mutation(content, generator))
        outcomes.append(is_refused(path))
    assert sum(outcomes) > 30 or example in READ_IN_PART


def is_refused(path, sampling_rate=None):
    """Return whether a file is refused, in one line that names it, rather than read to its end in all groups."""
    try:
        for group in groups(path):
            for _ in group.open(None).blocks():
                pass
            read(path, sampling_rate=sampling_rate, settings=ReadSettings(groups=[group.name]))
    except SprungError as error:
        message = str(error)
    else:
        return False
    assert path.name in message
    assert "\n" not in message
    return True


RELAXED = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
names = st.text(st.characters(codec="utf-8", categories=["L", "N", "P", "S", "Zs"]), min_size=1, max_size=12)


@st.composite
def any_recording(draw):
    n_samples = draw(st.integers(12, 60))
    channel_names = draw(st.lists(names, min_size=1, max_size=4, unique=True))
    try:
        channels = tuple(Channel(name, draw(st.sampled_from(sorted(QUANTITIES)))) for name in channel_names)
    except ParameterError:
        channels = (Channel("acc"),)
    seed = draw(st.integers(0, 2**32 - 1))
    samples = np.random.default_rng(seed).standard_normal((len(channels), n_samples))
    samples *= 10.0 ** draw(st.integers(-12, 12))
    sampling_rate = draw(st.sampled_from([1.0, 100.0, 104.36, 1000.0, 25_600.0]))
    durations = st.floats(1 / sampling_rate, 1e4)  # a shorter one looks like a late stamp
    gaps = tuple(Gap(index, draw(durations)) for index in draw(st.sets(st.sampled_from([4, 8]), max_size=2)))
    return Recording(
        samples,
        sampling_rate,
        channels,
        start=draw(st.none() | st.integers(10**18, 2 * 10**18)),
        gaps=tuple(sorted(gaps, key=lambda gap: gap.index)),
    )


@pytest.mark.slow
@pytest.mark.parametrize("ending", WRITERS)
@RELAXED
@given(recording=any_recording())
@example(recording=Recording(np.eye(3, 30), 104.36, tuple(map(Channel, ("Beschleunigung vorn", "a-1", "INC.2 (raw)")))))
@example(recording=Recording(np.eye(1, 12), 1.0, (Channel("0[]", "acceleration"),)))
@example(recording=Recording(np.eye(2, 20), 50.0, (Channel("größe 1"), Channel('a "b"; c,d', "acceleration"))))
def test_write_then_read_gives_the_same(tmp_path: Path, ending, recording) -> None:
    path = tmp_path / f"run{ending}"
    path.unlink(missing_ok=True)
    with suppress(ParameterError):  # a name that would not be read back
        write(recording, path)
    assume(path.exists())
    again = read(path)
    assert again.names == recording.names
    assert [channel.quantity for channel in again.channels] == [channel.quantity for channel in recording.channels]
    np.testing.assert_allclose(again.samples, recording.samples, rtol=1e-14, atol=1e-12, equal_nan=False)
    assert again.sampling_rate == pytest.approx(recording.sampling_rate, rel=1e-7)
    assert again.start == recording.start
    assert [gap.index for gap in again.gaps] == [gap.index for gap in recording.gaps]
    expected = [gap.duration for gap in recording.gaps]
    assert [gap.duration for gap in again.gaps] == pytest.approx(expected, rel=1e-6, abs=1e-5)


@pytest.mark.parametrize("ending", WRITERS)
def test_dead_channel_survives(tmp_path: Path, ending) -> None:
    samples = np.stack([np.arange(20.0), np.full(20, np.nan)])
    write(Recording(samples, 10.0, (Channel("a"), Channel("b"))), tmp_path / f"run{ending}")
    again = read(tmp_path / f"run{ending}")
    assert np.array_equal(again.samples, samples, equal_nan=True)
    assert again.gaps == ()


@pytest.mark.parametrize("name", ["t", "Time [s]", "a [g]", "1.5", "nan", " a", "a\nb", "", "a\x00"])
def test_names_that_would_not_be_read_back_are_refused(tmp_path: Path, name) -> None:
    with pytest.raises(ParameterError, match="name"):
        write(Recording(np.zeros((1, 20)), 10.0, (Channel(name),)), tmp_path / "run.csv")


@pytest.mark.slow
@pytest.mark.parametrize("ending", ENDINGS)
@RELAXED
@given(content=st.binary(min_size=0, max_size=400))
@example(content=b"PAR1" + bytes(20) + b"PAR1")
@example(content=b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999,), }\n")
@example(content=b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + b"\x0e\x00\x00\x00\xff\xff\xff\x7f" + bytes(80))
@example(content=b"\x89HDF\r\n\x1a\n" + bytes(range(200)))
@example(content=b"time,a\n0,1\n1,\xff\n")
@example(content=b"t;a\n1e308;1\n-1e308;2\n")
@example(content=b"t;a\n1e308;1\n1.1e308;2\n1.2e308;2\n")
@example(content=b"timestamp,a\n1678-01-01,1\n2261-01-01,2\n2261-01-02,3\n")
@example(content=b'time,"a\n0,1\n1,2\n')
def test_random_bytes_give_a_sentence(tmp_path: Path, ending, content) -> None:
    path = tmp_path / f"junk{ending}"
    path.write_bytes(content)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # foreign parsers warn about junk in their own words
        is_refused(path, sampling_rate=10)


@RELAXED
@given(
    text=st.lists(
        st.lists(
            st.sampled_from(
                ["time", "a", "1", "2.5", "-3", "1e9", "", "nan", "x", '"', "2024-01-01", "2024-01-02T00:00Z"]
            )
        ),
        max_size=8,
    ),
    delimiter=st.sampled_from(",;\t"),
)
def test_scrambled_tables_give_a_sentence(tmp_path: Path, text, delimiter) -> None:
    path = tmp_path / "junk.csv"
    path.write_text("\n".join(delimiter.join(row) for row in text))
    is_refused(path)


@pytest.mark.parametrize("ending", ENDINGS)
def test_empty_missing_and_folder(tmp_path: Path, ending) -> None:
    (tmp_path / f"empty{ending}").touch()
    (tmp_path / f"folder{ending}").mkdir()
    for name, message in (("empty", "is empty"), ("missing", "there is no such file"), ("folder", "is not a file")):
        with pytest.raises(FormatError, match=f"{name}{ending}.* {message}"):
            read(tmp_path / f"{name}{ending}")


@pytest.mark.parametrize(
    ("module", "package", "head"),
    [
        (mdf, "asammdf", b"MDF     "),
        (tdms, "nptdms", b"TDSm" + bytes(24)),
        (ide, "idelib", b"\x1a\x45\xdf\xa3mide"),
        (dewesoft, "dwdatareader", b"MULTI_STREAM_FILE_VER"),
        (seismic, "pymseed", b""),
    ],
)
def test_without_the_package_the_message_says_what_to_install(
    tmp_path: Path, monkeypatch, module, package, head
) -> None:
    for name in {package, *(name for name in sys.modules if name.startswith(f"{package}."))}:
        monkeypatch.setitem(sys.modules, name, None)
    path = tmp_path / f"run{module.ENDINGS[0]}"
    path.write_bytes(head)
    with pytest.raises(MissingPackageError, match=rf"reading .* pip install 'sprung\[{module.EXTRA}\]'"):
        module.groups(path, ReadSettings())


def test_unknown_format_lists_the_known_endings(tmp_path: Path) -> None:
    (tmp_path / "run.xyz").write_bytes(b"\0\1\2")
    with pytest.raises(FormatError, match=r"unknown format: files in .*\.parquet, .*\.mat, .*\.csv"):
        read(tmp_path / "run.xyz")
    with pytest.raises(ParameterError, match=r"ends in '.xyz': recordings are written as .csv, .parquet"):
        write(Recording(np.zeros((1, 3)), 1.0, (Channel("a"),)), tmp_path / "run.xyz")


@pytest.mark.parametrize("ending", ENDINGS)
def test_two_gigabytes_of_nothing_are_refused_at_once(tmp_path: Path, ending) -> None:
    path = tmp_path / f"nul{ending}"
    with path.open("wb") as file:
        file.truncate(2 << 30)
    with pytest.raises(FormatError, match=f"nul{ending}"):
        read(path)


def test_numbers_then_two_gigabytes_of_nothing(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("time,a\n" + "".join(f"{index},1\n" for index in range(100_000)))
    with path.open("r+b") as file:
        file.truncate(2 << 30)
    with pytest.raises(FormatError, match=r"run.csv, line 100002 is longer"):
        next(read_blocks(path))


@pytest.mark.slow
def test_large_table_is_read_in_bounded_memory(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    values = "".join(f",{index % 97}.5,{index % 89}.25,-{index % 83}.125\n" for index in range(100_000)).splitlines(
        True
    )
    with path.open("w") as file:
        file.write("time,a [g],b,c\n")
        for first in range(0, 4_000_000, 100_000):
            file.write("".join(f"{index / 1000:.3f}{row}" for index, row in enumerate(values, first)))
    assert path.stat().st_size > 1e8
    script = (
        "from pathlib import Path; from sprung.formats import read_blocks\n"
        f"n = sum(block.n_samples for block in read_blocks({str(path)!r}))\n"
        "status = Path('/proc/self/status').read_text()  # ru_maxrss would count the process that started this one\n"
        "print(n, status.split('VmHWM:')[1].split()[0])"
    )
    output = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout.split()
    assert int(output[0]) == 4_000_000
    assert int(output[1]) < 260_000  # 304,000 with all values


def test_importing_formats_is_light() -> None:
    script = "import sys, sprung.formats; print(any(name in sys.modules for name in ('pyarrow', 'h5py', 'scipy')))"
    output = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
    assert output.strip() == "False"


def test_every_ending_has_one_reader() -> None:
    assert len(set(ENDINGS)) == len(ENDINGS)
    assert all(ending == ending.lower() and ending.startswith(".") for ending in ENDINGS)
    assert len({module.NAME for module in FORMATS}) == len(FORMATS)
