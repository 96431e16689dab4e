"""Precision of a site's alerts, and times to repair, from verdicts."""

import numpy as np
import pytest
from tests.online.site.conftest import HOUR, NOW, raise_alert

from sprung.diagnosis import Observation
from sprung.online.monitor import operations
from sprung.online.site.accounts import Person, Role
from sprung.online.site.alerts import outcomes, precision, share
from sprung.online.store import Progress, StoredFrame, VerdictRow
from sprung.results.documents import observation_document

#: Values of no part.
_NOTHING = (np.zeros(0), np.zeros((0, 0)))


@pytest.mark.parametrize(
    ("hits", "of", "interval"),
    [
        # R. G. Newcombe, Statistics in Medicine 17 (1998) 857-872, table I, method 5
        (81, 263, (0.2527, 0.3676)),
        (15, 148, (0.0578, 0.1617)),
        (0, 20, (0.0, 0.1684)),
        (1, 29, (0.0009, 0.1776)),
    ],
)
def test_intervals_of_shares_are_published_ones(hits, of, interval) -> None:
    assert share(hits, of).interval == pytest.approx(interval, abs=5e-5)


def test_an_interval_without_misses_has_a_closed_form() -> None:
    """All of n: the lower end p has p^n = 2.5 %."""
    assert share(7, 7).interval == pytest.approx((0.025 ** (1 / 7), 1.0), abs=1e-12)
    assert (share(0, 0).value, share(0, 0).interval) == (None, (0.0, 1.0))


def test_verdicts_give_precision_and_delays(store) -> None:
    """Six alerts: two confirmed, one another part, one nothing found, one not looked at, one of the monitor."""
    given = [
        ("front_left.spring", -3, ("confirmed", "", "spring renewed"), 10),
        ("front_left.damper", -1, ("confirmed", "", ""), 20),
        ("rear_left.tyre", None, ("another part", "bushing", "renewed"), 30),
        ("sensor:acc_fl", None, ("nothing found", "", ""), 1),
        ("rear_left.spring", None, ("not looked at", "", ""), 1),
        ("lost", None, ("confirmed", "", "disk renewed"), 1),
    ]
    for cause, onset, (verdict, part, action), hours in given:
        began = {} if onset is None else {"since": (NOW + onset * HOUR) / 1e9}
        number = raise_alert(store, "bus-3", cause, evidence=began)
        operations.add_verdict(
            store, number, verdict=verdict, part=part, action=action, who="eve", now=NOW + hours * HOUR
        )
    found = precision(store)
    assert found.verdicts == {"confirmed": 2, "another part": 1, "nothing found": 1, "not looked at": 1}
    assert (found.alert.hits, found.alert.of, found.alert.value) == (3, 4, 0.75)
    assert (found.part.hits, found.part.of, found.part.value) == (2, 4, 0.5)
    assert found.onset_to_alert is not None
    assert found.alert_to_repair is not None
    assert found.onset_to_repair is not None
    assert found.onset_to_alert.number == 2
    assert found.onset_to_alert.median == pytest.approx(2 * HOUR, abs=1e6)
    assert (found.alert_to_repair.shortest, found.alert_to_repair.longest) == (10 * HOUR, 30 * HOUR)
    assert found.onset_to_repair.median == pytest.approx(13 * HOUR, abs=1e6)


def test_the_last_verdict_on_an_alert_counts(store) -> None:
    operations.add_verdict(store, 1, verdict="nothing found", who="eve", now=NOW)
    operations.add_verdict(store, 1, verdict="confirmed", who="eve", now=NOW + 1)
    found = precision(store)
    assert (found.alert.hits, found.alert.of) == (1, 1)


def test_an_alert_that_was_raised_again_keeps_the_onset_of_its_findings(store) -> None:
    """The alert has new evidence since; the finding of that time has the onset."""
    finding = {"corner": "front_left", "component": "spring", "since": (NOW - 5 * HOUR) / 1e9}
    store.inbox.add_frames([StoredFrame("bus-3", 1, 0, NOW, b"x")], now=NOW)
    found = Progress("bus-3", 1, done_seq=0, findings=((0, NOW - 4 * HOUR, finding),), now=NOW)
    store.results.commit(found)
    number = raise_alert(store, "bus-3", "front_left.spring", evidence={"since": (NOW - HOUR) / 1e9})
    earlier = VerdictRow(number, NOW - HOUR, "eve", "confirmed", "", "spring renewed", NOW - 2 * HOUR)
    store.verdicts.add(earlier)
    delay = precision(store).onset_to_alert
    assert delay is not None
    assert delay.median == pytest.approx(3 * HOUR, abs=1e6)


@pytest.mark.slow
def test_a_site_without_verdicts(store, log_in) -> None:
    client, _ = log_in("viewer")
    found = client.get("/api/v1/precision").json()
    assert (found["alert"]["value"], found["onset_to_alert"]) == (None, None)
    assert "No verdict yet." in client.get("/alerts").text


