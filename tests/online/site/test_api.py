"""The interface: every act, every list, pages of lists, and what is refused."""

import pytest
from tests.online.site.conftest import HOUR, NOW, raise_alert

from sprung.online.alerts import AlertSettings
from sprung.online.monitor.alert_book import AlertBook
from sprung.online.store import FleetFilter
from sprung.state import AlertState, health_index


@pytest.fixture
def client(log_in):
    """Client of an engineer."""
    made, headers = log_in("engineer")
    made.headers.update(headers)
    return made


@pytest.mark.slow
def test_the_fleet_in_order_of_urgency(client) -> None:
    page = client.get("/api/v1/vehicles").json()
    assert page["next"] is None
    first, second, third = page["vehicles"]
    assert (first["vehicle"], first["verdict"], first["step"], first["alert"]) == ("bus-1", "change", "high", 1)
    assert (first["sentence"], first["since"]) == ("Front-left spring 20 % softer.", NOW - HOUR)
    assert first["health_index"] == 30.0
    assert (second["vehicle"], second["verdict"], second["health_index"]) == ("bus-2", "stale", None)
    assert (third["vehicle"], third["verdict"], third["health_index"]) == ("bus-3", "waiting", None)
    counts = {"vehicles": 3, "steps": [0, 1, 0, 1, 0], "learning": 0, "silent": 1, "unacknowledged": 2}
    assert client.get("/api/v1/counts").json() == counts
    assert client.post("/api/v1/alerts/1/shelve", json={"hours": 8}).status_code == 200
    assert client.post("/api/v1/alerts/2/acknowledge", json={}).status_code == 200
    assert client.get("/api/v1/counts").json() == counts | {"unacknowledged": 0}
    page = client.get("/", headers={"Accept": "text/html"}).text
    assert "<h1>None of 3 vehicles needs attention. 1 is silent.</h1>" in page
    assert '<span class="note">shelved</span>' in page
    assert "<h1>No alert needs attention. " in client.get("/alerts", headers={"Accept": "text/html"}).text


def test_a_page_of_the_fleet_shows_the_advice_of_the_monitor(serve) -> None:
    sentence = "to learn most about the type bus, inspect bus-3 next"
    _, client = serve(advice=(sentence,))
    assert client.get("/api/v1/advice").json() == {"sentences": [sentence]}
    assert 'data-sentences="/api/v1/advice" hidden' in client.get("/", headers={"Accept": "text/html"}).text
    assert serve()[1].get("/api/v1/advice").json() == {"sentences": []}  # no ranking yet


@pytest.mark.slow
def test_an_alert_does_not_hide_that_its_vehicle_is_silent(client, store) -> None:
    seen = NOW - 72 * HOUR
    store.inbox.put_vehicle("bus-8", configuration="c", description="", channels=[["acc_fl", "m/s^2"]], now=seen)
    raise_alert(store, "bus-8", "front_left.spring", 900, "front-left spring 20 % softer", now=seen)
    (first,) = client.get("/api/v1/vehicles?text=bus-8").json()["vehicles"]
    assert (first["verdict"], first["is_old"], first["health_index"]) == ("change", True, None)
    page = client.get("/?text=bus-8", headers={"Accept": "text/html"}).text
    assert '<tr class="unknown">' in page
    assert '<span class="note">silent</span>' in page


def test_a_search_keeps_the_filter_of_the_fleet(client) -> None:
    page = client.get("/?step=high&is_silent=true&text=bus", headers={"Accept": "text/html"}).text
    assert '<input type="hidden" name="step" value="high">' in page
    assert '<input type="hidden" name="is_silent" value="true">' in page
    assert 'href="/?text=bus&amp;step=high&amp;is_silent=True&amp;is_unacknowledged=True"' in page


