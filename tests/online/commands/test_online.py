"""What a person at a terminal does with the monitor's store; and the monitor's own bad usage."""

import getpass
import json
import re
import threading
import time
from dataclasses import replace
from datetime import UTC, datetime
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import pytest

from sprung.online.alerts import AlertSettings, Report, reported
from sprung.online.monitor import Site
from sprung.online.store import Progress, StoredFrame, open_store

NOW = 1_795_219_200_000_000_000


@pytest.fixture
def store(tmp_path):
    url = f"sqlite:///{tmp_path}/store.sqlite"
    with open_store(url) as opened:
        opened.inbox.put_vehicle("bus-17", configuration="c", description="", channels=[], now=NOW)
        report = Report("bus-17", "front_left.spring", 700, "front-left spring 25 % softer")
        alert = reported(None, report, AlertSettings(), NOW).alert
        opened.alerts.put(alert, history=("raised", "", ""), notify={}, now=NOW)
    return url


def test_a_verdict_with_a_new_baseline_closes_an_alert(sprung, store):
    words = ("--verdict", "confirmed", "--action", "spring renewed", "--new-baseline", "--who", "anna")
    (listed,) = sprung("alerts", "verdict", "1", "--store", store, *words, "--json", "-").document()["alerts"]
    assert listed["state"] == "normal"
    with open_store(store) as opened:
        (verdict,) = opened.verdicts.all()
        (command,) = opened.requests.open_commands()
    assert (verdict.verdict, verdict.action, verdict.who) == ("confirmed", "spring renewed", "anna")
    assert (command.act, command.vehicle, command.detail) == ("learn", "bus-17", "spring renewed")


def test_an_alert_of_another_part_is_closed_in_two_acts(sprung, store):
    words = ("--verdict", "another part", "--part", "bushing", "--who", "anna")
    (listed,) = sprung("alerts", "verdict", "1", "--store", store, *words, "--json", "-").document()["alerts"]
    assert listed["state"] == "acknowledged"
    closed = ("alerts", "close", "1", "--store", store, "--who", "anna", "--comment", "bushing renewed", "--json", "-")
    (listed,) = sprung(*closed).document()["alerts"]
    assert listed["state"] == "normal"
    assert "is not active" in sprung("alerts", "close", "1", "--store", store).err
    assert (
        "verdict 'broken' is unknown" in sprung("alerts", "verdict", "1", "--store", store, "--verdict", "broken").err
    )


def test_an_alert_from_raised_to_shelved(sprung, store, monkeypatch):
    monkeypatch.setenv("COLUMNS", "160")
    (listed,) = sprung("alerts", "--store", store, "--json", "-").document()["alerts"]
    assert (listed["vehicle"], listed["state"], listed["severity"]) == ("bus-17", "unacknowledged", 700)
    by_anna = ("--store", store, "--who", "anna")
    assert sprung("alerts", "ack", "1", *by_anna, "--comment", "seen").code == 0
    assert sprung("alerts", "assign", "1", *by_anna, "--to", "bert").code == 0
    assert sprung("alerts", "shelve", "1", *by_anna, "--hours", "2").code == 0
    (listed,) = sprung("alerts", "--store", store, "--json", "-").document()["alerts"]
    assert (listed["state"], listed["assignee"]) == ("shelved", "bert")
    history = sprung("alerts", "history", "1", "--store", store, "--json", "-").document()["history"]
    assert [(entry["what"], entry["who"], entry["comment"], entry["assignee"]) for entry in history[1:]] == [
        ("acknowledged", "anna", "seen", None),
        ("assigned", "anna", "", "bert"),
        ("shelved", "anna", "", "bert"),
    ]
    assert history[3]["shelved_until"] == history[3]["time"] + 2 * 3600 * 10**9 == listed["shelved_until"]
    until = f"shelved until {datetime.fromtimestamp(listed['shelved_until'] // 10**9, UTC):%Y-%m-%d %H:%M} UTC"
    assert all(until in plain(sprung("alerts", *words, "--store", store)) for words in ((), ("history", "1")))
    assert sprung("alerts", "assign", "1", "--store", store).code == 0
    assert "assigned to nobody" in plain(sprung("alerts", "history", "1", "--store", store))
    with open_store(store) as opened:
        assert opened.requests.audited()[-1].who == getpass.getuser()


