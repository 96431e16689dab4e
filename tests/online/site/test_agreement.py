"""Page, report, mail, command, interface and export say the same of a vehicle, whatever its state."""

import csv
import html
import io
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.diagnosis.conftest import drawn_window
from tests.online.site.conftest import HOUR, NOW

from sprung.diagnosis import SensorFault, diagnose, learn
from sprung.online.alerts import AlertSettings, MailSender, Transition, addressed, message_of
from sprung.online.monitor import Observed
from sprung.online.monitor.alert_book import AlertBook
from sprung.online.monitor.exports import export, report_document
from sprung.online.monitor.histories import read_history
from sprung.online.monitor.ledger import window_document
from sprung.online.store import Progress, StoredFrame
from sprung.recording import Channel, Recording
from sprung.results.documents import (
    baseline_document,
    baseline_from_document,
    finding_document,
    observation_from_document,
)
from sprung.results.tables import describe_diagnosis, vehicles_table
from sprung.results.tables.wording import Period

PARTS = [f"{corner}.{kind}" for corner in ("front_left", "rear_right") for kind in ("spring", "damper", "tyre")]
TAUGHT = 12
#: Change that no part explains, and that is within the error of the vehicle file under another load.
LOADED = {
    f"{end}_{side}.{kind}": size
    for end, size in (("front", 0.04), ("rear", -0.04))
    for side in ("left", "right")
    for kind in ("spring", "damper", "tyre")
}
MAIL = MailSender("localhost", sender="sprung@example.org", recipients=["anna@example.org"])
#: Name of each vehicle with its verdict, and what makes it so.
VEHICLES: list[tuple[str, str, dict[str, Any]]] = (
    [(f"changed-{k}", "change", {"change": {part: -0.15 - 0.05 * k}}) for k, part in enumerate(PARTS)]
    + [("growing", "change", {"change": {"front_left.spring": -0.03}, "n_windows": 16, "grows": True})]
    + [(f"healthy-{k}", "no_change_detected", {"n_windows": 12 + 3 * k}) for k in range(5)]
    + [(f"few-{count}", "no_change_detected", {"n_windows": count}) for count in (1, 2, 5)]
    + [("none", "inconclusive", {"n_windows": 0})]
    + [
        ("stood", "inconclusive", {"n_windows": 12, "status": {"note": "the vehicle stood still"}}),
        ("learning", "learning", {"n_windows": 0, "status": {"is_learning": True, "n_learnt": 3}}),
        ("waiting", "waiting", {"n_windows": None}),
        ("silent", "stale", {"n_windows": 12, "age": 5 * HOUR}),
        ("parked", "stale", {"n_windows": 12, "age": 48 * HOUR}),
        ("parked today", "no_change_detected", {"n_windows": 12, "age": 20 * HOUR}),
        ("uneven", "change", {"run_outs": {"front_left": (2e-4, 1e-5)}}),
        ("loaded", "inconclusive", {"n_windows": 30, "change": LOADED, "model_error": 0.08}),
        ("sensor", "fault", {"n_windows": 12, "fault": SensorFault("acc_fl", "dead", "it is constant")}),
    ]
)


def fill(
    store,
    name,
    *,
    n_windows=12,
    change=None,
    grows=False,
    model_error=0.0,
    run_outs=None,
    status=None,
    age=0,
    fault=None,
):
    """Store a vehicle as its monitor would."""
    seen = NOW - age
    store.inbox.put_vehicle(name, configuration="c", description="", channels=[["acc_fl", "m/s^2"]], now=seen)
    store.inbox.add_frames([StoredFrame(name, 1, 0, seen, b"x")], now=seen)
    store.inbox.park(name, is_parked=name.startswith("parked"))
    if n_windows is None:
        return
    generator = np.random.default_rng(sum(name.encode()))
    begin = seen // 10**9 - 600 * (TAUGHT + n_windows)
    taught = [drawn_window(generator, begin + 600.0 * k) for k in range(TAUGHT)]
    sizes = [{part: size * (k if grows else 1) for part, size in (change or {}).items()} for k in range(n_windows)]
    after = [drawn_window(generator, begin + 600.0 * (TAUGHT + k), one) for k, one in enumerate(sizes)]
    taught, after = (
        [replace(one, conditions=one.conditions | {"model_error": model_error}) for one in each]
        for each in (taught, after)
    )
    after = [replace(one, run_outs=run_outs or {}) for one in after]
    baseline = learn(taught)
    progress = {"share": 0.0, "n_learnt": TAUGHT, "n_needed": TAUGHT, "window": 600.0, "until": seen}
    diagnosis = diagnose(after, baseline) if after else None
    findings = () if diagnosis is None else diagnosis.findings
    store.results.commit(
        Progress(
            name,
            1,
            done_seq=0,
            observations=tuple(
                (k, round(1e9 * window.time), window_document(window, diagnosis if k >= TAUGHT else None))
                for k, window in enumerate(taught + after)
            ),
            findings=tuple((TAUGHT, seen, finding_document(finding)) for finding in findings),
            baselines=((1, seen, "first learning", baseline_document(baseline).as_json()),),
            status=progress | (status or {}),
            now=seen,
        )
    )
    book = AlertBook(store, AlertSettings(raise_after=1))
    if findings:
        book.take_window(name, _observed(after[-1], diagnosis), now=seen)
    if fault is not None:
        faulty = drawn_window(generator, begin + 600.0 * (TAUGHT + n_windows))
        faulty = type(faulty)(faulty.time, (), np.zeros(0), np.zeros((0, 0)), {}, {}, (fault,), "acc_fl is dead")
        book.take_window(name, _observed(faulty, None), now=seen)