def test_the_quality_of_data_in_the_fleet(client, store) -> None:
    """A failing sensor and lost frames are seen next to a more severe finding."""

    def quality():
        first = client.get("/api/v1/vehicles").json()["vehicles"][0]
        return first["channels"], first["failing"], first["has_lost"]

    assert quality() == (1, [], False)
    raise_alert(store, "bus-1", "sensor:acc_fl", 300, "dead")
    assert quality() == (1, ["acc_fl"], False)
    AlertBook(store, AlertSettings()).report_lost("bus-1", {1: 3}, now=NOW)
    assert quality() == (1, ["acc_fl"], True)
    page = client.get("/", headers={"Accept": "text/html"}).text
    assert "0 of 1 good" in page


@pytest.mark.slow
@pytest.mark.parametrize(
    ("query", "vehicles"),
    [
        ("text=US-1", ["bus-1"]),
        ("step=high&step=none", ["bus-1", "bus-3"]),
        ("is_silent=true", ["bus-2"]),
        ("is_learning=true", []),
        ("is_unacknowledged=true", ["bus-1", "bus-2"]),
        ("assignee=bert", []),
    ],
)
def test_filters(client, query, vehicles) -> None:
    assert [each["vehicle"] for each in client.get(f"/api/v1/vehicles?{query}").json()["vehicles"]] == vehicles


@pytest.mark.slow
@pytest.mark.parametrize(
    ("path", "status", "words"),
    [
        ("vehicles?step=crit", 422, "'high', 'critical' or 'none'"),
        ("alerts?step=crit", 422, "'high' or 'critical'"),
        ("vehicles?severity=high", 422, "unknown query parameter 'severity': use text, step, assignee, "),
        ("vehicles/bus-1/trends?from=1", 422, "'from': use since, until"),
        ("counts?step=high&text=", 422, "'step', 'text': this route takes none"),
        ("vehicles?step=none&limit=1", 200, "bus-3"),
        ("vehicles/bus-1/export?format=csv&what=alerts", 200, "alert"),
    ],
)
def test_an_unknown_filter_is_refused_with_the_allowed_ones(client, path, status, words) -> None:
    answer = client.get(f"/api/v1/{path}")
    assert (answer.status_code, words in answer.text) == (status, True), answer.text[:300]


@pytest.mark.slow
def test_pages_follow_their_cursor(client) -> None:
    found, cursor = [], ""
    while cursor is not None:
        page = client.get("/api/v1/vehicles", params={"limit": 1} | ({"cursor": cursor} if cursor else {})).json()
        found += [each["vehicle"] for each in page["vehicles"]]
        cursor = page["next"]
    assert found == ["bus-1", "bus-2", "bus-3"]
    assert client.get("/api/v1/vehicles?cursor=x").status_code == 422


def test_the_impact_of_alerts_is_what_the_health_index_lacks(store) -> None:
    """The order of the fleet is computed in the store, the index from the alerts."""
    causes = ("front_left.spring", "rear", "sensor:acc_fl", "lost", "silent", "monitor", "monitor:intake")
    for cause in causes:
        row = AlertState(f"car {cause}", cause, 600, "text", NOW)
        store.alerts.put(row, history=("raised", "", ""), now=NOW)
        store.inbox.put_vehicle(row.vehicle, configuration="c", description="", channels=[], now=NOW)
    places = {row.place.vehicle: row.place for row in store.fleet.page(FleetFilter(text="car "))}
    assert len(places) == len(causes)
    for vehicle, place in places.items():
        (row,) = store.alerts.find(vehicle=vehicle)
        assert place.impact == pytest.approx(10 * (100 - health_index([row])), abs=1e-9)


@pytest.mark.slow
def test_a_vehicle(client) -> None:
    found = client.get("/api/v1/vehicles/bus-1").json()
    assert (found["channels"], found["windows"], found["first_seen"]) == (["acc_fl"], 5, NOW)
    assert [alert["number"] for alert in found["alerts"]] == [1]
    assert found["baselines"] == [{"version": 1, "created": NOW, "reason": "first learning", "windows": 12}]
    missing = client.get("/api/v1/vehicles/bus-9")
    assert (missing.status_code, missing.json()["detail"][:22]) == (404, "unknown vehicle 'bus-9")


