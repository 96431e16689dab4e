"""The pages of alerts: acts by forms, what viewers see, and what people can write."""

import re

import pytest
from tests.online.site.conftest import NOW, PASSWORD

from sprung.online.alerts import AlertSettings
from sprung.online.monitor.alert_book import AlertBook
from sprung.online.site.alert import _folded
from sprung.results.documents.monitoring import HistoryEntry


@pytest.fixture
def log_in_page(serve, people):
    """Function of a role and settings that returns a client that logged in by the page, and its CSRF token."""

    def logged_in(role, **fields):
        _, client = serve(**fields)
        client.post("/log-in", data={"name": people[role], "password": PASSWORD, "next": "/"})
        token = re.search(r'data-csrf-token="(\w+)"', client.get("/alerts").text)
        assert token is not None
        return client, token[1]

    return logged_in


def send(client, token, act, **fields):
    return client.post(
        f"/alerts/1/{act}",
        data={"csrf_token": token, **fields},
        headers={"accept": "text/html"},
        follow_redirects=False,
    )


def test_every_act_by_a_form(log_in_page, store) -> None:
    client, token = log_in_page("engineer")
    acts = [
        ("acknowledge", {"comment": "seen"}, "Acknowledged."),
        ("assign", {"assignee": "bert"}, "Assigned."),
        ("shelve", {"hours": "24", "comment": "part ordered"}, "Shelved"),
        ("unshelve", {}, "No longer shelved."),
        ("comment", {"comment": "on its way"}, "Comment added."),
        ("close", {"comment": "it was a stone"}, "Cleared."),
    ]
    for act, fields, notice in acts:
        answer = send(client, token, act, **fields)
        assert (answer.status_code, answer.headers["location"]) == (303, f"/alerts/1?done={act}"), answer.text
        assert notice in client.get(answer.headers["location"]).text
    assert [entry.what for entry in store.alerts.history(1)] == [
        *("raised", "acknowledged", "assigned", "shelved", "unshelved", "commented", "cleared")
    ]
    assert {entry.who for entry in store.alerts.history(1)[1:]} == {"eve"}
    assert store.alerts.history(1)[3].shelved_until == NOW + 24 * 3600 * 10**9


@pytest.mark.slow
def test_one_form_closes_an_alert_after_a_repair(log_in_page, store) -> None:
    client, token = log_in_page("engineer")
    answer = send(client, token, "verdict", verdict="confirmed", action="spring renewed", new_baseline="yes")
    assert answer.headers["location"] == "/alerts/1?done=baseline"
    assert not store.alerts.row(1).is_active
    (command,) = store.requests.open_commands()
    assert (command.vehicle, command.act, command.detail) == ("bus-1", "learn", "spring renewed")
    (verdict,) = store.verdicts.all()
    assert (verdict.verdict, verdict.who, verdict.request) == ("confirmed", "eve", command.id)
    assert store.alerts.history(1)[-1].comment == "verdict: confirmed; spring renewed"


def test_an_impossible_act_keeps_what_was_entered(log_in_page, store) -> None:
    client, token = log_in_page("engineer")
    answer = send(client, token, "verdict", verdict="another part", action="<b>looked</b> at it")
    assert answer.status_code == 409
    assert "Name the part with the verdict" in answer.text
    assert "&lt;b&gt;looked&lt;/b&gt; at it</textarea>" in answer.text
    assert 'value="another part" required checked' in answer.text
    assert send(client, token, "shelve", hours="-1").status_code == 409
    assert send(client, token, "comment", comment="x" * 4001).status_code == 409
    assert store.verdicts.all() == []


def test_the_history_folds_updates() -> None:
    words = ["raised", "updated", "updated", "updated", "acknowledged", "updated"]
    history = [
        HistoryEntry(time=NOW + k, what=what, who="", comment="", assignee=None, shelved_until=None)
        for k, what in enumerate(words)
    ]
    folded = [(number, entry.what, entry.time - NOW) for number, entry in _folded(history)]
    assert folded == [(1, "updated", 5), (1, "acknowledged", 4), (3, "updated", 3), (1, "raised", 0)]