def _observed(window, diagnosis):
    recording = Recording(np.zeros((1, 8)), 8.0, (Channel("acc_fl", "acceleration"),))
    return Observed(0, recording, window, diagnosis, None)


@pytest.fixture
def fleet(serve):
    context, client = serve()
    for name, _, fields in VEHICLES:
        fill(context.store, name, **fields)
    return context.store, client


@pytest.mark.slow
def test_all_renderings_of_twenty_vehicles_agree(fleet, sqlite_url, sprung, monkeypatch) -> None:
    store, client = fleet
    monkeypatch.setattr("time.time_ns", lambda: NOW)
    assert len(VEHICLES) >= 20
    document = sprung("vehicles", "--store", sqlite_url, "--json", "-").document()
    commands = {entry["vehicle"]: entry for entry in document["vehicles"]}
    printed = {row[0]: row[-1] for row in vehicles_table(document, now=NOW).rows}
    listed = {entry["vehicle"]: entry for entry in client.get("/api/v1/vehicles?limit=100").json()["vehicles"]}
    for name, verdict, _ in VEHICLES:
        state = client.get(f"/api/v1/vehicles/{name}/changes").json()
        assert state["verdict"] == verdict, (name, state["sentence"])
        if name.startswith(("healthy", "few", "loaded")) and state["n_windows"]:
            assert_the_diagnosis_says(store, name, state)
        sentence, page = state["sentence"], client.get(f"/vehicles/{name}", headers={"accept": "text/html"}).text
        report = report_document(read_history(store, name, Period(), now=NOW), now=NOW).as_json()
        heading = re.search(r"<h1>(.*?)</h1>", page, re.DOTALL)
        assert heading is not None
        said = {
            "page": html.unescape(re.sub(r"<[^>]+>", "", heading[1])),
            "report": report["sentence"],
            "command": commands[name]["summary"],
            "table": printed[name],
            "fleet": listed[name]["sentence"],
        }
        assert said == dict.fromkeys(said, sentence), name
        verdicts = {report["verdict"], commands[name]["verdict"], listed[name]["verdict"]}
        assert verdicts == {verdict}, name
        is_unknown = verdict not in {"change", "no_change_detected", "fault"}
        assert (listed[name]["health_index"] is None) == is_unknown, name
        facts = ("change", "interval", "detectable")
        reported_parts = {each["component"]: {fact: each[fact] for fact in facts} for each in report["changes"]}
        parts = {each["part"]: {fact: each[fact] for fact in facts} for each in state["parts"]}
        assert reported_parts == (parts if state["baseline"] is not None else {})
        for part in parts.values():
            assert part["interval"][0] < part["change"] < part["interval"][1]
        assert_alerts_agree(store, client, name, parts, sentence)


def assert_the_diagnosis_says(store, name, state):
    """Compare the state of a vehicle without an alert with the diagnosis of its windows, as a command makes it."""
    windows = [observation_from_document(entry.document) for entry in store.results.observations(name)]
    found = diagnose(windows[TAUGHT:], baseline_from_document(store.results.baselines(name)[0].document))
    assert state["sentence"].rstrip(".").lower() == describe_diagnosis(found)[0].lower()
    assert state["verdict"] == found.verdict
    assert {part["part"]: part["detectable"] for part in state["parts"]} == {
        str(part): pytest.approx(least) for part, least in found.detectable.items()
    }
    if name == "loaded":
        assert {part["verdict"] for part in state["parts"]} == {"inconclusive"}


def assert_alerts_agree(store, client, name, parts, sentence):
    """Compare mail, interface and export of the alerts of a vehicle with its state."""
    text = b"".join(export(store, name, "alerts", file_format="csv")).decode()
    exported = {row["cause"]: row for row in csv.DictReader(io.StringIO(text))}
    rows = store.alerts.find(vehicle=name, is_active=True)
    assert exported.keys() == {row.cause for row in rows}
    for row in rows:
        evidence = client.get(f"/api/v1/alerts/{row.number}/evidence").json()
        stated = exported[row.cause]["sentence"]
        message = addressed(message_of(Transition(row, "raised")), number=row.number)
        mail = MAIL._mail(message).get_body(("plain",))
        assert mail is not None
        assert mail.get_content().startswith(stated)
        assert message.document["evidence"] == row.evidence
        if len(rows) == 1:
            assert stated.lower() == sentence.rstrip(".").lower()
        part = parts.get(row.cause)
        if part is None or evidence["change"] is None:
            continue
        assert (evidence["change"], evidence["interval"]) == (part["change"], part["interval"])
        likeliest = {each["name"]: (each["change"], each["interval"]) for each in evidence["hypotheses"]}
        assert likeliest[row.cause] == (evidence["change"], evidence["interval"])
        assert evidence["detectable"][row.cause] == part["detectable"]
        columns = ("change_percent", "change_low_percent", "change_high_percent", "detectable_percent")
        numbers = [float(exported[row.cause][column]) for column in columns]
        assert numbers == pytest.approx(100 * np.array([part["change"], *part["interval"], part["detectable"]]))