def test_what_was_quarantined_is_listed_and_analysed_again(sprung, store, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    assert "nothing is quarantined" in sprung("vehicles", "quarantine", "--store", store).out
    with open_store(store) as opened:
        opened.inbox.add_frames([StoredFrame("bus-17", 3, seq, NOW, b"x") for seq in range(2)], now=NOW)
        opened.quarantine.put_frames("bus-17", 3, 0, 1, reason="it fails", now=NOW)
    listed = sprung("vehicles", "quarantine", "bus-17", "--store", store).out
    assert all(words in listed for words in ("bus-17", "frames 0 to 1 of boot 3", "it fails"))
    again = sprung("vehicles", "quarantine", "--again", "--store", store)
    assert (again.code, "by this version" in again.out) == (2, False)
    assert "the vehicle file of bus-17" in again.err
    (entry,) = sprung("vehicles", "quarantine", "--store", store, "--json", "-").document()["quarantined"]
    assert (entry["first"], entry["last"], entry["again"]) == (0, 1, None)
    refused = sprung("vehicles", "quarantine", "car-7", "--store", store)
    assert (refused.code, "unknown vehicle 'car-7'" in refused.err) == (2, True)


def test_vehicles_and_learning_again(sprung, store):
    (one,) = sprung("vehicles", "--store", store, "--json", "-").document()["vehicles"]
    assert (one["vehicle"], one["windows"], one["baseline"], one["health_index"]) == ("bus-17", 0, None, None)
    assert "bus-17" in sprung("vehicles", "--store", store).out
    words = ("vehicles", "learn", "bus-17", "--store", store, "--reason", "new springs", "--who", "anna")
    asked = sprung(*words)
    assert asked.code == 0
    assert "bus-17 will relearn its baseline ('new springs') from its next usable windows" in plain(asked)
    with open_store(store) as opened:
        (command,) = opened.requests.open_commands()
    assert (command.vehicle, command.act, command.detail, command.who) == ("bus-17", "learn", "new springs", "anna")
    assert "bus-17: new baseline ('new springs') requested at" in plain(sprung("vehicles", "--store", store))


def test_what_an_inspection_found_is_stated_without_an_alert(sprung, store):
    words = ("vehicles", "inspected", "bus-17", "--store", store, "--who", "anna", "--found")
    assert "bus-17: nothing was found; rank the vehicles again" in plain(sprung(*words, "nothing"))
    assert "bus-17: front_left.spring was found" in plain(sprung(*words, "front_left.spring"))
    assert sprung(*words, "spring").code == 2
    with open_store(store) as opened:
        first, last = opened.requests.audited(act="inspected")
    assert [(row.subject, row.who, row.detail) for row in (first, last)] == [
        ("bus-17", "anna", ""),
        ("bus-17", "anna", "front_left.spring"),
    ]


def test_a_slip_of_a_part_is_not_what_an_inspection_found(sprung, store):
    words = ("vehicles", "inspected", "bus-17", "--store", store, "--who", "anna", "--found")
    refused = sprung(*words, "front_left.sprin")
    assert refused.code == 2
    assert "front_left.sprin is not known: write front_left.spring" in refused.err
    for part in (
        "front_left.top_mount",
        "front_left.strut",
        "bogie1.yaw_damper",
        "bogie1_front_left.primary_lateral_spring",
    ):
        assert sprung(*words, part).code == 0, part
    assert "bus-17: nothing was found" in plain(sprung(*words, "none"))


@pytest.mark.parametrize("words", [("alerts",), ("alerts", "list"), ("vehicles",), ("vehicles", "list")])
def test_a_command_alone_lists(sprung, store, words):
    assert (
        sprung(*words, "--store", store, "--json", "-").document()
        == sprung(words[0], "--store", store, "--json", "-").document()
    )


@pytest.mark.parametrize(
    "words", [("alerts",), ("alerts", "shelve"), ("vehicles", "raw"), ("box",), ("monitor",), ("info",)], ids=" ".join
)
def test_help_shows_no_types_of_flags(sprung, words):
    shown = sprung(*words, "--help")
    assert shown.code == 0
    assert "<bool>" not in shown.out
    assert "[[" not in shown.out


def test_defaults_in_the_help_of_the_monitor_are_those_of_the_site_file(sprung, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    shown = sprung("monitor", "--help").out
    for name in ("broker", "store", "http"):
        assert f"[default: ({Site.model_fields[name].default})]" in shown


def plain(outcome):
    """Standard output without the breaks of its lines."""
    return " ".join(outcome.out.split())


def test_samples_that_are_asked_for_and_not_waited_for(sprung, store):
    words = ("vehicles", "raw", "bus-17", "--store", store, "--minutes", "5", "--who", "anna", "--wait", "0")
    asked = sprung(*words)
    assert asked.code == 0
    with open_store(store) as opened:
        (command,) = opened.requests.open_commands()
    assert command.detail["to"] - command.detail["from"] == 300 * 10**9
    assert (command.act, command.who) == ("raw", "anna")
    for shown in (asked, sprung("vehicles", "--store", store)):
        assert "bus-17: samples 20" in plain(shown)
        assert "not yet done" in plain(shown)


@pytest.fixture
def answered(store):
    """Return a function that lets a monitor end the next request with an answer; it is stopped in the end."""
    threads = []

    def answer(detail):
        def run():
            with open_store(store) as opened:
                end = time.monotonic() + 30.0
                while not (asked := opened.requests.open_commands()) and time.monotonic() < end:
                    time.sleep(0.02)
                opened.requests.command_done(asked[0].id, NOW, detail={"asked": asked[0].detail, **detail})

        threads.append(threading.Thread(target=run))
        threads[-1].start()

    yield answer
    for thread in threads:
        thread.join(30.0)


RAW = ("vehicles", "raw", "bus-17")


def test_samples_that_came_are_said(sprung, store, answered):
    answered({"boot": 1, "last": 599, "frames": 600, "from": NOW, "to": NOW + 600 * 10**9, "reason": ""})
    asked = sprung(*RAW, "--store", store, "--wait", "30")
    assert asked.code == 0
    assert "received samples 2026-11-21 00:00 to 00:10 UTC of bus-17, 600 frames" in plain(asked)


def test_a_box_that_has_no_such_samples_is_heard(sprung, store, answered):
    answered({"boot": 1, "last": -1, "frames": 0, "from": 0, "to": 0, "reason": "the box holds none"})
    asked = sprung(*RAW, "--store", store, "--wait", "30")
    assert asked.code == 3
    assert "of bus-17: the box holds none" in asked.err


def test_samples_that_do_not_come_are_said_with_what_to_do(sprung, store):
    asked = sprung(*RAW, "--store", store, "--wait", "0.3")
    assert asked.code == 3
    assert "of bus-17 within 0.3 s (last seen at 2026-11-21 00:00 UTC)" in asked.err
    assert "the request stays open and is sent again when the vehicle is next seen" in asked.err
    with open_store(store) as opened:
        assert len(opened.requests.open_commands()) == 1


def test_a_vehicle_that_identifies_on_board_is_shown(sprung, store):
    with open_store(store) as opened:
        opened.inbox.put_vehicle("bus-17", configuration="c", description="", channels=[], now=time.time_ns())
        opened.inbox.add_frames([StoredFrame("bus-17", 1, 0, NOW, b"x")], now=NOW)
        modes = ((0, NOW, {"modes": [{"natural_frequency": 1.5}], "reason": "", "is_on_board": True}),)
        opened.results.commit(Progress("bus-17", 1, done_seq=0, delete_through_seq=0, modes=modes))
        row = opened.alerts.find()[0]
        opened.alerts.put(replace(row, is_active=False), history=("cleared", "", ""), now=NOW)
    (one,) = sprung("vehicles", "--store", store, "--json", "-").document()["vehicles"]
    assert one["summary"] == "Identifies on board: 1 window of modes."
    assert one["modes"] == [{"natural_frequency": 1.5}]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("alerts", "--store", "sqlite:///nowhere.sqlite"), "no store at sqlite:///nowhere.sqlite: pass"),
        (("alerts", "ack"), "Missing argument 'NUMBER'"),
        (("alerts", "ack", "9"), "unknown alert 9"),
        (("alerts", "forget", "1"), "No such command 'forget'"),
        (("alerts", "ack", "1", "--hours", "2"), "No such option"),
        (("alerts", "shelve", "1", "--to", "anna"), "No such option"),
        (("alerts", "--all", "ack", "1"), "--all must follow the sub-command"),
        (("alerts", "unshelve", "1"), "is not shelved"),
        (("vehicles", "learn", "bus-17"), "needs a reason: give --reason TEXT"),
        (("vehicles", "learn", "bus-18", "--reason", "x"), "unknown vehicle 'bus-18'"),
        (("vehicles", "rollback", "bus-17", "--reason", "x"), "give --version N, the baseline to return to"),
        (("vehicles", "rollback", "bus-17", "--version", "1"), "needs a reason"),
        (("vehicles", "rollback", "bus-17", "--version", "1", "--reason", "x"), "has no baseline 1: it has none"),
        (("vehicles", "forget", "bus-17"), "No such command 'forget'"),
    ],
)
def test_what_cannot_be_done_is_said(sprung, store, words, sentence):
    given = words if "--store" in words or "--all" in words else (*words, "--store", store)
    found = sprung(*given)
    assert found.code == 2
    assert sentence in found.err


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("monitor", "--site", "none.toml"), "give the site file"),
        (("monitor", "--broker", "http://x"), "not the address of a broker"),
        (("monitor", "--log", "xml"), "--log 'xml' is not one of json, text"),
        (("replay", "none.csv", "--vehicle-id", "a/b", "--vehicle", "zafira"), "not a valid name"),
        (
            ("replay", "drive.csv", "--vehicle-id", "a", "--vehicle", "zafira", "--broker", "mqtt://127.0.0.1:1"),
            "cannot be reached (connection refused)",
        ),
        (("replay", "none.csv", "--vehicle-id", "a", "--vehicle", "zafira"), "none.csv"),
        (("replay", "drive.csv", "--vehicle-id", "a", "--vehicle", "zafira", "--start", "noon"), "is not a time"),
        (("box", "--vehicle-id", "a", "--vehicle", "zafira"), "give files or another source"),
        (("box", "--vehicle-id", "monitor", "--vehicle", "zafira"), "vehicle 'monitor' has the name of a user"),
        (("monitor", "--store", "sqlite:///run.csv", "--broker", "mqtt://127.0.0.1:1"), "is not a store but another"),
        (("monitor", "--http", "127.0.0.1", "--broker", "mqtt://127.0.0.1:1"), "write HOST:PORT"),
        (("box", "--vehicle-id", "a", "--vehicle", "zafira", "--source", "can:x:y:z"), "needs --sampling-rate"),
    ],
)
def test_bad_usage(sprung, words, sentence, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "run.csv").write_text("t,a\n0,1\n", encoding="utf-8")
    rows = "".join(f"{k / 100},{k % 7}\n" for k in range(300))
    (tmp_path / "drive.csv").write_text(f"t,acc_fl\n{rows}", encoding="utf-8")
    found = sprung(*words)
    assert found.code == 2, found
    assert (tmp_path / "run.csv").read_text(encoding="utf-8").startswith("t,a")
    assert sentence in found.err
    assert found.err.count("\n") <= 3


