"""Results of runs over the fleet: in order, by pages, and anew when a run has replaced them."""

from dataclasses import replace
from functools import partial

import pytest
from tests.online.site.conftest import run_row as row
from tests.online.site.conftest import write_run
from tests.online.site.test_pages import HOSTILE, check_markup

from sprung.fleet.lake import Table
from sprung.online.site import runs as runs_module
from sprung.online.site.shared import LIMITS

HEADERS = {"Accept": "text/html"}
FLEET = [
    row("bus-9"),
    row("tram~1", "change", "low"),
    row("bus-2", "change", "critical"),
    row("bus-1", "change", "high", is_discovery=True),
    row("Bus-7", "inconclusive", reason="no window was usable"),
    row("bus-4", "change", "medium", is_discovery=True),
    row("bus-3", "change", "critical"),
]
IN_ORDER = ["bus-1", "bus-4", "bus-2", "bus-3", "tram~1", "Bus-7", "bus-9"]


@pytest.fixture
def store_run(tmp_path):
    """Function of rows that replaces the results of the fleet, as a run does."""
    return partial(write_run, tmp_path / "fleet")


@pytest.fixture
def client(serve, tmp_path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(runs_module, "LIMITS", replace(LIMITS, fresh=0.0))
    return serve(keep={"results": str(tmp_path / "fleet")})[1]


def names(client, **wanted):
    answer = client.get("/api/v1/runs", params=wanted)
    assert answer.status_code == 200, answer.text
    return [each["vehicle"] for each in answer.json()["vehicles"]]


def test_discoveries_come_first_then_the_most_severe(client, store_run) -> None:
    store_run(FLEET)
    document = client.get("/api/v1/runs").json()
    assert [each["vehicle"] for each in document["vehicles"]] == IN_ORDER
    assert (document["total"], document["discoveries"], document["next"]) == (7, 2, None)
    assert document["verdicts"] == {"change": 5, "inconclusive": 1, "no_change_detected": 1}
    assert [each["is_known"] for each in document["vehicles"]] == [True, False, True, True, False, False, False]
    inconclusive = document["vehicles"][5]
    assert (inconclusive["e_value"], inconclusive["reason"]) == (None, "no window was usable")


@pytest.mark.slow
@pytest.mark.parametrize("limit", [1, 2, 3, 6, 7])
def test_pages_are_the_whole_list(client, store_run, limit) -> None:
    store_run(FLEET)
    found, cursor = [], None
    while True:
        document = client.get("/api/v1/runs", params={"limit": limit} | ({"cursor": cursor} if cursor else {})).json()
        found += [each["vehicle"] for each in document["vehicles"]]
        cursor = document["next"]
        if cursor is None:
            break
    assert found == IN_ORDER


@pytest.mark.slow
def test_filters(client, store_run) -> None:
    store_run(FLEET)
    assert names(client, text="BUS-", limit=3) == ["bus-1", "bus-4", "bus-2"]
    assert names(client, text=".") == []
    assert names(client, verdict=["inconclusive", "no_change_detected"]) == ["Bus-7", "bus-9"]
    assert names(client, is_discovery=True) == ["bus-1", "bus-4"]
    assert client.get("/api/v1/runs", params={"cursor": "2~x"}).status_code == 422
    assert client.get("/api/v1/runs", params={"verdict": "sound"}).status_code == 422


def test_a_run_replaces_the_results(client, store_run) -> None:
    assert names(client) == []
    assert "No run has stored results yet" in client.get("/runs", headers=HEADERS).text
    store_run(FLEET)
    assert names(client) == IN_ORDER
    store_run(FLEET[:1])
    assert names(client) == ["bus-9"]


def test_rows_are_read_once_for_each_run(client, store_run, monkeypatch: pytest.MonkeyPatch) -> None:
    store_run(FLEET)
    assert names(client)
    monkeypatch.setattr(Table, "rows", lambda *_: pytest.fail("the table is read again"))
    assert names(client) == IN_ORDER


def test_the_page_links_what_the_monitor_knows(client, store_run) -> None:
    store_run([*FLEET, row(HOSTILE, "change", "high", is_discovery=True, reason=HOSTILE)])
    text = client.get("/runs", headers=HEADERS).text
    check_markup(text)
    assert "<h1>3 of 8 vehicles stand out from the fleet.</h1>" in text
    assert '<a href="/vehicles/bus-2">bus-2</a>' in text
    assert '<th scope="row">bus-4</th>' in text
    assert '<a href="/runs" aria-current="page">Runs</a>' in text
    nothing = client.get("/runs?text=lorry", headers=HEADERS).text
    check_markup(nothing)
    assert "No vehicle matches" in nothing


def test_results_that_cannot_be_read_are_a_sentence(client, tmp_path) -> None:
    log = tmp_path / "fleet" / "diagnoses" / "_delta_log"
    log.mkdir(parents=True)
    (log / f"{0:020}.json").write_text("{")
    answer = client.get("/api/v1/runs")
    assert (answer.status_code, "cannot be read" in answer.json()["detail"]) == (503, True)


@pytest.mark.slow
def test_a_site_without_results_has_no_section(serve) -> None:
    _, client = serve()
    answer = client.get("/api/v1/runs").json()
    assert (answer["total"], answer["vehicles"], answer["next"]) == (0, [], None)
    text = client.get("/runs", headers=HEADERS).text
    check_markup(text)
    assert '<a href="/runs"' not in text