@pytest.mark.slow
def test_windows_in_pages(client) -> None:
    last = client.get("/api/v1/vehicles/bus-1/windows?limit=2").json()
    assert [window["document"] for window in last["windows"]] == [{"time": 3}, {"time": 4}]
    before = client.get(f"/api/v1/vehicles/bus-1/windows?limit=3&until={last['next']}").json()
    assert [window["number"] for window in before["windows"]] == [0, 1, 2]
    assert before["next"] is None
    assert len(client.get("/api/v1/vehicles/bus-1/modes").json()["windows"]) == 1
    assert len(client.get("/api/v1/vehicles/bus-1/findings").json()["windows"]) == 2


def test_acts_on_an_alert(client, store) -> None:
    def act(name, **body):
        answer = client.post(f"/api/v1/alerts/1/{name}", json=body)
        assert answer.status_code == 200, answer.text
        return answer.json()

    assert act("acknowledge", comment="seen")["alert"]["state"] == "acknowledged"
    assert act("assign", assignee="bert")["alert"]["assignee"] == "bert"
    assert act("shelve", hours=2)["alert"]["shelved_until"] == NOW + 2 * HOUR
    assert act("unshelve")["alert"]["shelved_until"] is None
    found = act("comment", comment="on its way")
    assert [(entry["what"], entry["who"]) for entry in found["history"][1:]] == [
        (what, "eve") for what in ("acknowledged", "assigned", "shelved", "unshelved", "commented")
    ]
    assert found["evidence"] == {"change": -0.2, "interval": [-0.22, -0.18]}
    assert act("close", comment="it was a sensor")["alert"]["state"] == "normal"
    assert [row.act for row in store.requests.audited()][-6:] == [
        "ack",
        "assign",
        "shelve",
        "unshelve",
        "comment",
        "close",
    ]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("path", "body", "status", "words"),
    [
        ("alerts/9/acknowledge", {}, 404, "unknown alert 9"),
        ("alerts/1/acknowledge", {"who": "me"}, 422, "who: Extra inputs"),
        ("alerts/1/shelve", {"hours": 0}, 422, "hours"),
        ("alerts/1/shelve", {}, 422, "hours"),
        ("alerts/1/comment", {"comment": " "}, 409, "is empty: write a comment"),
        ("alerts/1/comment", {"comment": "x" * 4001}, 422, "comment"),
        ("alerts/1/unshelve", {}, 409, "not shelved"),
        ("alerts/1/verdict", {"verdict": "maybe"}, 422, "verdict"),
        ("alerts/1/verdict", {"verdict": "another part"}, 409, "name the part with the verdict 'another part'"),
        ("alerts/1/verdict", {"verdict": "confirmed", "part": "x"}, 409, "and with no other"),
        ("alerts/99999999999999999999/acknowledge", {}, 422, "number"),
        ("vehicles/bus-9/baselines", {"reason": "new dampers"}, 404, "unknown vehicle"),
        ("vehicles/bus-1/baselines", {"reason": " "}, 422, "reason"),
    ],
)
def test_acts_that_are_impossible_change_nothing(client, store, *, path, body, status, words) -> None:
    before = store.alerts.find(), len(store.requests.audited())
    answer = client.post(f"/api/v1/{path}", json=body)
    assert (answer.status_code, words in answer.json()["detail"]) == (status, True), answer.text
    assert (store.alerts.find(), len(store.requests.audited())) == before


def test_an_act_is_stored_as_a_whole_or_not_at_all(client, store, monkeypatch) -> None:
    def fail(*_args, **_fields):
        raise RuntimeError("the power fails")

    monkeypatch.setattr("sprung.online.monitor.operations.close", fail)
    body = {"verdict": "confirmed", "new_baseline": True}
    assert client.post("/api/v1/alerts/1/verdict", json=body).status_code == 500
    assert (store.verdicts.all(), store.requests.open_commands()) == ([], [])