def test_outcomes_state_what_was_found_and_the_way_driven_since(serve, store) -> None:
    number = raise_alert(store, "bus-3", "front_left.spring", text="front-left spring softer")
    operations.add_verdict(store, number, verdict="confirmed", action="spring renewed", who="eve", now=NOW)
    driven = [
        (k, NOW + (k - 1) * HOUR, observation_document(Observation(0.0, (), *_NOTHING, {"speed": 20.0}, {}, ())))
        for k in range(4)
    ]
    store.inbox.add_frames([StoredFrame("bus-3", 1, 0, NOW, b"x")], now=NOW)
    store.results.commit(Progress("bus-3", 1, done_seq=0, observations=tuple(driven), now=NOW))
    context, client = serve()
    (found,) = outcomes(context, Person("anna", Role.VIEWER)).alerts
    assert (found.alert, found.vehicle, found.verdict, found.action) == (number, "bus-3", "confirmed", "spring renewed")
    assert found.distance == pytest.approx(3 * 600 * 20.0)
    assert not found.is_back
    page = client.get("/outcomes").text
    for words in ("1 of 1 inspected alert was right", "spring renewed", ">36<", "not raised again"):
        assert words in page


def test_resets_have_person_date_and_mileage_which_grows_with_the_way_driven(log_in, store) -> None:
    client, header = log_in("engineer")
    assert client.get("/api/v1/vehicles/bus-3").json()["mileage"] is None
    given = {"reason": "new dampers", "mileage": 120000}
    assert client.post("/api/v1/vehicles/bus-3/baselines", json=given, headers=header).status_code == 202
    driven = [
        (k, NOW + k * HOUR, observation_document(Observation(0.0, (), *_NOTHING, {"speed": 20.0}, {}, ())))
        for k in range(1, 4)
    ]
    store.inbox.add_frames([StoredFrame("bus-3", 1, 0, NOW, b"x")], now=NOW)
    store.results.commit(Progress("bus-3", 1, done_seq=0, observations=tuple(driven), now=NOW))
    (reset,) = client.get("/api/v1/outcomes").json()["resets"]
    expected = {"vehicle": "bus-3", "time": NOW, "who": "eve", "reason": "new dampers", "mileage": 120000}
    assert reset == expected
    # three windows of ten minutes at 20 m/s
    assert client.get("/api/v1/vehicles/bus-3").json()["mileage"] == pytest.approx(120036)
    number = raise_alert(store, "bus-3", "front_left.damper", text="front-left damper weaker")
    assert "about 120,036" in client.get(f"/alerts/{number}/job-card").text
    assert "about 120,036 km" in client.get("/vehicles/bus-3").text
    assert "120,000" in client.get("/outcomes").text
    below = client.post("/api/v1/vehicles/bus-3/baselines", json={"reason": "x", "mileage": -1}, headers=header)
    assert below.status_code == 422
    operations.add_verdict(
        store,
        number,
        verdict="confirmed",
        action="damper renewed",
        new_baseline=True,
        mileage=121e3,
        who="eve",
        now=NOW + 1,
    )
    resets = client.get("/api/v1/outcomes").json()["resets"]
    assert [(each["reason"], each["mileage"]) for each in resets] == [("damper renewed", 121e3), ("new dampers", 120e3)]


@pytest.mark.slow
def test_an_odometer_gives_the_mileage_of_pages_and_resets(log_in, store) -> None:
    client, header = log_in("engineer")
    conditions = [{"speed": 20.0, "mileage": 154_300.0}, {"speed": 20.0, "mileage": 154_312.0}, {"speed": 20.0}]
    driven = [
        (k, NOW + k * HOUR, observation_document(Observation(0.0, (), *_NOTHING, each, {}, ())))
        for k, each in enumerate(conditions)
    ]
    store.inbox.add_frames([StoredFrame("bus-3", 1, 0, NOW, b"x")], now=NOW)
    store.results.commit(Progress("bus-3", 1, done_seq=0, observations=tuple(driven), now=NOW))
    # the last reading, and a window of ten minutes at 20 m/s since
    assert client.get("/api/v1/vehicles/bus-3").json()["mileage"] == pytest.approx(154_324)
    number = raise_alert(store, "bus-3", "front_left.damper", text="front-left damper weaker")
    assert "about 154,324" in client.get(f"/alerts/{number}/job-card").text
    baselines = "/api/v1/vehicles/bus-3/baselines"
    assert client.post(baselines, json={"reason": "new dampers"}, headers=header).status_code == 202
    (reset,) = client.get("/api/v1/outcomes").json()["resets"]
    assert (reset["reason"], reset["mileage"]) == ("new dampers", 154_312.0)
