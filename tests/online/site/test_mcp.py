"""Questions of a depot, answered from evidence by the tools of `sprung mcp`."""

import asyncio
import json
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from typing import Any

import pytest

from sprung.cli import main
from sprung.errors import DataError

pytest.importorskip("mcp", reason="needs the extra mcp")
from mcp.client.client import Client
from tests.online.site.conftest import raise_alert

from sprung.online.commands.mcp import fetched, server


@pytest.fixture
def ask(serve, tmp_path):
    """Function of a tool and its arguments that returns its text, and whether it is an error."""
    context, client = serve(advice=("inspect bus-2 next",))
    seen = {"change": -0.1, "interval": [-0.14, -0.06], "detectable": {"rear_left.damper": 0.08}}
    raise_alert(context.store, "bus-1", "rear_left.damper", 300, evidence=seen)
    drives = tmp_path / "drives"
    drives.mkdir()
    (drives / "notes.txt").write_text("no numbers")
    (drives / "drive.csv").write_text("time [s],acc [m/s^2]\n" + "".join(f"{k / 100},{k % 7}\n" for k in range(500)))

    def get(path):
        answer = client.get(f"/api/v1{path}")
        if answer.status_code != 200:
            raise DataError(answer.text)
        return answer.json()

    tools = server(get, files=drives)

    def asked(tool, **arguments):
        async def call():
            async with Client(tools) as opened:
                return await opened.call_tool(tool, arguments)

        found = asyncio.run(call())
        return found.content[0].text, found.is_error

    return asked


QUESTIONS: tuple[Any, ...] = (
    ("How many vehicles are silent?", "fleet", {}, ("counts", "silent"), 1),
    ("Which vehicle comes first?", "fleet", {}, ("page", "vehicles", 0, "vehicle"), "bus-1"),
    ("Has bus-3 got an alert?", "alerts", {"vehicle": "bus-3"}, ("alerts", "alerts"), []),
    (
        "What is wrong with bus-1?",
        "alerts",
        {"vehicle": "bus-1"},
        ("alerts", "alerts", 0, "cause"),
        "front_left.spring",
    ),
    ("Are there alerts after the last one?", "alerts", {"cursor": "0~0~0"}, ("alerts", "alerts"), []),
    ("By how much has it changed?", "evidence", {"alert": 1}, ("evidence", "change"), -0.2),
    ("How sure is that?", "evidence", {"alert": 1}, ("evidence", "interval"), [-0.22, -0.18]),
    ("How many windows of bus-1 are there?", "vehicle", {"name": "bus-1"}, ("vehicle", "windows"), 5),
    ("What would have been found?", "evidence", {"alert": 3}, ("evidence", "detectable"), {"rear_left.damper": 0.08}),
    ("And is that known of bus-3?", "vehicle", {"name": "bus-3"}, ("baseline", "detectable"), {}),
    ("What is to be inspected?", "report", {"alert": 1}, ("work_order", "vehicle"), "bus-1"),
    ("Which vehicle is to be inspected next?", "advice", {}, ("advice", "sentences"), ["inspect bus-2 next"]),
    ("Which recordings are there?", "recordings", {}, ("files",), ["drive.csv", "notes.txt"]),
    ("What is in this file?", "read", {"file": "drive.csv"}, ("files", 0, "channels", 0, "name"), "acc"),
)


@pytest.mark.slow
@pytest.mark.parametrize("question", QUESTIONS, ids=[question[0] for question in QUESTIONS])
def test_a_question_is_answered_from_evidence(ask, question) -> None:
    _, tool, arguments, place, answer = question
    text, is_error = ask(tool, **arguments)
    assert not is_error, text
    found = json.loads(text)
    for step in place:
        found = found[step]
    assert found == answer


@pytest.mark.slow
def test_what_is_unknown_is_an_error_and_no_guess(ask) -> None:
    asked: tuple[tuple[str, dict[str, Any], str], ...] = (
        ("vehicle", {"name": "nobody"}, "unknown vehicle 'nobody'"),
        ("alerts", {"vehicle": "nobody"}, "unknown vehicle 'nobody'"),
        ("evidence", {"alert": 77}, "unknown alert 77"),
        ("read", {"file": "../store.sqlite"}, "no file in the folder"),
        ("read", {"file": "notes.txt"}, "notes.txt holds no samples"),
        ("identify", {"file": "notes.txt"}, "notes.txt holds no samples"),
    )
    for tool, arguments, said in asked:
        text, is_error = ask(tool, **arguments)
        assert is_error, (tool, text)
        assert said in text


class _Words(BaseHTTPRequestHandler):
    """Some page that is no interface of a monitor."""

    def do_GET(self):
        self.send_response(200)
        self.end_headers()
        self.wfile.write(b"<p>A page.</p>")

    def log_message(self, *_):
        pass


def test_an_address_that_is_no_monitor_is_named() -> None:
    with ThreadingHTTPServer(("127.0.0.1", 0), _Words) as other:
        Thread(target=other.serve_forever, daemon=True).start()
        addresses = (f"http://127.0.0.1:{other.server_port}", "http://127.0.0.1:1", "depot", "http://a depot")
        for address in addresses:
            with pytest.raises(DataError, match=f"{address} does not answer as a monitor: .*: check --url"):
                fetched(address, "/counts")
        other.shutdown()


def test_a_folder_that_is_absent_is_refused_at_once(tmp_path, capsys) -> None:
    assert main(["mcp", "--files", str(tmp_path / "nowhere")]) == 2
    assert "nowhere is no folder" in capsys.readouterr().err


def test_every_tool_reads_only(serve) -> None:
    async def listed():
        async with Client(server(lambda _: {})) as opened:
            return (await opened.list_tools()).tools

    tools = asyncio.run(listed())
    assert {"fleet", "vehicle", "alerts", "evidence", "trends", "report"} <= {tool.name for tool in tools}
    assert all(tool.annotations.read_only_hint and tool.description for tool in tools)