def test_a_site_file_that_is_wrong_is_named_with_its_field(sprung, tmp_path):
    path = tmp_path / "site.toml"
    path.write_text('schema = "sprung.site/1"\n[watch]\nworkers = 0\n', encoding="utf-8")
    found = sprung("monitor", "--site", path)
    assert found.code == 2
    assert found.err == f"sprung: {path}: watch, workers=0 must be at least 1: correct it (see docs/monitor.md)\n"


def fields(value):
    """All names in a document, but those of modes, which are many kinds."""
    if isinstance(value, list):
        return set().union(*map(fields, value))
    if not isinstance(value, dict):
        return set()
    return set(value).union(*(fields(one) for name, one in value.items() if name != "modes"))


@pytest.mark.parametrize("words", [("alerts",), ("alerts", "history", "1"), ("vehicles",)], ids=" ".join)
def test_every_field_is_documented_with_an_example(sprung, store, words):
    document = sprung(*words, "--store", store, "--json", "-").document()
    text = (Path(__file__).parents[3] / "docs" / "json.md").read_text(encoding="utf-8")
    section = text.split(f": `{document['schema']}`\n")[1].split("\n## ")[0]
    example = json.loads(section.split("```json\n")[1].split("```")[0])
    assert fields(example) == fields(document)
    named = re.findall(r"`(?:\w+\[\]\.)?(\w+)`", " ".join(re.findall(r"^\| (`[^|]*) \|", section, re.MULTILINE)))
    assert fields(document) - {"schema", "alerts", "history", "vehicles"} == set(named)


