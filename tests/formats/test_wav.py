"""WAV files in every width and byte order, against SciPy; chunks of broadcasting and of notes."""

import struct
from typing import Literal

import numpy as np
import pytest
from scipy.io import wavfile

from sprung.errors import FormatError
from sprung.formats import read

SAMPLES = np.random.default_rng(21).uniform(-1, 1, (1000, 3))


def chunk(name, content, order="<", size=None):
    return (
        struct.pack(f"{order}4sI", name, len(content) if size is None else size) + content + b"\0" * (len(content) % 2)
    )


def wav(data, *, code=1, bits=16, n_channels=3, rate=500, form=b"RIFF", extra=b"", size=None, block=None):
    """Return a WAV file."""
    order = ">" if form == b"RIFX" else "<"
    frame = n_channels * bits // 8 if block is None else block
    layout = struct.pack(f"{order}HHIIHH", code, n_channels, rate, rate * frame, frame, bits)
    content = chunk(b"fmt ", layout, order) + extra + chunk(b"data", data, order, size)
    return struct.pack(f"{order}4sI4s", form, 4 + len(content), b"WAVE") + content


def broadcast(text=b"front axle", date=b"2024-05-31", time=b"10:00:00", samples=0):
    content = text.ljust(256, b"\0") + bytes(64) + date.ljust(10) + time.ljust(8) + struct.pack("<Q", samples)
    return chunk(b"bext", content.ljust(602, b"\0"))


@pytest.mark.parametrize("kind", ["u1", "i2", "i4", "f4", "f8"])
def test_every_type_of_scipy(tmp_path, kind) -> None:
    values = SAMPLES * {"u1": 127, "i2": 2**15 - 1, "i4": 2**31 - 1}.get(kind, 1) + (128 if kind == "u1" else 0)
    wavfile.write(tmp_path / "run.wav", 500, values.astype(kind))
    run = read(tmp_path / "run.wav")
    assert run.names == ("channel_1", "channel_2", "channel_3")
    assert run.sampling_rate == 500
    _, raw = wavfile.read(tmp_path / "run.wav")
    expected = {"u1": (raw - 128.0) / 128, "i2": raw / 2.0**15, "i4": raw / 2.0**31}.get(kind, raw)
    assert np.array_equal(run.samples, expected.T)
    assert "channel_1: unit 'full scale' is unknown, values as in the file" in run.history


@pytest.mark.parametrize("form", [b"RIFF", b"RIFX"])
@pytest.mark.parametrize("width", [2, 3, 4])
def test_widths_and_byte_orders(tmp_path, form, width) -> None:
    numbers = np.round(SAMPLES * 2 ** (8 * width - 1)).astype(np.int64)
    order: Literal["big", "little"] = "big" if form == b"RIFX" else "little"
    data = b"".join(int(number).to_bytes(width, order, signed=True) for number in numbers.ravel())
    (tmp_path / "run.wav").write_bytes(wav(data, bits=8 * width, form=form))
    assert np.array_equal(read(tmp_path / "run.wav").samples, numbers.T / 2.0 ** (8 * width - 1))


@pytest.mark.parametrize("form", [b"RF64", b"BW64"])
def test_sizes_of_64_bits_and_extensible_layouts(tmp_path, form) -> None:
    data = SAMPLES.astype("<f4").tobytes()
    layout = struct.pack("<HHIIHHHHIH", 0xFFFE, 3, 500, 6000, 12, 32, 22, 32, 7, 3) + bytes(14)
    sizes = chunk(b"ds64", struct.pack("<QQQI", 0, len(data), 1000, 0))
    content = sizes + chunk(b"fmt ", layout) + chunk(b"data", data, size=0xFFFFFFFF)
    (tmp_path / "run.bin").write_bytes(form + b"\xff\xff\xff\xffWAVE" + content)
    assert np.array_equal(read(tmp_path / "run.bin").samples, SAMPLES.astype("<f4").T)


def test_a_stream_of_unknown_length_is_read_to_its_end(tmp_path) -> None:
    data = (SAMPLES * 2**15).astype("<i2")
    (tmp_path / "run.wav").write_bytes(wav(data.tobytes(), size=0xFFFFFFFF))
    assert np.array_equal(read(tmp_path / "run.wav").samples, data.T / 2.0**15)


@pytest.mark.parametrize(
    ("samples", "start"),
    [
        (0, "2024-05-31T10:00:00"),
        (500 * 36_000 + 125, "2024-05-31T10:00:00.25"),
        (500 * 50_000, "2024-05-31T10:00:00"),
    ],
)
def test_start_and_comments(tmp_path, samples, start) -> None:
    notes = b"INFO" + chunk(b"ICMT", b"wet road\0") + chunk(b"ISFT", b"recorder 1") + chunk(b"INAM", "Bäche".encode())
    content = wav((SAMPLES * 2**15).astype("<i2").tobytes(), extra=broadcast(samples=samples) + chunk(b"LIST", notes))
    (tmp_path / "run.wav").write_bytes(content)
    run = read(tmp_path / "run.wav")
    assert run.start == np.datetime64(start, "ns").astype(int)
    assert run.comment == "front axle; wet road; Bäche; start in local time"


@pytest.mark.parametrize("date", [b"2024-13-31", b"          ", b"31.05.2024"])
def test_dates_that_are_none(tmp_path, date) -> None:
    (tmp_path / "run.wav").write_bytes(wav(bytes(600), extra=broadcast(date=date)))
    run = read(tmp_path / "run.wav")
    assert (run.start, run.comment) == (None, "front axle")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (wav(bytes(600))[:-10], "declares 100 samples, but holds 98: the file is incomplete"),
        (wav(bytes(600), size=0x7FFFFFFF), "declares 357913941 samples, but holds 100"),
        (wav(bytes(600), code=17, bits=4), "samples of 4 bits in the format 0x0011: convert them to PCM"),
        (wav(bytes(600), code=85), "in the format 0x0055"),
        (wav(bytes(600), rate=0), "states 0 Hz"),
        (wav(bytes(600), n_channels=0), "convert them to PCM"),
        (wav(bytes(600), block=7), "states 500 Hz and 3 channels in 7 bytes"),
        (wav(bytes(600))[:40], "no complete chunk 'data'"),
        (wav(bytes(600))[:20], "no complete chunk 'fmt'"),
    ],
)
def test_damaged_and_compressed_files(tmp_path, content, words) -> None:
    (tmp_path / "run.wav").write_bytes(content)
    with pytest.raises(FormatError, match=f"run.wav .*{words}"):
        read(tmp_path / "run.wav")
