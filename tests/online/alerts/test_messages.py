"""Messages about alerts as documents, texts and subjects."""

import json
from dataclasses import replace

import numpy as np

from sprung.online.alerts import (
    AlertSettings,
    Report,
    acknowledged,
    addressed,
    message_of,
    reported,
    trial_message,
)

TIME = 1_700_000_000_000_000_000  # 2023-11-14 22:13:20 UTC


def a_message(severity=700, **evidence):
    report = Report("car", "front_left.spring", severity, "front-left spring 20 % softer – inspect", evidence)
    transition = reported(None, report, AlertSettings(), TIME)
    return message_of(transition)


def test_messages_follow_their_schema(check_document) -> None:
    message = a_message(change=-0.2, covariance=np.eye(2), interval=(-0.22, -0.18))
    sent = addressed(message, number=3, key="alert-3-1", link="https://sprung.example.org/alerts/3")
    for each in (message, sent, addressed(message, number=3, key="k", link=""), trial_message(TIME)):
        check_document(json.loads(json.dumps(each.document)))


def test_message() -> None:
    message = a_message(change=-0.2)
    assert message.subject == "car: front-left spring raised (high)"
    assert message.text.splitlines() == [
        "front-left spring 20 % softer – inspect",
        "",
        "Vehicle: car",
        "Cause: front_left.spring",
        "State: unacknowledged",
        "Severity: 700 of 1000 (high)",
        "Raised: 2023-11-14T22:13:20Z (occurrence 1)",
    ]
    assert (message.vehicle, message.what, message.severity, message.time) == ("car", "raised", 700, TIME)
    assert message.document["schema"] == "sprung.alert/1"
    assert message.document["raised"] == TIME
    assert message.document["time"] == "2023-11-14T22:13:20Z"
    assert message.document["evidence"] == {"change": -0.2}


def test_message_says_who_did_it() -> None:
    alert = reported(None, Report("car", "silent", 500, "nothing heard"), AlertSettings(), TIME).alert
    alert = replace(alert, is_active=False, cleared=TIME, assignee="bob")
    transition = acknowledged(alert, "ann", TIME, "in the garage")
    message = message_of(transition)
    assert message.text.splitlines()[-3:] == [
        "Cleared: 2023-11-14T22:13:20Z",
        "Assigned to: bob",
        "By: ann: in the garage",
    ]
    assert message.document["state"] == "normal"


def test_any_evidence_becomes_json() -> None:
    document = a_message(
        hours=(1.0, float("inf")), values=np.array([1.0, np.nan]), count=np.int64(3), odd=1j, deep={1: {"a": None}}
    ).document
    assert json.loads(json.dumps(document, allow_nan=False))["evidence"] == {
        "hours": [1.0, None],
        "values": [1.0, None],
        "count": 3,
        "odd": "1j",
        "deep": {"1": {"a": None}},
    }


def test_subject_is_one_line() -> None:
    transition = reported(None, Report("car", "a\r\nBcc: x@y", 1, "t"), AlertSettings(), TIME)
    assert message_of(transition).subject == "car: a Bcc: x@y raised (note)"