def test_a_fleet_of_the_monitor_is_ranked(sprung, store):
    assert sprung("vehicles", "rank", "--store", store, "--json", "-").document()["types"] == []
    assert "no vehicles yet" in sprung("vehicles", "rank", "--store", store).out
    refused = sprung("vehicles", "rank", "--store", store, "--rate", "2")
    assert refused.code == 2
    assert "rate" in refused.err


def test_senders_are_tested_without_a_monitor(sprung, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    got = []

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self):
            got.append(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
            self.send_response(204)
            self.end_headers()

        def log_message(self, *_):
            """Be silent."""

    server = HTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, args=(0.01,))
    thread.start()
    try:
        path = tmp_path / "site.toml"
        hook = f'[[send.webhook]]\nurl = "http://127.0.0.1:{server.server_port}/x"\n'
        path.write_text(hook, encoding="utf-8")
        sound = sprung("monitor", "--site", path, "--test-senders")
        mail = '[[send.mail]]\nhost = "127.0.0.1"\nport = 1\nsender = "a@example.org"\nrecipients = ["b@example.org"]\n'
        path.write_text(hook + mail, encoding="utf-8")
        failing = sprung("monitor", "--site", path, "--test-senders")
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
    assert (sound.code, sound.out.strip()) == (0, "- webhook 1: sent")
    assert failing.code == 1
    assert "- webhook 1: sent" in failing.out
    assert "- mail 1: failed: mail server 127.0.0.1:1 cannot be reached (Connection refused): check" in " ".join(
        failing.out.split()
    )
    assert [message["subject"] for message in got] == ["Sprung: test message, no alert"] * 2
    assert list(tmp_path.iterdir()) == [path]
    none = sprung("monitor", "--test-senders")
    assert none.code == 2
    assert "the site file has no sender" in none.err
