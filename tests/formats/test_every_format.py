"""What holds for every format: write then read, and hostile files."""

import subprocess
import sys
import warnings
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, example, given, settings
from hypothesis import strategies as st

from sprung.errors import FormatError, MissingPackageError, ParameterError, SprungError
from sprung.formats import (
    ENDINGS,
    FORMATS,
    WRITERS,
    ReadSettings,
    dewesoft,
    ide,
    mdf,
    read,
    read_blocks,
    seismic,
    tdms,
    write,
)
from sprung.recording import QUANTITIES, Channel, Gap, Recording

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
def test_ordinary_names_are_written(tmp_path: Path, ending) -> None:
    channels = tuple(Channel(name, "acceleration") for name in ("acc_fl", "Beschleunigung vorn", "a-1", "INC.2 (raw)"))
    recording = Recording(np.random.default_rng(6).standard_normal((4, 30)), 104.36, channels)
    write(recording, tmp_path / f"run{ending}")
    again = read(tmp_path / f"run{ending}")
    assert again.names == recording.names
    assert again.sampling_rate == pytest.approx(104.36, rel=1e-9)


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
        refuse_or_read(path)


def refuse_or_read(path):
    message = path.name
    try:
        read(path, sampling_rate=10)
    except SprungError as error:
        message = str(error)
    assert "\n" not in message
    assert path.name in message


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
    refuse_or_read(path)


@pytest.mark.parametrize("ending", WRITERS)
@pytest.mark.parametrize("share", [0.1, 0.5, 0.9, 0.999])
def test_truncated_files_give_a_sentence(tmp_path: Path, ending, share) -> None:
    path = tmp_path / f"run{ending}"
    write(Recording(np.random.default_rng(7).standard_normal((3, 2000)), 100.0, tuple(map(Channel, "abc"))), path)
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    if ending != ".csv":
        with pytest.raises(FormatError, match=f"run{ending} cannot be read"):
            read(path)
    else:
        refuse_or_read(path)


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
        for first in range(0, 10_000_000, 100_000):
            file.write("".join(f"{index / 1000:.3f}{row}" for index, row in enumerate(values, first)))
    assert path.stat().st_size > 2.5e8
    script = (
        "from pathlib import Path; from sprung.formats import read_blocks\n"
        f"n = sum(block.n_samples for block in read_blocks({str(path)!r}))\n"
        "status = Path('/proc/self/status').read_text()  # ru_maxrss would count the process that started this one\n"
        "print(n, status.split('VmHWM:')[1].split()[0])"
    )
    output = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout.split()
    assert int(output[0]) == 10_000_000
    assert int(output[1]) < 400_000


def test_importing_formats_is_light() -> None:
    script = "import sys, sprung.formats; print(any(name in sys.modules for name in ('pyarrow', 'h5py', 'scipy')))"
    output = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
    assert output.strip() == "False"


def test_every_ending_has_one_reader() -> None:
    assert len(set(ENDINGS)) == len(ENDINGS)
    assert all(ending == ending.lower() and ending.startswith(".") for ending in ENDINGS)
    assert len({module.NAME for module in FORMATS}) == len(FORMATS)
