"""A source is named by a text: each kind opens, and what is missing is named."""

import io
import threading
from pathlib import Path

import pytest

from sprung.errors import ParameterError
from sprung.online.box import Listener, SourceSettings, open_source
from sprung.vehicles import read_vehicle

START = 1_795_219_200_000_000_000


@pytest.fixture
def listener():
    return Listener(threading.Event())


@pytest.fixture
def settings(tmp_path: Path):
    def made(**fields):
        return SourceSettings(vehicle=read_vehicle("zafira"), folder=tmp_path, **fields)

    return made


@pytest.fixture
def recording(tmp_path: Path):
    path = tmp_path / "run.csv"
    path.write_text("t,a\n" + "".join(f"{k / 100},{k}\n" for k in range(300)), encoding="utf-8")
    return path


def test_files_continue_where_they_were(settings, listener, recording, tmp_path: Path) -> None:
    (tmp_path / "begun").write_text(str(START), encoding="ascii")
    blocks = list(open_source("files", settings(files=[recording]), listener))
    assert [block.start for block in blocks] == [START + k * 10**9 for k in range(3)]
    (rest,) = open_source("files", settings(files=[recording], resume=START + 2_500_000_000), listener)
    assert (rest.start, rest.n_samples) == (START + 2_500_000_000, 50)


def test_files_remember_when_they_began(settings, listener, recording) -> None:
    first, again = (next(open_source("files", settings(files=[recording]), listener)).start for _ in range(2))
    assert first == again


@pytest.mark.slow
def test_a_folder_reads_each_file_once(settings, recording, tmp_path: Path) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    recording.rename(folder / "run.csv")
    (folder / "bad.csv").write_text("a,b\n", encoding="utf-8")
    problems, names = list[str](), list[str]()

    def opened():
        stopping = threading.Event()
        listener = Listener(stopping, problems.append, names.append)
        for block in open_source(f"folder:{folder}", settings(), listener):
            stopping.set()
            yield block

    assert sum(block.n_samples for block in opened()) == 300
    assert names == ["run.csv"]
    assert [problem.partition(" was not read completely: ")[0] for problem in problems] == ["bad.csv"]
    stopped = threading.Event()
    stopped.set()
    assert list(open_source(f"folder:{folder}", settings(), Listener(stopped))) == []


def test_standard_input(settings, listener, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO("a\n1\n2\n"))
    (block,) = open_source("stdin", settings(sampling_rate=10.0), listener)
    assert block.samples.tolist() == [[1.0, 2.0]]


@pytest.mark.parametrize(
    ("text", "fields", "words"),
    [
        ("files", {}, "give files or another source"),
        ("files:x", {}, "give files or another source"),
        ("folder", {}, "write folder:DIR"),
        ("folder:nowhere", {}, "nowhere is not a folder: give the one in which files appear"),
        ("stdin", {"sampling_rate": 0.0}, "sampling_rate=0 must be above 0"),
        ("simulator", {"pace": 0.0}, "pace=0 must be above 0"),
        ("stdin", {}, "--source stdin needs --sampling-rate HZ"),
        ("can:a:b:c", {}, "--source can needs --sampling-rate HZ"),
        ("can:a:b:c", {"sampling_rate": 1.0}, "--source can needs --channels"),
        ("can:a:b", {"sampling_rate": 1.0, "channels": ["x"]}, "must be can:INTERFACE:CHANNEL:DATABASE.dbc"),
        ("mqtt:mqtt://x", {"sampling_rate": 1.0, "channels": ["x"]}, "must be mqtt:URL#TOPIC"),
        ("radio", {}, "--source 'radio' must be files, folder:DIR, stdin"),
        ("simulator:x", {}, "--source 'simulator:x' must be files"),
        ("stdin:x", {}, "--source 'stdin:x' must be files"),
    ],
)
def test_what_is_missing_is_named(settings, listener, text, fields, words) -> None:
    with pytest.raises(ParameterError, match=words):
        open_source(text, settings(**fields), listener)