@pytest.mark.slow
def test_viewers_see_no_forms_and_cannot_act(log_in_page) -> None:
    client, token = log_in_page("viewer")
    page = client.get("/alerts/1").text
    assert 'action="/alerts/' not in page
    assert "You see this alert as a viewer." in page
    for act in ("acknowledge", "assign", "shelve", "unshelve", "comment", "close", "verdict", "work-order"):
        assert send(client, token, act).status_code == 403


def test_unknown_alerts(log_in_page) -> None:
    client, token = log_in_page("engineer")
    assert client.get("/alerts/77", headers={"accept": "text/html"}).status_code == 404
    answer = client.post("/alerts/77/close", data={"csrf_token": token}, headers={"accept": "text/html"})
    assert answer.status_code == 404


def test_a_work_order_as_a_file(log_in_page, check_document) -> None:
    client, _ = log_in_page("viewer", url="https://sprung.example.org")
    answer = client.get("/alerts/1/work-order.json")
    assert answer.headers["content-disposition"] == 'attachment; filename="work-order-1.json"'
    order = answer.json()
    check_document(order)
    assert (order["vehicle"], order["corner"], order["part"]) == ("bus-1", "front_left", "spring")
    assert (order["change"], order["interval"]) == (-0.2, [-0.22, -0.18])
    assert order["link"] == "https://sprung.example.org/alerts/1"
    assert order == client.get("/api/v1/alerts/1/work-order").json()


@pytest.mark.slow
def test_a_job_card_to_print(log_in_page, store) -> None:
    client, _ = log_in_page("viewer")
    card = client.get("/alerts/1/job-card").text
    for words in ("bus-1: front-left spring", "−20 %", "(−22 to −18 %)", "Ride height left and right", "signature"):
        assert words in card
    assert (card.count('fill="#111"'), card.count(">left</text>"), card.count(">right</text>")) == (1, 1, 0)
    file = client.get("/alerts/1/job-card.pdf")
    assert file.headers["content-disposition"] == 'attachment; filename="job-card-1.pdf"'
    assert file.content.startswith(b"%PDF-")
    AlertBook(store, AlertSettings()).report("monitor", "monitor:disk", "full", now=NOW)
    assert client.get("/alerts/3/job-card").status_code == 409


def test_a_work_order_by_webhook(log_in_page, store, receiver, check_document) -> None:
    handler, url = receiver
    client, token = log_in_page("engineer", send={"webhook": [{"url": url}]})
    answer = send(client, token, "work-order")
    assert (answer.status_code, answer.headers["location"]) == (303, "/alerts/1?done=work-order")
    ((key, order),) = handler.received
    check_document(order)
    assert key == order["key"]
    last = store.alerts.history(1)[-1]
    assert (last.who, last.comment) == ("eve", "work order by webhook 1: sent")
    handler.status = 500
    refused = send(client, token, "work-order")
    assert refused.status_code == 409
    assert "answered 500" in refused.text
    assert "answered 500" in store.alerts.history(1)[-1].comment


def test_a_work_order_needs_a_webhook_and_a_vehicle(log_in_page, store) -> None:
    client, token = log_in_page("engineer")
    assert "he site file has no webhook" in send(client, token, "work-order").text
    AlertBook(store, AlertSettings()).report("monitor", "monitor:disk", "full", now=NOW)
    assert client.get("/api/v1/alerts/3/work-order").status_code == 409
    page = client.get("/alerts/3").text
    assert "<h1>Full</h1>" in page
    assert "work-order" not in page
    assert "What did the workshop find?" not in page
    assert "<h1>bus-2 has sent nothing</h1>" in client.get("/alerts/2").text
